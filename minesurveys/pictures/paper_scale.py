"""The scale of a drawing from its ratio, such as 1:2500, and the size of its paper."""

from __future__ import annotations

import re
from pathlib import Path

from minesurveys.errors import InputError
from minesurveys.pictures.picture_header import read_header

_INCH_M = 0.0254
_RATIO = re.compile(r"(?<![\d:.,])1\s?:\s?([1-9]\d{0,2}(?:[ ,.'’]\d{3})+|[1-9]\d{1,6})(?![\d:])")
_MOST = 100_000.0  # a smaller scale shows no drifts
_LEAST = 20.0


def ratio_in(text: str) -> float | None:
    """Return N of the one scale 1:N that a text states; None if it states none or several."""
    found = {float(re.sub(r"\D", "", number)) for number in _RATIO.findall(text)}
    found = {number for number in found if _LEAST <= number <= _MOST}
    return found.pop() if len(found) == 1 else None


def px_per_m_of(path: Path, ratio: float, dpi: float | None) -> float:
    """Return the scale, px/m, of a drawing of a ratio 1:N at a resolution; None is that which a picture states.

    Raises
    ------
    InputError
        If a picture states no resolution.
    """
    dpi = dpi or read_header(path).dpi
    if dpi is None:
        raise InputError(
            f"{path}: --scale needs the resolution of the scan, which the picture does not state; --px-per-m"
        )
    return dpi / _INCH_M / ratio
