"""Draw four generated mines of each style (docs/generated.png)."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.patches import PathPatch
from shapely import Polygon

from minexplore.splits import STYLES
from pipeline.compose import compose
from pipeline.geometry.generated.generate import generate_workings
from pipeline.report.figures.mine import outline_path
from pipeline.report.figures.style import ROCK, new_figure, to_image
from pipeline.store.codecs import encode
from pipeline.store.files import write_atomically

_SEEDS = 4


def main() -> int:
    """Draw the mines with the default parameters."""
    params = compose(["survey=procedural"]).survey
    assert params.kind == "procedural"
    figure = new_figure(9.0, 9.0)
    for row, style in enumerate(STYLES):
        for seed in range(_SEEDS):
            axis = figure.add_subplot(len(STYLES), _SEEDS, row * _SEEDS + seed + 1)
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
    path = Path("docs/generated.png")
    write_atomically(path, encode(path, to_image(figure)))
    print(f"{path} is written")
    return 0


if __name__ == "__main__":
    sys.exit(main())
