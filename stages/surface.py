"""Stage 4: the visible rock, an octagonal bore and over it rock as rough as measured, to be seen only (mine frame)."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from pipeline.geometry.octagon import octagonal_bore
from pipeline.geometry.overlay import closed_shell
from pipeline.geometry.rock_texture import rock_texture
from pipeline.geometry.shell import ShellReport, check_shell, joined
from pipeline.params.surface import SurfaceParams
from pipeline.report.rock import draw_sections, draw_spectra
from pipeline.rock import (
    RoughnessReport,
    amplitude_table,
    build_rock,
    choose_bands,
    chunk_files,
    measure_sources,
    report_rock,
    rock_sources,
    widen_spacing,
)
from pipeline.stage import Artifact, Stage, main
from pipeline.store.codecs import Bundle, Meshes
from pipeline.types import DriftNetwork, FreeSpace, Image, Rock


def model_surface(params: SurfaceParams, free_space: FreeSpace, topology: DriftNetwork, rock: Rock) -> dict[str, Any]:
    """Return both layers, the rock texture, and what is known of the rock's roughness."""
    params, look = widen_spacing(params, free_space.polygon, rock.height_m), params.texture
    base = octagonal_bore(
        free_space.polygon, rock.height_m, params.sill_chamfer_m, params.back_chamfer_m, look.repeat_m
    )
    check_shell(*joined(base))
    sources = measure_sources(params)
    noise = choose_bands(params, sources)
    overlay = build_rock(params, free_space.polygon, topology, rock.height_m, noise)
    with ThreadPoolExecutor(2) as pool:
        checked = pool.submit(check_shell, *closed_shell(overlay))
        reported = pool.submit(report_rock, params, sources, noise, overlay)
        return {
            "meshes": base,
            "overlay": chunk_files(overlay, params.overlay.tile_m, look.repeat_m),
            "texture": rock_texture(
                look.size_px, look.spectral_exponent, look.contrast, look.rgb, np.random.default_rng(look.seed)
            ),
            "sections": draw_sections(overlay, base, rock.height_m),
            "amplitude": amplitude_table(overlay),
            "roughness": reported.result(),
            "spectra": draw_spectra(reported.result()),
            "shell": checked.result(),
        }


STAGE = Stage(
    name="surface",
    run=model_surface,
    sources=rock_sources,
    reads={
        "free_space": Artifact("contours/free_space.geojson", FreeSpace),
        "topology": Artifact("contours/topology.json", DriftNetwork),
        "rock": Artifact("compile3d/rock.json", Rock),
    },
    writes={
        "meshes": Artifact("surface/meshes.npz", Meshes),
        "overlay": Artifact("surface/overlay", Bundle),
        "texture": Artifact("surface/rock.png", Image),
        "shell": Artifact("surface/shell.json", ShellReport),
        "roughness": Artifact("surface/roughness.json", RoughnessReport),
        "spectra": Artifact("surface/roughness.png", Image),
        "sections": Artifact("surface/sections.png", Image),
        "amplitude": Artifact("surface/amplitude.csv", str),
    },
)

if __name__ == "__main__":
    sys.exit(main(STAGE))
