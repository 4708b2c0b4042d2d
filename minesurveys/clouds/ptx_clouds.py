"""Points of PTX files: scans in a grid of rows and columns, each moved to its place by the transformation above it.

No library reads them. The form is that of Leica's Cyclone: a scan has ten lines above its points.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

from minesurveys.clouds.point_blocks import COLOURS, PointBlock, Wanted, block_of
from minesurveys.errors import InputError
from minesurveys.guard.plain_number import plain_number
from minesurveys.remarks import warn_user

_BLOCK = 1_000_000
_LINE_BYTES = 10_000
_SCANNER_LINES, _MATRIX_LINES = 4, 4  # of the scanner: its place and its axes; then the transformation to the world
_SQUARE = 1e-3  # of a rotation's product with its transpose: numbers have six digits
_COLUMNS = (3, 4, 6, 7)  # x y z, intensity, red green blue
_LEAST_BYTES = 6  # of a point


def ptx_blocks(path: Path, wanted: Wanted) -> Iterator[PointBlock]:
    """Yield the points, m, of each scan of a PTX file, in the file's frame; without times.

    A scanner that saw nothing in a direction has a point at 0 0 0 there, or no numbers; these are left out.

    Raises
    ------
    InputError
        If a header is broken, a scan has fewer rows than it states, a row is not of numbers, or a transformation is
        none. The message names the line.
    """
    lost = number = 0
    with path.open(encoding="utf-8-sig", errors="replace") as stream:
        while (first := _next_line(stream)) is not None:
            number += 1
            head = [first, *(_next_line(stream) or "" for _ in range(1 + _SCANNER_LINES + _MATRIX_LINES))]
            count, place = _header(path, head, number)
            if count * _LEAST_BYTES > path.stat().st_size:
                raise InputError(f"{path}:{number}: a scan states {count:,.15g} points, more than the file can hold")
            number += len(head) - 1
            for start in range(0, int(count), _BLOCK):
                wanted_rows = min(_BLOCK, int(count) - start)
                lines = list(itertools.islice(stream, wanted_rows))
                rows = _rows(path, lines, number, wanted_rows)
                number += len(lines)
                seen = np.isfinite(rows[:, :3]).all(axis=1) & (rows[:, :3] != 0).any(axis=1)
                lost += int((~seen).sum())
                rows = rows[seen]
                fields = dict(zip(COLOURS, rows[:, -3:].T, strict=True)) if wanted.colours and rows.shape[1] > 4 else {}
                if len(rows):
                    yield block_of(rows[:, :3] @ place[:3, :3] + place[3, :3], fields)
    if not number:
        raise InputError(f"{path}: no rows")
    if lost:
        warn_user("directions have no return (0 0 0, or no numbers) and are left out", of=path.name, count=f"{lost:,}")


def _next_line(stream: Iterator[str]) -> str | None:
    """Return the next line that is not blank, None at the end."""
    return next((line for line in stream if line.strip()), None)


def _header(path: Path, lines: list[str], number: int) -> tuple[float, np.ndarray]:
    """Return the number of a scan's points and its transformation (4, 4), of row vectors."""
    sizes = [1, 1, *[3] * _SCANNER_LINES, *[4] * _MATRIX_LINES]
    found = [_numbers(path, line, number + k, size) for k, (line, size) in enumerate(zip(lines, sizes, strict=True))]
    columns, rows = found[0][0], found[1][0]
    if not (columns >= 1 and rows >= 1 and columns.is_integer() and rows.is_integer()):
        raise InputError(f"{path}:{number}: a scan of {columns:g} columns and {rows:g} rows; want whole numbers from 1")
    place = np.array(found[-_MATRIX_LINES:])
    turn = place[:3, :3]
    if not np.isfinite(place).all() or np.abs(turn @ turn.T - np.eye(3)).max() > _SQUARE or np.linalg.det(turn) < 0:
        raise InputError(f"{path}:{number + 6}: a scan's transformation is no rotation with a shift; export it again")
    return columns * rows, place


def _numbers(path: Path, line: str, number: int, count: int) -> list[float]:
    try:
        found = [plain_number(word) for word in line[:_LINE_BYTES].split()]
    except ValueError:
        found = []
    if len(found) != count:
        raise InputError(
            f"{path}:{number}: {line.strip()[:40]!r}, want {count} numbers of a scan's header: columns, rows, the "
            "scanner's place and axes, a matrix of four rows"
        )
    return found


def _rows(path: Path, lines: list[str], before: int, wanted: int) -> np.ndarray:
    """Return the rows (n, 3 to 7) of a scan; a row that ends before the colour has none."""
    if len(lines) < wanted:
        raise InputError(f"{path}:{before + len(lines)}: the file ends within a scan; it is cut off")
    if len(lines[0].split()) in _COLUMNS:
        with suppress(ValueError):
            return np.loadtxt(lines, ndmin=2, comments=None)
    rows = [_row(path, line, number) for number, line in enumerate(lines, start=before + 1)]
    width = max(map(len, rows))
    return np.array([row + [0.0] * (width - len(row)) for row in rows])


def _row(path: Path, line: str, number: int) -> list[float]:
    words = line.split()
    if len(words) not in _COLUMNS:
        raise InputError(f"{path}:{number}: {len(words)} columns, want x y z, an intensity, and a colour")
    try:
        return [plain_number(word) for word in words]
    except ValueError as error:
        raise InputError(f"{path}:{number}: {' '.join(words)[:60]!r} is no row of numbers") from error
