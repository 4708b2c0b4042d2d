"""What looks and fittings cost: seconds a frame, and bytes of the present world, as tables in docs/how-to/look.md."""

from __future__ import annotations

from pathlib import Path

import mujoco

from baselines.base.markdown import markdown_table
from minexplore.bundle import MESHES, ROCK_TEXTURE, ROOF, WALLS, is_cover, is_fitting
from pipeline.compose import compose
from pipeline.params.reading.composed import root_overrides
from pipeline.store.codecs import Bundle, decode
from stages.realism import STAGE

ARTIFACTS = Path("artifacts")
_COLUMNS = (
    *("`realism.furnish`", "bundle, MB", "rock", "texture", "floor", "furniture"),
    *("geoms of the floor", "of furniture"),
)
LEVELS = ("light", "full", "meshed")


def bundle_of(furnish: str) -> Bundle:
    """Return the files of the present world with other furniture; stage 5 builds them in memory."""
    params = compose([*root_overrides(), f"realism.furnish={furnish}"]).realism
    inputs = {key: decode(artifact.at(ARTIFACTS), artifact.kind) for key, artifact in STAGE.reads.items()}
    world: Bundle = STAGE.run(params, **inputs)["world"]
    return world


def measure_bundle(files: Bundle) -> list[float]:
    """Return MB of the bundle, its rock, texture, visible floor and furniture, and the geoms of floor and furniture."""
    stems = {name: Path(name).stem for name in files if name.startswith(MESHES)}
    cover = [name for name, stem in stems.items() if is_cover(stem)]
    furniture = [name for name, stem in stems.items() if is_fitting(stem) and name not in cover]
    rock = [name for name, stem in stems.items() if stem.startswith((WALLS, ROOF))]
    parts = [list(files), rock, [ROCK_TEXTURE], cover, furniture]
    sizes = [sum(len(files[name]) for name in part) / 1e6 for part in parts]
    return [*sizes, len(cover), len(furniture)]


def tables(seconds: dict[str, float], size_px: tuple[int, int]) -> str:
    """Return both tables as Markdown; `seconds` are a frame's by look."""
    frames = markdown_table(seconds, [[f"{s:.2f} s" for s in seconds.values()]])
    sizes = ((level, measure_bundle(bundle_of(level))) for level in LEVELS)
    rows = ((level, *(f"{v:.1f}" for v in found[:5]), *(f"{v:.0f}" for v in found[5:])) for level, found in sizes)
    return (
        f"A frame of {size_px[0]} x {size_px[1]} px from the robot in the small drift, in seconds of a processor core, "
        f"by OSMesa (MuJoCo {mujoco.__version__}):\n\n{frames}\nThe present world:\n\n{markdown_table(_COLUMNS, rows)}"
    )
