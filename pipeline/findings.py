"""What was detected of a mine's file, as remarks: each value with the option that overrules it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from minesurveys.remarks import Remark
from pipeline.survey.detection.detected_section import Detection
from pipeline.survey.drawing.workings import WIDTHS_M

_KINDS = {
    "plan": "a plan image",
    "grid": "an occupancy grid",
    "vector": "a vector drawing",
    "passages": "a station survey",
    "centrelines": "centrelines of drifts",
    "solid": "the surface of workings",
    "cloud": "a scan of workings",
}
_WIDTH_OPTIONS = {
    "plan": "--bar-length, --px-per-m",
    "grid": "",  # its map.yaml states the size of a cell
    "vector": "--unit",
    "passages": "--half-width",
    "centrelines": "--half-width, --unit",
    "solid": "--unit",
    "cloud": "--unit",
}


def findings_of(detected: Detection, conf: Path | None) -> list[Remark]:
    """Return a remark for each value that was detected; `conf` is the survey section that states it, if it is kept."""
    return [
        Remark(f"read as {_KINDS[detected.values['kind']]}", option=str(conf or "")),
        *_of_picture(detected),
        *_of_scale(detected),
        *_of_width(detected),
        Remark("the floor is dry, mud and water in thirds from west to east, as in the paper", option="realism.zones"),
    ]


def _of_picture(detected: Detection) -> Iterator[Remark]:
    if by := detected.values.get("reduction"):
        yield Remark(
            "is the part of its size at which a large picture is read and detected.png drawn; px are of the whole",
            f"1/{by}",
            "--crop, survey.reduction=1",
        )
    if detected.values.get("workings_only"):
        yield Remark(
            "a drawing: all but the workings is left out (detected.png shows them)",
            option="--crop, --seed, --ignore, survey.workings_only=false",
        )
    if detected.values.get("line_drawing"):
        yield Remark(
            "walls are drawn as lines; the areas that they enclose are filled", option="survey.line_drawing=false"
        )
    if detected.values.get("light_on_dark"):
        yield Remark("light workings on dark paper", option="survey.light_on_dark=false")


def _of_scale(detected: Detection) -> Iterator[Remark]:
    scale = detected.values.get("scale")
    if scale is not None and "scale" in detected.remarks:
        option = "--bar-length, --bar-box" if scale["source"] == "bar" else "--px-per-m"
        yield Remark(f"scale: {detected.remarks['scale']}", option=option)
    if "projection" in detected.remarks:
        yield Remark(detected.remarks["projection"], option="--unit m, if it is a local grid")


def _of_width(detected: Detection) -> Iterator[Remark]:
    option = _WIDTH_OPTIONS[detected.values["kind"]]
    if detected.values.get("unit") and detected.width_m is not None:
        yield Remark(
            f"is taken as the unit; drifts are then {detected.width_m:.1f} m wide", detected.values["unit"], option
        )
    low, high = WIDTHS_M
    if detected.width_m is not None and not low <= detected.width_m <= high:
        yield Remark(
            f"is the width of drifts, outside {low:g} to {high:g} m; is the scale right?",
            f"{detected.width_m:.2f} m",
            option,
        )
