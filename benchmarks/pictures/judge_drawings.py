"""Find the workings on drawings whose truth is known; the detector was developed on other seeds."""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.judged_cases import JudgedCases
from benchmarks.pictures.paper_drawing import draw_on_paper
from benchmarks.results import Row
from pipeline.errors import GeometryError, InputError
from pipeline.geometry.drawing.find import read_drawing
from pipeline.survey.drawing.scale import find_bar, measure_bar
from pipeline.types import Image, Mask

UNSEEN = range(9000, 10_000)
RIGHT_IOU = 0.95


def judge(seed: int) -> Row:
    """Read one drawing without a hint and compare with the truth; one of several levels needs a hint by nature."""
    drawing = draw_on_paper(seed)
    picture = 255 - drawing.picture if "light on dark" in drawing.furniture else drawing.picture
    row: Row = {"walls": drawing.walls, "levels": len(drawing.levels)}
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


def verdict(row: Row) -> str:
    """Return right, hint or wrong; one of several levels taken without asking is wrong."""
    if "refused" in row:
        return "hint"
    return "right" if row["iou"] >= RIGHT_IOU and row["levels"] == 1 else "wrong"


def groups(row: Row) -> list[str]:
    """Return the kind of the walls and what else a drawing shows."""
    return [row["walls"], *row["furniture"], *(["several levels"] if row["levels"] > 1 else [])]


def note(rows: list[Row]) -> str:
    """Return how scale bars were measured, and which drawings were read wrong."""
    bars = [row["bar"] for row in rows if "scale bar" in row["furniture"]]
    good, missed = sum(bar is not None and abs(bar) <= 0.02 for bar in bars), sum(bar is None for bar in bars)
    lines = [
        f"Of {len(bars)} scale bars, {good} are found and measured within 2 %, {missed} are not found, and "
        f"{len(bars) - good - missed} are mistaken for another line."
    ]
    wrong = [f"{row['case']} ({row['walls']}, IoU {row['iou']:.3f})" for row in rows if verdict(row) == "wrong"]
    return "\n\n".join([*lines, *([f"Silently wrong: {', '.join(wrong)}."] if wrong else [])]) + "\n"


def _median(rows: list[Row]) -> str:
    found = [row["iou"] for row in rows if "iou" in row]
    return f"{np.median(found):.3f}" if found else ""


DRAWINGS = JudgedCases(
    name="drawings",
    cases=UNSEEN,
    sample=60,
    judge=judge,
    holds=lambda row: verdict(row) != "wrong",
    groups=groups,
    of="drawings with",
    columns={
        "drawings": len,
        "right without a hint": lambda rows: sum(verdict(row) == "right" for row in rows),
        "need a hint": lambda rows: sum(verdict(row) == "hint" for row in rows),
        "silently wrong": lambda rows: sum(verdict(row) == "wrong" for row in rows),
        "median IoU": _median,
    },
    note=note,
)

if __name__ == "__main__":
    sys.exit(DRAWINGS.run(__doc__))
