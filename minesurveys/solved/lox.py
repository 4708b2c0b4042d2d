"""Reader of Therion's binary models (.lox): solved stations, legs with flags, and cross-sections.

No library reads them. The form is that of Therion's own reader (src/common-utils/lxFile): blocks of records of one
kind, each with a block of texts that its records point into.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from minesurveys.errors import InputError
from minesurveys.guard.plain_file import read_text_bytes
from minesurveys.limits import FILE, reader_limits
from minesurveys.remarks import warn_user
from minesurveys.solved.model import LegFlag, LegStyle, Passage, SolvedSurvey, StationFlag

_TEXT = [("at", "<u4"), ("size", "<u4")]
_SURVEY = np.dtype([("id", "<u4"), ("name", _TEXT), ("parent", "<u4"), ("title", _TEXT)])
_STATION = np.dtype(
    [("id", "<u4"), ("survey", "<u4"), ("name", _TEXT), ("comment", _TEXT), ("flags", "<u4"), ("place", "<f8", 3)]
)
_SHOT = np.dtype(
    [("ends", "<u4", 2), ("lrud", "<f8", (2, 4)), ("flags", "<u4"), ("section", "<u4"), ("survey", "<u4"), ("", "<f8")]
)
_KINDS = {1: _SURVEY, 2: _STATION, 3: _SHOT}
_NOT_READ = {4: "wall surfaces of scraps", 5: "terrain", 6: "pictures on the terrain"}
_STATION_FLAGS = {1: StationFlag.SURFACE, 2: StationFlag.ENTRANCE, 4: StationFlag.FIXED}
_HIDDEN = 4  # a shot that only carries cross-sections
_LEG_FLAGS = {1: LegFlag.SURFACE, 2: LegFlag.DUPLICATE, 8: LegFlag.SPLAY, 16: LegFlag.SPLAY}  # 8 in files before 2009
_ANONYMOUS = ("", "-", ".")


def read_lox(path: Path) -> SolvedSurvey:
    """Read a solved survey; coordinates are metres in the system of the project, which the file does not name.

    Returns
    -------
    SolvedSurvey
        Distances to walls of each leg at both of its ends, where Therion has them.

    Raises
    ------
    InputError
        If the file is no `.lox`, ends early, exceeds a limit, or a leg is of a station that it does not have.
    """
    found, texts, others = _blocks(path, read_text_bytes(path))
    surveys, stations, shots = found[1], found[2], found[3]
    if not len(stations) or not len(shots):
        raise InputError(f"{path}: has no legs; `export model -fmt loch -enable all` writes the centreline")
    if not np.isfinite(stations["place"]).all():
        raise InputError(f"{path}: a station whose place is no finite number")
    row = {int(number): k for k, number in enumerate(stations["id"])}
    if len(row) < len(stations):
        raise InputError(f"{path}: two stations have one number; it is broken")
    unknown = next((int(end) for end in shots["ends"].ravel() if int(end) not in row), None)
    if unknown is not None:
        raise InputError(f"{path}: a leg of station number {unknown}, which it does not have; it is broken")
    ends = np.array([[row[int(end)] for end in pair] for pair in shots["ends"]], np.int64).reshape(-1, 2)
    far_m = shots["lrud"][shots["lrud"] > reader_limits().farthest_wall_m]
    if len(far_m):
        most = f"{reader_limits().farthest_wall_m:g} (farthest_wall_m in {FILE})"
        raise InputError(f"{path}: a wall {far_m.max():g} m beside its station, at most {most}")
    lrud = np.where(shots["lrud"] >= 0, shots["lrud"], np.nan)  # negative: not measured
    passages = _passages(ends[shots["section"] > 0], lrud[shots["section"] > 0])
    drawn = (shots["flags"] & _HIDDEN) == 0
    if others:
        warn_user(
            f"not read: {', '.join((f'{count} {_NOT_READ[kind]}' for kind, count in others.items()))}", of=path.name
        )
    flags = _flags_of(stations["flags"], _STATION_FLAGS)
    for kind, pointers in ((1, surveys["name"]), (2, stations["name"])):
        if (pointers["at"].astype(np.int64) + pointers["size"]).max(initial=0) > len(texts.get(kind, b"")):
            raise InputError(f"{path}: a name that lies behind the texts of its block; it is broken")
    names = _names(surveys, stations, texts)
    flags[[not name for name in names]] |= int(StationFlag.ANONYMOUS)
    flags[(flags & StationFlag.SURFACE) == 0] |= int(StationFlag.UNDERGROUND)
    return SolvedSurvey(
        tuple(names),
        stations["place"].astype(np.float64),
        flags,
        ends[drawn],
        _flags_of(shots["flags"], _LEG_FLAGS)[drawn],
        np.full(int(drawn.sum()), int(LegStyle.NORMAL), np.uint8),
        passages,
    )


def _passages(ends: np.ndarray, lrud: np.ndarray) -> tuple[Passage, ...]:
    """Return the passages of legs (n, 2) with distances (n, 2, 4) at their ends; a leg goes on from the one before."""
    runs: list[tuple[list[int], list[np.ndarray]]] = []
    for (start, end), (first, last) in zip(ends.tolist(), lrud, strict=True):
        if runs and runs[-1][0][-1] == start and np.array_equal(runs[-1][1][-1], first, equal_nan=True):
            runs[-1][0].append(end)
            runs[-1][1].append(last)
        else:
            runs.append(([start, end], [first, last]))
    return tuple(Passage(np.array(stations, np.int64), np.array(rows)) for stations, rows in runs)


def _blocks(path: Path, data: bytes) -> tuple[dict[int, np.ndarray], dict[int, bytes], Counter[int]]:
    """Return records and texts by kind, and how many there are of kinds that are not read."""
    found = {kind: np.zeros(0, dtype) for kind, dtype in _KINDS.items()}
    texts: dict[int, bytes] = {}
    others: Counter[int] = Counter()
    at = 0
    while at < len(data):
        if at + 16 > len(data):
            raise InputError(f"{path}: byte {at}: the file ends within the head of a block; it is cut off")
        kind, size, count, text_size = np.frombuffer(data, "<u4", 4, at).tolist()
        records, at = at + 16, at + 16 + size + text_size
        if at > len(data) or not (kind in _NOT_READ or (kind in _KINDS and size == count * _KINDS[kind].itemsize)):
            raise InputError(f"{path}: byte {records - 16}: no block of a .lox file, or it is cut off")
        if kind in _NOT_READ:
            others[kind] += count
            continue
        if len(found[kind]) or count > reader_limits().solved_items:
            most = f"{reader_limits().solved_items:,} records (solved_items in {FILE})"
            raise InputError(f"{path}: byte {records - 16}: a second block of one kind, or more than {most}")
        found[kind] = np.frombuffer(data, _KINDS[kind], count, records)
        texts[kind] = data[records + size : at]
    return found, texts, others


def _flags_of(bits: np.ndarray, meanings: dict[int, StationFlag] | dict[int, LegFlag]) -> np.ndarray:
    found = np.zeros(len(bits), np.uint8)
    for bit, flag in meanings.items():
        found[(bits & bit) > 0] |= int(flag)
    return found


def _names(surveys: np.ndarray, stations: np.ndarray, texts: dict[int, bytes]) -> list[str]:
    """Return the stations' names with their surveys, `survey.station`; nothing for stations without one."""
    parents = {int(own["id"]): (int(own["parent"]), _text(texts[1], own["name"])) for own in surveys}
    full: dict[int, str] = {}
    for number in parents:
        parts: list[str] = []
        above = number
        while above in parents and len(parts) <= reader_limits().survex_depth:
            parent, name = parents[above]
            parts.append(name)
            if parent == above:
                break
            above = parent
        full[number] = ".".join(part for part in reversed(parts) if part)
    own = [_text(texts[2], station["name"]) for station in stations]
    return [
        "" if name in _ANONYMOUS else ".".join(filter(None, [full.get(int(station["survey"]), ""), name]))
        for name, station in zip(own, stations, strict=True)
    ]


def _text(texts: bytes, pointer: np.void) -> str:
    at, size = int(pointer["at"]), int(pointer["size"])
    return texts[at : at + size].partition(b"\0")[0][: reader_limits().survex_name_bytes].decode("utf-8", "replace")
