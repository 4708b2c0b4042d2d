"""Refusals of plans, pages and occupancy grids, and what follows their advice."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import cv2
import numpy as np
import PIL.Image as Pillow
import rasterio
import yaml
from matplotlib.figure import Figure
from rasterio.transform import Affine

from tests.mines import TEE, frame_for, plan_of
from tests.survey.advice.advice import Advice, WayOn, by

FREE, UNKNOWN, WALL = 254, 205, 0


def picture(folder: Path, dots_per_inch: float = 0.0, bar: tuple[int, int, int, int] | None = None) -> Path:
    """Write a plan; with a bar its box is (column, row, columns, rows)."""
    plan = plan_of(TEE, frame_for(TEE, margin_m=12.0))
    if bar is not None:
        left, top, width, height = bar
        plan[top : top + height, left : left + width] = 0
    options = {"dpi": (dots_per_inch, dots_per_inch)} if dots_per_inch else {}
    Pillow.fromarray(plan).save(folder / "a.png", **options)
    return folder / "a.png"


def noise(folder: Path) -> Path:
    """Write a plan with specks of dust all over its right half."""
    plan = cv2.copyMakeBorder(plan_of(TEE, frame_for(TEE)), 0, 0, 0, 4000, cv2.BORDER_CONSTANT, value=(255,) * 3)
    plan[::2, -3990::2] = 0
    cv2.imwrite(str(folder / "a.png"), plan)
    return folder / "a.png"


def geotiff(folder: Path, system: str, place: Affine) -> Path:
    """Write a plan as a GeoTIFF."""
    plan = plan_of(TEE, frame_for(TEE))
    size = {"height": plan.shape[0], "width": plan.shape[1], "count": 3, "dtype": "uint8"}
    with rasterio.open(folder / "a.tif", "w", driver="GTiff", crs=system, transform=place, **size) as file:
        file.write(plan.transpose(2, 0, 1))
    return folder / "a.tif"


def page(folder: Path, inches: tuple[float, float], text: str = "") -> Path:
    """Write a page with a cross of drifts at 1:500."""
    figure = Figure(figsize=inches)
    axis = figure.add_axes((0, 0, 1, 1))
    metres = 0.0254 * 500
    axis.set(xlim=(-5, inches[0] * metres - 5), ylim=(-25, inches[1] * metres - 25))
    axis.axis("off")
    axis.fill(*np.array(TEE.exterior.coords).T, color="black", lw=0)
    axis.text(0, -15, text)
    figure.savefig(folder / "a.pdf")
    return folder / "a.pdf"


def grid(folder: Path, grey: np.ndarray, origin: list[float] | None = None) -> Path:
    """Write an occupancy grid of 10 cm a cell."""
    cv2.imwrite(str(folder / "a.pgm"), grey.astype(np.uint8))
    head = {"image": "a.pgm", "resolution": 0.1, "origin": origin or [0.0, 0.0, 0.0], "negate": 0}
    (folder / "a.yaml").write_text(yaml.safe_dump({**head, "occupied_thresh": 0.65, "free_thresh": 0.196}))
    return folder / "a.yaml"


def rooms(count: int, cells: int) -> np.ndarray:
    """Return a row of free rooms, between which a wall is."""
    grey = np.full((cells + 20, count * (cells + 10) + 10), WALL, np.uint8)
    for k in range(count):
        left = 10 + k * (cells + 10)
        grey[10 : 10 + cells, left : left + cells] = FREE
    return grey


def lattice() -> np.ndarray:
    """Return a passage of 30 cm that runs to and fro, which is narrower than what robots drive on."""
    grey = np.full((200, 200), WALL, np.uint8)
    for row in range(10, 190, 10):
        grey[row : row + 3, 10:190] = FREE
        end = 10 if (row // 10) % 2 else 187
        grey[row : row + 13, end : end + 3] = FREE
    return grey


CASES = {
    "no scale": Advice("no scale bar found; state --px-per-m", picture, {}, (by(px_per_m=8.0),)),
    "no scale of a scan": Advice(
        "no scale bar found; state --px-per-m", partial(picture, dots_per_inch=200), {}, (by(ratio=984.25),)
    ),
    "a bar in a box": Advice(
        "no scale bar found; state --px-per-m",
        partial(picture, bar=(300, 20, 3, 160)),
        {},
        (WayOn({"bar_box_px": (290, 10, 470, 40), "bar_length_m": 20.0}, partial(picture, bar=(300, 20, 160, 8))),),
    ),
    "a box outside": Advice(
        "not inside the picture of",
        partial(picture, bar=(300, 20, 160, 8)),
        {"bar_box_px": (290, 10, 9000, 40), "bar_length_m": 20.0},
        (by(bar_box_px=(290, 10, 470, 40), bar_length_m=20.0),),
    ),
    "a box without a bar": Advice(
        "--bar-box COL0,ROW0,COL1,ROW1 states where the bar is",
        partial(picture, bar=(300, 20, 160, 8)),
        {"bar_box_px": (290, 60, 470, 90), "bar_length_m": 20.0},
        (by(bar_box_px=(290, 10, 470, 40), bar_length_m=20.0), by(px_per_m=8.0)),
    ),
    "a scan without a resolution": Advice(
        "--scale needs the resolution of the scan", picture, {"ratio": 500.0}, (by(px_per_m=8.0),)
    ),
    "pixels in degrees": Advice(
        "warp it to a metric system first, or state --px-per-m",
        partial(geotiff, system="EPSG:4326", place=Affine(1e-6, 0, 9, 0, -1e-6, 46)),
        {},
        (
            by(px_per_m=8.0),
            WayOn({}, partial(geotiff, system="EPSG:32632", place=Affine(0.125, 0, 500_000, 0, -0.125, 5e6))),
        ),
    ),
    "pixels of a stretched map": Advice(
        "warp it to a metric system first, or state --px-per-m",
        partial(geotiff, system="EPSG:4087", place=Affine(0.125, 0, 1e6, 0, -0.125, 6e6)),
        {},
        (by(px_per_m=8.0),),
    ),
    "pixels outside their system": Advice(
        "--px-per-m states the scale instead",
        partial(geotiff, system="EPSG:32632", place=Affine(0.125, 0, 9e8, 0, -0.125, 9e8)),
        {},
        (by(px_per_m=8.0),),
    ),
    "a large page": Advice(
        "state --dpi too, {} or less fits",
        partial(page, inches=(49, 56)),
        {"px_per_m": 4.0},
        (by(px_per_m=4.0, dpi=60.0),),
    ),
    "a resolution that is too high": Advice(
        "--dpi states another",
        partial(page, inches=(16, 12)),
        {"dpi": 1200.0, "ratio": 500.0},
        (by(dpi=150.0, ratio=500.0),),
    ),
    "noise": Advice(
        "is it noise? --crop reads a part", noise, {"px_per_m": 8.0}, (by(px_per_m=8.0, crop_px=(0, 0, 704, 384)),)
    ),
    "several rooms": Advice(
        "--start E,N states a place in one",
        partial(grid, grey=rooms(3, 60), origin=[500.0, 500.0, 0.0]),
        {},
        (by(entrance_m=(504.0, 504.0)),),
    ),
    "a place in rock": Advice(
        "no free area within",
        partial(grid, grey=rooms(1, 60)),
        {"entrance_m": (90.0, 90.0)},
        (by(entrance_m=(4.0, 4.0)),),
    ),
    "narrow passages": Advice(
        "--narrowest 0 --thinnest 0 keep the map's cells as they are",
        partial(grid, grey=lattice()),
        {},
        (by(narrowest_m=0.0, thinnest_m=0.0),),
    ),
}
