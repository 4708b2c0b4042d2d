"""Meshes of PLY files, whose faces may have any numbers of corners; trimesh reads binary ones of one number alone.

References
----------
Turk 1994, "The PLY Polygon File Format"
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field

import numpy as np

from minesurveys.solids.polygons import triangles_of

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"), **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"), **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"), **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"), **dict.fromkeys(("double", "float64"), "f8"),
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_FEWEST = 16  # rows that are looked at at once; twice as many each time that all have lists of one length
_CORNERS = ("vertex_indices", "vertex_index")


@dataclass
class _Element:
    """The rows of one kind: `columns` are name, type, and of a list the type of its length."""

    name: str
    rows: int
    columns: list[tuple[str, str, str | None]] = field(default_factory=list)


def read_ply_mesh(data: bytes) -> tuple[np.ndarray, np.ndarray, bool]:
    """Return vertices (n, 3) float64, triangles (m, 3) int64, and whether coordinates have 32 bits.

    Raises
    ------
    ValueError, KeyError, IndexError, Warning
        If the file is none, or is cut off.
    """
    head, end, body = data.partition(b"end_header")
    order, elements = _header(head.decode("latin-1"))
    body = body.partition(b"\n")[2] if end else b""
    rows = _TextRows(body) if order == "" else _BinaryRows(body, order)
    vertices, corners, sizes, is_single = np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros(0, np.int64), False
    for element in elements:
        if element.name == "vertex" and not any(length for _, _, length in element.columns):
            names = [name for name, _, _ in element.columns]
            table = rows.table(element)
            vertices = np.column_stack([np.asarray(table[names.index(axis)], float) for axis in "xyz"])
            is_single = any(kind == "f4" for name, kind, _ in element.columns if name in "xyz")
            is_single &= bool((vertices == vertices.astype(np.float32)).all())  # a text may be finer than it states
        elif element.name == "face":
            corners, sizes = rows.lists(element, _corners_of(element))
        else:
            rows.skip(element)
    if len(corners) and not 0 <= corners.min() <= corners.max() < len(vertices):
        raise IndexError(corners)
    return vertices, triangles_of(vertices, corners, sizes), is_single


def _header(text: str) -> tuple[str, list[_Element]]:
    order, elements = None, list[_Element]()
    for line in text.splitlines():
        match line.split():
            case ["format", kind, *_]:
                order = _ORDERS[kind]
            case ["element", name, count]:
                elements.append(_Element(name, int(count)))
            case ["property", "list", length, kind, name]:
                elements[-1].columns.append((name, _TYPES[kind], _TYPES[length]))
            case ["property", kind, name]:
                elements[-1].columns.append((name, _TYPES[kind], None))
    if order is None or not all(element.columns and element.rows >= 0 for element in elements):
        raise ValueError(text[:60])
    return order, elements


def _corners_of(element: _Element) -> int:
    lists = [k for k, (_, _, length) in enumerate(element.columns) if length]
    return next((k for k in lists if element.columns[k][0] in _CORNERS), lists[0])


class _TextRows:
    """Rows of numbers as text, one after the other."""

    def __init__(self, body: bytes) -> None:
        with warnings.catch_warnings(action="error"):  # what is no number
            self._numbers, self._at = np.fromstring(body, sep=" "), 0

    def table(self, element: _Element) -> list[np.ndarray]:
        """Return the columns of an element without lists."""
        size = element.rows * len(element.columns)
        found = self._numbers[self._at : self._at + size].reshape(element.rows, -1)
        self._at += size
        return list(found.T)

    def skip(self, element: _Element) -> None:
        """Leave an element out."""
        self.lists(element, None)

    def lists(self, element: _Element, wanted: int | None) -> tuple[np.ndarray, np.ndarray]:
        """Return the items of a list of all rows, one after the other, and how many each row has."""
        items, sizes = list[np.ndarray](), list[int]()
        for _ in range(element.rows):
            for k, (_, _, length) in enumerate(element.columns):
                count = int(self._numbers[self._at]) if length else 1
                if count < 0:
                    raise ValueError(count)
                first = self._at + (1 if length else 0)
                self._at = first + count
                if k == wanted:
                    items.append(self._numbers[first : self._at])
                    sizes.append(count)
        return _joined(items, sizes)


class _BinaryRows:
    """Packed rows, one after the other."""

    def __init__(self, body: bytes, order: str) -> None:
        self._body, self._order, self._at = body, order, 0

    def _type(self, element: _Element, lengths: list[int]) -> np.dtype:
        """Return the type of a row whose lists have these lengths; a list is its length and its items."""
        left = iter(lengths)
        parts: list[tuple] = []
        for k, (_, kind, length) in enumerate(element.columns):
            parts += [(f"n{k}", self._order + length)] if length else []
            parts.append((f"v{k}", self._order + kind, *(((next(left),),) if length else ())))
        return np.dtype(parts)

    def _take(self, kind: np.dtype, rows: int) -> np.ndarray:
        found = np.frombuffer(self._body, kind, rows, self._at)
        self._at += rows * kind.itemsize
        return found

    def table(self, element: _Element) -> list[np.ndarray]:
        """Return the columns of an element without lists."""
        found = self._take(self._type(element, []), element.rows)
        return [found[f"v{k}"] for k in range(len(element.columns))]

    def skip(self, element: _Element) -> None:
        """Leave an element out."""
        if any(length for _, _, length in element.columns):
            self.lists(element, None)
        else:
            self.table(element)

    def lists(self, element: _Element, wanted: int | None) -> tuple[np.ndarray, np.ndarray]:
        """Return the items of a list of all rows, one after the other, and how many each row has."""
        items, sizes, left, some = list[np.ndarray](), list[int](), element.rows, _FEWEST
        while left:
            kind = self._type(element, self._lengths(element))
            most = min(left, some, (len(self._body) - self._at) // kind.itemsize)
            found = np.frombuffer(self._body, kind, most, self._at)
            found = found[: _alike(found, element)]
            if not len(found):
                raise ValueError(self._at)
            some = 2 * some if len(found) == most else _FEWEST
            self._at += found.nbytes
            left -= len(found)
            if wanted is not None:
                items.append(found[f"v{wanted}"].reshape(-1))
                sizes += found[f"n{wanted}"].tolist()
        return _joined(items, sizes)

    def _lengths(self, element: _Element) -> list[int]:
        """Return the lengths of the lists of the next row."""
        at, lengths = self._at, list[int]()
        for _, kind, length in element.columns:
            count = 1
            if length:
                count = int(np.frombuffer(self._body, self._order + length, 1, at)[0])
                at += np.dtype(length).itemsize
                lengths.append(count)
            at += count * np.dtype(kind).itemsize
        return lengths


def _alike(found: np.ndarray, element: _Element) -> int:
    """Return how many rows, from the first on, have lists as long as its."""
    same = np.ones(len(found), bool)
    for k, (_, _, length) in enumerate(element.columns):
        if length:
            same &= found[f"n{k}"] == found[f"v{k}"].shape[1]
    return len(found) if same.all() else int(same.argmin())


def _joined(items: list[np.ndarray], sizes: list[int]) -> tuple[np.ndarray, np.ndarray]:
    joined = np.concatenate(items) if items else np.zeros(0)
    return joined.astype(np.int64), np.array(sizes, np.int64)
