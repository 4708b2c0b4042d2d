"""Pictures of the docs that stand alone: `python -m benchmarks.pictures.gallery NAME`."""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Callable
from pathlib import Path

import gymnasium
import matplotlib as mpl
import numpy as np
from matplotlib.patches import PathPatch
from PIL import Image as Pillow
from shapely import Polygon

import minexplore  # noqa: F401  (registers the environments)
from minexplore.__main__ import ahead
from minexplore.splits import STYLES
from minexplore.task import TaskParams
from pipeline.compose import compose
from pipeline.geometry.generated.generate import generate_workings
from pipeline.report.figures.mine import outline_path
from pipeline.report.figures.style import ROCK, new_figure, to_image
from pipeline.store.codecs import encode
from pipeline.store.files import write_atomically

mpl.use("agg")

_STYLE_SEEDS = 4
_STEPS_PER_S = 10  # of the task's control; each is a frame
_WARM_UP, _FRAMES = 40, 100  # after four seconds the robot drives at full speed
_CLIP_PX, _COLOURS = (384, 288), 160


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
    "styles": (Path("docs/generated.png"), draw_styles),
    "drive": (Path("docs/drive.gif"), record_drive),
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
