"""A solved survey: the positions of its stations, the legs between them, and the passages' cross-sections."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from pathlib import Path
from typing import Self

import numpy as np


class StationFlag(IntFlag):
    """What a file says about a station."""

    SURFACE = 0x01
    UNDERGROUND = 0x02
    ENTRANCE = 0x04
    EXPORTED = 0x08
    FIXED = 0x10
    ANONYMOUS = 0x20
    WALL = 0x40


class LegFlag(IntFlag):
    """What a file says about a leg. Legs without a flag are the survey's underground centreline."""

    SURFACE = 0x01
    DUPLICATE = 0x02
    SPLAY = 0x04


class LegStyle(IntEnum):
    """How a leg was measured."""

    NORMAL = 0
    DIVING = 1
    CARTESIAN = 2
    CYLPOLAR = 3
    NOSURVEY = 4
    UNKNOWN = 255


@dataclass(frozen=True)
class Passage:
    """Cross-sections in a row: station indices (k,); distances left, right, up, down (k, 4) m, nan if unknown.

    A leg of a table has a name. `grades` (k - 1,) are rise over run of its shots as stated, nan where none is; None if
    the survey states none.
    """

    stations: np.ndarray
    lrud_m: np.ndarray
    name: str = ""
    grades: np.ndarray | None = None


@dataclass(frozen=True)
class SolvedSurvey:
    """A survey whose loops are closed.

    Attributes
    ----------
    names : tuple of n str
        Station names with their surveys, `survey.station`; anonymous stations have an empty name.
    positions_m : (n, 3) float64, m
        East, north and up in the survey's own frame (`crs`).
    station_flags : (n,) uint8
        Bits of `StationFlag`.
    legs : (m, 2) int64
        Stations at the start and the end of each leg.
    leg_flags, leg_styles : (m,) uint8
        Bits of `LegFlag`; values of `LegStyle`.
    passages : tuple of Passage
    title : str
    crs : str or None
        The coordinate system as PROJ names it.
    date : str
        When the file was made, as it states it.
    doubt : str
        The worst misclosure, if a reading must be wrong.
    has_elevations : bool
        Whether the file states elevations; else all stations are at 0.
    is_named : bool
        Whether the user knows the stations' names; those of lines do not stand in the file.
    files : tuple of Path
        What was read: the file, and those that it names.
    """

    names: tuple[str, ...]
    positions_m: np.ndarray
    station_flags: np.ndarray
    legs: np.ndarray
    leg_flags: np.ndarray
    leg_styles: np.ndarray
    passages: tuple[Passage, ...] = ()
    title: str = ""
    crs: str | None = None
    date: str = ""
    doubt: str = ""
    has_elevations: bool = True
    is_named: bool = True
    files: tuple[Path, ...] = ()

    @classmethod
    def of_passages(cls, names: Iterable[str], places_m: np.ndarray, passages: Sequence[Passage], path: Path) -> Self:
        """Return the survey of a file whose legs are the shots of its passages."""
        pairs = np.concatenate([np.column_stack([one.stations[:-1], one.stations[1:]]) for one in passages])
        flags = np.full(len(places_m), StationFlag.UNDERGROUND, np.uint8)
        styles = np.full(len(pairs), LegStyle.CARTESIAN, np.uint8)
        plain, title = np.zeros(len(pairs), np.uint8), path.stem
        return cls(tuple(names), places_m, flags, pairs, plain, styles, tuple(passages), title, files=(path,))

    def centreline(self) -> np.ndarray:
        """Return the indices of the legs along the passages: underground, neither duplicate nor splay."""
        return np.flatnonzero(self.leg_flags == 0)

    def nodes(self) -> tuple[np.ndarray, np.ndarray, list[str]]:
        """Return the places (k, 3) m of the stations, each once, which each station (n,) has, and the places' names.

        A place has the first of its stations' names: equated stations have one.
        """
        places, node = np.unique(self.positions_m, axis=0, return_inverse=True)
        node = node.reshape(-1)
        names = dict.fromkeys(range(int(node.max(initial=-1)) + 1), "")
        for number, name in zip(node.tolist(), self.names, strict=True):
            names[number] = names[number] or name
        return places, node, [name or f"unnamed {number}" for number, name in names.items()]
