"""What is detected of a survey's file."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.types import Image


@dataclass(frozen=True)
class Detection:
    """Values and remarks of a survey section, the files it needs, and the typical drift width, m.

    The width is None if the file itself states what is free. `picture` shows what of a plan's picture was taken for
    workings; None for other formats. `has_heights` is true if the floor rises or falls.
    """

    values: dict[str, Any]
    remarks: dict[str, str] = field(default_factory=dict)
    files: list[Path] = field(default_factory=list)
    width_m: float | None = None
    picture: Image | None = None
    has_heights: bool = False
