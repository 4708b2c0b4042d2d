"""Flags of a survey's shots in a vector file, as Therion exports them: splays, surface legs, duplicates."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pipeline.errors import InputError
from pipeline.guard.reading_process import warn_user
from pipeline.survey.vector.shapes import Shapes

SPLAY, SURFACE, DUPLICATE = "_SPLAY", "_SURFACE", "_DUPLICATE"  # fields of Therion's shots3d.shp; 1: flagged
FLAGS = (SPLAY, SURFACE, DUPLICATE)
_SET = (1, 1.0, True, "1")
_NAMES = {SPLAY: "splays", SURFACE: "legs on the surface"}


def flags_of(columns: Mapping[str | None, Sequence[Any]], count: int) -> list[frozenset[str]]:
    """Return the flags of each of `count` shapes, from the columns of properties that there are."""
    there = [name for name in FLAGS if name in columns]
    return [frozenset(name for name in there if columns[name][row] in _SET) for row in range(count)]


def without_flagged(path: Path, content: Shapes, flags: Sequence[frozenset[str]]) -> Shapes:
    """Return shapes without splays and without legs on the surface, as they are no drifts; a warning counts them.

    Parameters
    ----------
    path : Path
    content : Shapes
    flags : sequence of frozenset of str
        Of each shape. Those of a duplicate go with it: it ties stations, and is no passage of its own.

    Raises
    ------
    InputError
        If all shapes are splays or on the surface.
    """
    if not any(flags):
        return content
    left_out = Counter(next(name for name in _NAMES if name in one) for one in flags if one & set(_NAMES))
    if left_out:
        text = " and ".join(f"{count} {_NAMES[name]} ({name})" for name, count in left_out.items())
        if sum(left_out.values()) == len(flags):
            raise InputError(f"{path}: holds no drifts: {text}")
        warn_user(f"{path.name}: {text} of {len(flags)} shots are no drifts, and are left out")
    found = replace(content, is_duplicate=[DUPLICATE in one for one in flags])
    found = found.only([not one & set(_NAMES) for one in flags])
    if (twice := sum(found.is_duplicate)) > 0:
        warn_user(
            f"{path.name}: {twice} shots flagged {DUPLICATE} were measured before; --half-width M reads them as ties, "
            "not as passages of their own"
        )
    return found
