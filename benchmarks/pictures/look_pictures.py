"""Draw the looks and fittings of how-to/look.md from inside a small drift of andesite, and measure what they cost."""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "osmesa")

import cv2
import mujoco
import numpy as np
import shapely
from shapely import LineString, Polygon

from baselines.base.markdown import markdown_table, write_table
from benchmarks.resume import run_benchmark
from benchmarks.worlds.small_world import build_world
from minexplore.bundle import MESHES, MODEL, OVERVIEW_CAMERA, ROCK_TEXTURE, ROOF, WALLS, GeomGroup, is_cover, is_fitting
from minexplore.looks import LOOKS, PLAIN
from minexplore.physics.robot import RobotParams, free_joint_qpos
from minexplore.pictures.render import Renderer
from minexplore.sensing.coverage import CoverageGrid
from minexplore.task import TaskParams
from minexplore.world import World, load_world
from pipeline.compose import compose
from pipeline.mjcf.render import render_camera
from pipeline.params.reading.composed import root_overrides
from pipeline.store.codecs import Bundle, decode
from pipeline.store.files import write_atomically
from stages.realism import STAGE

PAGE = Path("docs/how-to/look.md")
PICTURE, CUT_AWAY = Path("docs/look.jpg"), Path("docs/cut-away.jpg")
ARTIFACTS = Path("artifacts")
_COLUMNS = (
    *("`realism.furnish`", "bundle, MB", "rock", "texture", "floor", "furniture"),
    *("geoms of the floor", "of furniture"),
)
LEVELS = ("light", "full", "meshed")
_MAIN = LineString([(0, 0), (25, 2), (45, 8), (70, 6)]).buffer(2.6, join_style="mitre")
WORKINGS: Polygon = shapely.union_all([_MAIN, LineString([(45, 8), (50, 32)]).buffer(2.4, cap_style="flat")])
_ENTRANCE_M = (3.0, 0.2)
_POSES = ((8.0, 0.9, 0.08), (52.0, 7.2, 2.9))  # x, y (m), yaw (rad): the dry zone, and out of the water
_SIZE_PX = (900, 600)
_COLOUR = (235, 235, 235)


def draw_look(world: World) -> tuple[np.ndarray, float]:
    """Return the views (rows, cols, 3) BGR from a robot at the poses, and a later frame's seconds of a core."""
    robot, task = RobotParams(), TaskParams()
    grid = CoverageGrid(world, task.cell_m, robot.radius_m, np.array(_ENTRANCE_M), 1e3)
    renderer = Renderer(world, world.T_world_mine, grid, robot, 1, _SIZE_PX)
    views, seconds = [], []
    nothing = np.zeros_like(grid.reachable)
    for x, y, yaw in _POSES:
        qpos = np.concatenate([free_joint_qpos(world.T_world_mine, robot, x, y, yaw), np.zeros(2)])[None]
        poses = np.array([[x, y, yaw]])
        views.append(renderer.draw("front", qpos, nothing, poses)[..., ::-1])
        start = time.process_time()
        renderer.draw("front", qpos, nothing, poses)
        seconds.append(time.process_time() - start)
    renderer.close()
    return cv2.hconcat(views), min(seconds)


def draw_cut_away(folder: Path) -> np.ndarray:
    """Return the world from above, (rows, cols, 3) BGR, with its roof away."""
    model = mujoco.MjModel.from_xml_path(str(folder / MODEL))
    groups = (GeomGroup.FLOOR, GeomGroup.COLLISION)
    return render_camera(model, OVERVIEW_CAMERA, 2 * _SIZE_PX[0], _SIZE_PX[1], groups, spots=False)


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


def main() -> int:
    """Build a world for every look, and write both pictures and the page's tables."""
    views, above, times = [], [], {}
    for name in LOOKS:
        overrides = [f"look={name}", "fittings=none" if name == PLAIN else "realism.furnish=full"]
        with tempfile.TemporaryDirectory() as folder:
            build_world(Path(folder), WORKINGS, _ENTRANCE_M, overrides)
            view, seconds = draw_look(load_world(Path(folder)))
            if name in (PLAIN, "dry"):
                above.append(draw_cut_away(Path(folder)))
        print(f"look-pictures: {name}: {seconds:.3f} s a frame of {_SIZE_PX[0]} x {_SIZE_PX[1]} px", flush=True)
        cv2.putText(view, name, (20, 45), cv2.FONT_HERSHEY_SIMPLEX, 1.2, _COLOUR, 2, cv2.LINE_AA)
        views.append(view)
        times[name] = seconds
    for path, rows in ((PICTURE, views), (CUT_AWAY, above)):
        small = cv2.resize(cv2.vconcat(rows), None, fx=0.8, fy=0.8, interpolation=cv2.INTER_AREA)
        write_atomically(path, cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, 82])[1].tobytes())
    write_table(PAGE, tables(times, _SIZE_PX))
    return 0


if __name__ == "__main__":
    sys.exit(run_benchmark("look-pictures", main))
