"""The piece of workings at a stated place."""

from __future__ import annotations

from pathlib import Path

from minesurveys.errors import InputError, one_line
from pipeline.types import Piece

_NEAR_M = 10.0  # from a stated place to the station or area that it names
_NAME_CHARS = 40


def require_near(path: Path, piece: Piece, far_m: float, what: str) -> None:
    """Refuse a stated place that is too far from the nearest station or area; `InputError` says how far."""
    if not far_m <= _NEAR_M:
        raise InputError(f"{path}: survey.piece = {_text(piece)}: {what} is {far_m:.1f} m away, at most {_NEAR_M:g} m")


def _text(piece: Piece) -> str:
    return repr(one_line(piece, _NAME_CHARS)) if isinstance(piece, str) else ",".join(f"{value:g}" for value in piece)
