"""Stage 4: the visible rock, an octagonal bore as a visual-only shell with a rock material (metres, mine frame)."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from pipeline.geometry.octagon import octagonal_bore
from pipeline.geometry.rock_texture import rock_texture
from pipeline.geometry.shell import ShellReport, check_shell
from pipeline.params.surface import SurfaceParams
from pipeline.stage import Artifact, Stage, main
from pipeline.store.codecs import Meshes
from pipeline.types import FreeSpace, Image, Rock


def model_surface(params: SurfaceParams, free_space: FreeSpace, rock: Rock) -> dict[str, Any]:
    """Return the base layer's meshes, the rock texture and the shell's report."""
    look = params.texture
    meshes = octagonal_bore(
        free_space.polygon, rock.height_m, params.sill_chamfer_m, params.back_chamfer_m, look.repeat_m
    )
    rng = np.random.default_rng(look.seed)
    return {
        "meshes": meshes,
        "texture": rock_texture(look.size_px, look.spectral_exponent, look.contrast, look.rgb, rng),
        "shell": check_shell(meshes),
    }


STAGE = Stage(
    name="surface",
    run=model_surface,
    reads={
        "free_space": Artifact("contours/free_space.geojson", FreeSpace),
        "rock": Artifact("compile3d/rock.json", Rock),
    },
    writes={
        "meshes": Artifact("surface/meshes.npz", Meshes),
        "texture": Artifact("surface/rock.png", Image),
        "shell": Artifact("surface/shell.json", ShellReport),
    },
)

if __name__ == "__main__":
    sys.exit(main(STAGE))
