"""Find the workings on drawings whose truth is known; writes docs/evidence/parts/drawings.md and its picture.

The detector was developed on twelve hundred seeds. Two hundred others were never looked at. Results of another detector
or another generator are made again.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from baselines.base.markdown import markdown_table, write_table
from benchmarks.pictures.paper_drawing import FURNITURE, WALLS, draw_on_paper
from benchmarks.resume import resume
from pipeline.errors import GeometryError, InputError
from pipeline.geometry.drawing.find import read_drawing
from pipeline.report.results import shrink_picture
from pipeline.store.files import write_atomically
from pipeline.store.hashing import import_closure, sha256_file, sha256_named
from pipeline.survey.drawing.scale import find_bar, measure_bar
from pipeline.survey.drawing.workings import draw_detected
from pipeline.types import Image, Mask

RESULTS = Path("artifacts/bench/drawings.jsonl")
PAGE, PICTURE = Path("docs/evidence/parts/drawings.md"), Path("docs/drawings.jpg")
DEVELOPED = [seed for first in (8000, 7000, 6000, 5000, 4000, 0) for seed in range(first, first + 200)]
FRESH = range(9000, 9200)
RIGHT_IOU = 0.95
_COLUMNS = ("drawings with", "drawings", "right without a hint", "need a hint", "silently wrong", "median IoU")
_SHOWN = (25, 8, 12, 38, 14, 3)
_TILE = (620, 470)


def judge(seed: int) -> dict[str, Any]:
    """Read one drawing without a hint and compare with the truth; one of several levels needs a hint by nature."""
    drawing = draw_on_paper(seed)
    picture = 255 - drawing.picture if "light on dark" in drawing.furniture else drawing.picture
    row: dict[str, Any] = {"seed": seed, "style": drawing.style, "walls": drawing.walls, "levels": len(drawing.levels)}
    row |= {"furniture": drawing.furniture, "bar": _bar_error(picture, drawing.px_per_m, drawing.bar_m)}
    try:
        found = read_drawing(picture, None)
    except GeometryError as error:
        return row | {"refused": str(error)}
    return row | {"iou": round(max(_iou(found.mask, level) for level in drawing.levels), 4)}


def _iou(one: Mask, other: Mask) -> float:
    return float((one & other).sum() / (one | other).sum())


def _bar_error(picture: Image, px_per_m: float, bar_m: int | None) -> float | None:
    """Return the relative error of the measured bar's length in pixels; None if none is drawn or found."""
    box = find_bar(picture)
    if box is None or bar_m is None:
        return None
    try:
        return round(measure_bar(picture[box[1] : box[3], box[0] : box[2]], 1.0, "bar") / (px_per_m * bar_m) - 1, 4)
    except InputError:
        return None


def verdict(row: dict[str, Any]) -> str:
    """Return right, hint or wrong; one of several levels taken without asking is wrong."""
    if "refused" in row:
        return "hint"
    return "right" if row["iou"] >= RIGHT_IOU and row["levels"] == 1 else "wrong"


def table(rows: list[dict[str, Any]]) -> str:
    """Return the results by kind of wall and by what else a drawing shows, as Markdown."""
    counted: list[tuple[object, ...]] = []
    groups = [(walls, [r for r in rows if r["walls"] == walls]) for walls in WALLS]
    groups += [(name, [r for r in rows if name in r["furniture"]]) for name in FURNITURE]
    groups += [("several levels", [r for r in rows if r["levels"] > 1]), ("all", rows)]
    for name, some in groups:
        counts = [sum(verdict(r) == kind for r in some) for kind in ("right", "hint", "wrong")]
        ious = [r["iou"] for r in some if "iou" in r]
        median = f"{np.median(ious):.3f}" if ious else ""
        counted.append((name, len(some), *counts, median))
    bars = [r["bar"] for r in rows if "scale bar" in r["furniture"]]
    good = sum(b is not None and abs(b) <= 0.02 for b in bars)
    missed = sum(b is None for b in bars)
    lines = [
        markdown_table(_COLUMNS, counted),
        f"Of {len(bars)} scale bars, {good} are found and measured within 2 %, {missed} are not found, and "
        f"{len(bars) - good - missed} are mistaken for another line.",
    ]
    wrong = [f"{row['seed']} ({row['walls']}, IoU {row['iou']:.3f})" for row in rows if verdict(row) == "wrong"]
    if wrong:
        lines += ["", f"Silently wrong: {', '.join(wrong)}."]
    return "\n".join(lines) + "\n"


def draw_examples() -> Image:
    """Draw several drawings with what was detected."""
    tiles = []
    for seed in _SHOWN:
        drawing = draw_on_paper(seed)
        picture = 255 - drawing.picture if "light on dark" in drawing.furniture else drawing.picture
        with suppress(GeometryError):  # a refused drawing is shown as it is
            picture = draw_detected(picture, read_drawing(picture, None).mask, None)
        scale = min(_TILE[0] / picture.shape[1], _TILE[1] / picture.shape[0])
        small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        tile = np.full((_TILE[1] + 6, _TILE[0] + 6, 3), 225, np.uint8)
        tile[: small.shape[0], : small.shape[1]] = small
        tiles.append(tile)
    return np.vstack([np.hstack(tiles[k : k + 2]) for k in range(0, len(tiles), 2)])


def tables(rows: list[dict[str, Any]]) -> str:
    """Return the results of both sets of drawings as Markdown."""
    developed, fresh = ([row for row in rows if row["seed"] in seeds] for seeds in (DEVELOPED, FRESH))
    return (
        f"## {len(fresh)} drawings that the detector had not seen\n\nSeeds {_span(fresh)}.\n\n{table(fresh)}\n"
        f"## {len(developed)} drawings that the detector was developed on\n\nSeeds {_span(developed)}.\n\n"
        + table(developed)
    )


def _span(rows: list[dict[str, Any]]) -> str:
    """Return the seeds of rows as ranges, such as 0 to 72 and 4000 to 4199."""
    seeds = sorted(row["seed"] for row in rows)
    ranges: list[list[int]] = []
    for seed in seeds:
        if ranges and seed == ranges[-1][-1] + 1:
            ranges[-1][-1] = seed
        else:
            ranges.append([seed, seed])
    return " and ".join(f"{first} to {last}" for first, last in ranges) or "none"


def main() -> int:
    """Read the drawings that have no result yet, and write the page; exit code 2 if one is silently wrong."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.pictures.judge_drawings", description=__doc__)
    parser.add_argument("--count", type=int, default=1200, help="drawings of each set at most")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", choices=["developed", "fresh"], help="judge one set; the page is not written")
    given = parser.parse_args()
    root = Path.cwd()
    sources = import_closure(Path(sys.modules[read_drawing.__module__].__file__ or "").resolve(), root)
    sources = sorted({*sources, *import_closure(root / "benchmarks/pictures/paper_drawing.py", root)})
    code = sha256_named({path.as_posix(): sha256_file(root / path) for path in sources})[:16]
    sets = {"fresh": FRESH, "developed": DEVELOPED}
    seeds = [seed for name, each in sets.items() if given.only in (None, name) for seed in each[: given.count]]
    with ProcessPoolExecutor(given.jobs) as pool:

        def judged(seeds: list[int]) -> Iterator[dict[str, Any]]:
            return (row | {"code": code} for row in pool.map(judge, seeds))

        rows = resume(RESULTS, seeds, judged, "drawing", is_valid=lambda row: row.get("code") == code)
    rows = [row for row in rows if row["seed"] in set(seeds)]
    if given.only is None:
        write_table(PAGE, tables(rows))
        examples = RESULTS.with_name("drawings.png")
        cv2.imwrite(str(examples), draw_examples())
        write_atomically(PICTURE, shrink_picture(examples))
        print(tables(rows))
    else:
        print(table(rows))
    wrong = [row for row in rows if verdict(row) == "wrong"]
    for row in wrong:
        print(row)
    return 2 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
