"""Pictures of the docs that stand alone: `python -m benchmarks.pictures.gallery NAME`."""

from __future__ import annotations

import argparse
import io
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import gymnasium
import matplotlib as mpl
import numpy as np
from matplotlib.patches import PathPatch
from PIL import Image as Pillow
from shapely import Polygon

import minexplore  # noqa: F401  (registers the environments)
from benchmarks.pictures.export_picture import draw_export
from benchmarks.pictures.scan_picture import draw_scan
from benchmarks.pictures.volume_picture import draw_volume
from minexplore.__main__ import ahead
from minexplore.bundle import GeomGroup
from minexplore.floors.floor import Floor
from minexplore.splits import STYLES
from minexplore.task import TaskParams
from pipeline.compose import compose
from pipeline.geometry.generated.generate import generate_workings
from pipeline.mjcf.bundle import OpenedBundle, open_bundle
from pipeline.mjcf.render import render_from
from pipeline.report.figures.mine import outline_path
from pipeline.report.figures.style import ROCK, new_figure, to_image
from pipeline.store.codecs import encode
from pipeline.store.files import write_atomically
from pipeline.types import Image
from tests.heights import UNDER, Leg, MineWithHeights, levels, seam, shelves, spiral

mpl.use("agg")
import matplotlib.pyplot as plt

_PLANS = {
    "spiral decline of three turns": spiral(3),
    "three levels with ramps and a shaft": levels(),
    "room and pillar on a dipping seam": seam(),
    "drift under drift": UNDER,
    "cave with shelves": shelves(),
}
_VIEW_PX, _QUALITY = (640, 420), 80
_EYE_M, _AHEAD_M, _BACK_M = 1.3, 2.5, 6.0
_STYLE_SEEDS = 4
_STEPS_PER_S = 10  # of the task's control; each is a frame
_WARM_UP, _FRAMES = 40, 100  # after four seconds the robot drives at full speed
_CLIP_PX, _COLOURS = (384, 288), 160


def mines_of(surveys: list[dict[str, Leg]], overrides: list[str]) -> Iterator[MineWithHeights]:
    """Yield the mine of each survey; its files are gone with the next one."""
    config = compose(overrides)
    for legs in surveys:
        with tempfile.TemporaryDirectory() as folder:
            yield MineWithHeights(legs, config, Path(folder))


def draw_levels(path: Path) -> None:
    """Draw mines with heights: the plan by level, and the floor in space."""
    figure = plt.figure(figsize=(11, 3.2 * len(_PLANS)))
    for row, (name, mine) in enumerate(zip(_PLANS, mines_of(list(_PLANS.values()), ["preset=light"]), strict=True)):
        floor = mine.floor
        plan = figure.add_subplot(len(_PLANS), 2, 2 * row + 1)
        level = floor.vertices[floor.faces][:, :, 2].mean(axis=1)
        plan.tripcolor(floor.vertices[:, 0], floor.vertices[:, 1], floor.faces, facecolors=level, cmap="viridis")
        for one, two in floor.seams():
            plan.plot(*np.array([one, two]).T, "r:", linewidth=1)
        plan.set_aspect("equal")
        plan.set_title(f"{name}: {len(floor.offset_m)} sheets in plan, seams dotted (m)", fontsize=9)
        space = figure.add_subplot(len(_PLANS), 2, 2 * row + 2, projection="3d")
        moved = np.pad(floor.offset_m, [(0, 0), (0, 1)])[floor.sheet]
        places = (floor.vertices[floor.faces] - moved[:, None]).reshape(-1, 3)
        faces = np.arange(len(places)).reshape(-1, 3)
        space.plot_trisurf(*places[:, :2].T, places[:, 2], triangles=faces, cmap="viridis", linewidth=0)
        space.set_box_aspect(np.maximum(np.ptp(places, axis=0) * [1, 1, 2], 8))
        space.set_title("folded (heights doubled)", fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=70)


def draw_declines(path: Path) -> None:
    """Look along a spiral decline, levels with ramps, and a drift under a drift, with their rock."""
    rows = []
    for mine in mines_of([spiral(3), levels(), UNDER], ["realism.tilt_deg=0", "contours.tolerance_m=0.16"]):
        world, lines = open_bundle(mine.bundle), [np.array(leg.stations_m) for leg in mine.network.legs]
        seam_m, stations, line = mine.floor.seams()[0, 0], np.concatenate(lines), max(lines, key=len)
        before = stations[_nearest(np.linalg.norm(stations - seam_m, axis=1), _BACK_M)]
        eye, further = line[len(line) // 2], line[len(line) // 2 :]
        target = further[_nearest(np.linalg.norm(further - eye, axis=1), _AHEAD_M)]
        rows.append(cv2.hconcat([_view(world, mine.floor, *each) for each in ((before, seam_m), (eye, target))]))
    cv2.imwrite(str(path), cv2.vconcat(rows), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])


def _nearest(distances_m: np.ndarray, wanted_m: float) -> int:
    return int(np.abs(distances_m - wanted_m).argmin())


def _view(world: OpenedBundle, floor: Floor, eye_m: np.ndarray, target_m: np.ndarray) -> Image:
    T = np.array(world.record.T_world_mine)
    places = floor.fold(np.array([[*place, _EYE_M] for place in (eye_m, target_m)]))
    eye, towards = ((T @ [*place, 1.0])[:3] for place in places)
    return render_from(world.model, eye, towards, 75.0, _VIEW_PX, (GeomGroup.FLOOR, GeomGroup.ROUGH_SURFACE))


def draw_styles(path: Path) -> None:
    """Draw four generated mines of each style, with the default parameters."""
    params = compose(["survey=procedural"]).survey
    assert params.kind == "procedural"
    figure = new_figure(9.0, 9.0)
    for row, style in enumerate(STYLES):
        for seed in range(_STYLE_SEEDS):
            axis = figure.add_subplot(len(STYLES), _STYLE_SEEDS, row * _STYLE_SEEDS + seed + 1)
            numbers = {**params.mine.model_dump(), "style": style}
            mine = generate_workings(rib_noise_m=params.rib_noise_m, rng=np.random.default_rng(seed), **numbers)
            for part in mine.geoms:
                assert isinstance(part, Polygon)
                axis.add_patch(PathPatch(outline_path(part), facecolor=ROCK, lw=0))
            west, south, east, north = mine.bounds
            half = max(east - west, north - south) / 2 + 5
            x, y = (west + east) / 2, (south + north) / 2
            axis.set(xlim=(x - half, x + half), ylim=(y - half, y + half), aspect="equal", xticks=[], yticks=[])
            if seed == 0:
                axis.set_ylabel(style.replace("_", " "))
    write_atomically(path, encode(path, to_image(figure)))


def record_drive(path: Path) -> None:
    """Record ten seconds behind a robot that drives where its beams reach farthest, as an animated picture."""
    env = gymnasium.make("MineXplore/ChileanMineEntrance-v0", render_mode="rgb_array", camera="chase")
    observation, _ = env.reset(seed=0)
    pictures: list[Pillow.Image] = []
    for step in range(_WARM_UP + _FRAMES):
        observation, *_ = env.step(ahead(observation, TaskParams().beams))
        if step >= _WARM_UP:
            frame = Pillow.fromarray(np.asarray(env.render()))
            pictures.append(frame.resize(_CLIP_PX, Pillow.Resampling.LANCZOS))
    env.close()
    some = Pillow.fromarray(np.vstack([np.asarray(picture) for picture in pictures[::5]]))
    palette = some.quantize(_COLOURS, kmeans=8)
    few = [picture.quantize(palette=palette, dither=Pillow.Dither.NONE) for picture in pictures]
    data, pause_ms = io.BytesIO(), 1000 // _STEPS_PER_S
    few[0].save(data, "GIF", save_all=True, append_images=few[1:], duration=pause_ms, loop=0, optimize=False)
    write_atomically(path, data.getvalue())


PICTURES: dict[str, tuple[Path, Callable[[Path], None]]] = {
    "levels": (Path("docs/levels.png"), draw_levels),
    "declines": (Path("docs/decline.jpg"), draw_declines),
    "styles": (Path("docs/generated.png"), draw_styles),
    "drive": (Path("docs/drive.gif"), record_drive),
    "export": (Path("docs/export.jpg"), draw_export),
    "volume": (Path("docs/volume-world.png"), draw_volume),
    "scan": (Path("docs/scan.jpg"), draw_scan),
}


def main() -> int:
    """Draw the named pictures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.pictures.gallery", description=__doc__)
    parser.add_argument("names", nargs="+", choices=list(PICTURES))
    for name in parser.parse_args().names:
        path, draw = PICTURES[name]
        draw(path)
        print(f"{path} is written")
    return 0


if __name__ == "__main__":
    sys.exit(main())
