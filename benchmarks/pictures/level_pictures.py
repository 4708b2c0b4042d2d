"""Pictures of mines with heights for docs/how-to/heights.md: the plan by level, and the floor in space."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import matplotlib as mpl
import numpy as np

from pipeline.compose import compose
from tests.heights import UNDER, MineWithHeights, levels, seam, shelves, spiral

mpl.use("agg")
import matplotlib.pyplot as plt

_CASES = {
    "spiral decline of three turns": spiral(3),
    "three levels with ramps and a shaft": levels(),
    "room and pillar on a dipping seam": seam(),
    "drift under drift": UNDER,
    "cave with shelves": shelves(),
}
_FILE = Path("docs/levels.png")


def main() -> int:
    """Build the cases and draw them."""
    config = compose(["preset=light"])
    figure = plt.figure(figsize=(11, 3.2 * len(_CASES)))
    for row, (name, legs) in enumerate(_CASES.items()):
        with tempfile.TemporaryDirectory() as folder:
            floor = MineWithHeights(legs, config, Path(folder)).floor
        plan = figure.add_subplot(len(_CASES), 2, 2 * row + 1)
        level = floor.vertices[floor.faces][:, :, 2].mean(axis=1)
        plan.tripcolor(floor.vertices[:, 0], floor.vertices[:, 1], floor.faces, facecolors=level, cmap="viridis")
        for one, two in floor.seams():
            plan.plot(*np.array([one, two]).T, "r:", linewidth=1)
        plan.set_aspect("equal")
        plan.set_title(f"{name}: {len(floor.offset_m)} sheets in plan, seams dotted (m)", fontsize=9)
        space = figure.add_subplot(len(_CASES), 2, 2 * row + 2, projection="3d")
        moved = np.pad(floor.offset_m, [(0, 0), (0, 1)])[floor.sheet]
        places = (floor.vertices[floor.faces] - moved[:, None]).reshape(-1, 3)
        faces = np.arange(len(places)).reshape(-1, 3)
        space.plot_trisurf(*places[:, :2].T, places[:, 2], triangles=faces, cmap="viridis", linewidth=0)
        space.set_box_aspect(np.maximum(np.ptp(places, axis=0) * [1, 1, 2], 8))
        space.set_title("folded (heights doubled)", fontsize=9)
    figure.tight_layout()
    figure.savefig(_FILE, dpi=70)
    print(_FILE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
