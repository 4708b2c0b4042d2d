"""Reader of Surpac triangulations (.dtm): triangles of the points in the string file (.str) beside it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from minesurveys.errors import InputError
from minesurveys.solids.stated_metres import LayerMesh, StatedMeshes
from minesurveys.vector.surpac import read_records

_CORNERS = slice(1, 4)  # of a record: its number, three points, three neighbours


def files_of_dtm(path: Path) -> list[Path]:
    """Return a triangulation and its string file: its name with .str.

    Raises
    ------
    InputError
        If it is not there.
    """
    for suffix in (".str", ".STR"):
        if (beside := path.with_suffix(suffix)).is_file():
            return [path, beside]
    raise InputError(f"{path}: {path.with_suffix('.str').name} is not beside it; it holds the points of the triangles")


def read_dtm(path: Path, data: bytes) -> StatedMeshes:
    """Read each object of a triangulation as a mesh.

    Points are numbered from 1 in the order of the string file. Where its strings are parted by records of the number
    0, and a triangle has a higher number than there are points, those records are counted, too.

    Raises
    ------
    InputError
        If it is a binary file, a record is no triangle (the message names its line), or a point is not there.
    """
    if b"\0" in data:
        raise InputError(f"{path}: a binary Surpac triangulation; save it in Surpac as a text file")
    _, beside = files_of_dtm(path)
    records = [point for _, point in read_records(beside)]
    objects = _objects(path, data.decode("latin-1").splitlines())
    points = [point for point in records if point is not None]
    used = {number for _, triangles in objects for number in np.unique(triangles).tolist()}
    numbered = points if max(used, default=0) <= len(points) else records
    unknown = [number for number in used if number > len(numbered) or numbered[number - 1] is None]
    if unknown:
        raise InputError(f"{path}: a triangle of point {unknown[0]}; {beside.name} has {len(points)}")
    vertices = np.array([point or points[0] for point in numbered], np.float64).reshape(-1, 3)
    return StatedMeshes([LayerMesh(name, vertices, triangles - 1) for name, triangles in objects], None)


def _objects(path: Path, text: list[str]) -> list[tuple[str, np.ndarray]]:
    """Return the name of each object, and the numbers (m, 3) of its triangles' points."""
    found: list[tuple[str, list[list[int]]]] = []
    for row, line in enumerate(text, start=1):
        cells = [cell.strip() for cell in line.split(",")]
        if cells[0].upper() == "OBJECT":
            found.append((cells[1] if len(cells) > 1 else "", []))
        elif not found or not any(cells) or cells[0].upper() in ("TRISOLATION", "END"):
            continue
        else:
            corners = cells[_CORNERS]
            if len(corners) < 3 or not all(cell.isdecimal() and 0 < int(cell) < 2**31 for cell in corners):
                raise InputError(
                    f"{path}:{row}: {line.strip()[:60]!r} is no triangle: a number, three points, neighbours"
                )
            found[-1][1].append([int(cell) for cell in corners])
    return [(name, np.array(triangles, np.int64).reshape(-1, 3)) for name, triangles in found]
