"""What is detected of a survey's file, and the section by which it is read meanwhile."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from pipeline.params.base import Params
from pipeline.types import Image

_Section = TypeVar("_Section", bound=Params)


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


def section_for(kind: type[_Section], path: Path, values: Mapping[str, Any], of: str = "file") -> _Section:
    """Return the survey section of a file in any folder, before it is copied below data/."""
    section = kind.model_validate({"name": "detect", of: f"data/x{path.suffix}", **values})
    return section.model_copy(update={of: path.as_posix()})
