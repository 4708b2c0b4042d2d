"""Points of PCD files: rows of text, packed rows, or columns packed by LZF.

Open3D reads them too, but its threads do not survive a fork: each file would need a new interpreter, which takes 2 s.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from minesurveys.clouds.point_blocks import COLOURS, PLACES, PointBlock, Wanted, block_of, fields_of
from minesurveys.clouds.text_clouds import TextLayout, parse_rows
from minesurveys.errors import InputError
from minesurveys.guard.plain_number import plain_number
from minesurveys.limits import FILE, reader_limits
from minesurveys.remarks import warn_user

_BLOCK = 1_000_000
_HEAD_BYTES, _LINE_BYTES = 65_536, 10_000
_TYPES = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}  # and the bytes that a number of each may have
_PACKED, _RGB_BYTES = ("rgb", "rgba"), 4  # fields of blue, green, red and opacity
_NO_VIEWPOINT = [0, 0, 0, 1, 0, 0, 0]  # the origin, and no turn as a quaternion
_COPY, _LONG, _LEAST_COPY = 32, 7, 2  # LZF: smaller marks are followed by so many bytes, others name earlier ones


@dataclass(frozen=True)
class PcdHeader:
    """What a PCD file states: its points, where the fields that are read are in a point's bytes and words, and how.

    `columns` are (type of numpy, byte, word) of `x`, `y`, `z`, and of colours and times that are wanted and stated;
    `rgb` has a colour in one number. A point takes `bytes_each`.
    """

    points: int
    columns: dict[str, tuple[str, int, int]]
    bytes_each: int
    kind: str
    lines: int


def pcd_blocks(path: Path, wanted: Wanted = PLACES) -> Iterator[PointBlock]:
    """Yield the points of a PCD file in blocks; one packed by LZF is read at once.

    Raises
    ------
    InputError
        If the header is not whole, or the file holds another number of points than it states.

    References
    ----------
    Point Cloud Library, "The PCD (Point Cloud Data) file format"; M. Lehmann, LibLZF
    """
    with path.open("rb") as stream:
        head = _read_header(path, stream, wanted)
        if head.kind == "ascii":
            yield from _text(path, stream, head)
            return
        found, size = path.stat().st_size - stream.tell(), head.points * head.bytes_each
        if head.kind == "binary":
            if found != size:
                raise InputError(
                    f"{path}: {found} bytes of points, but its header states {head.points} points, which take {size}"
                )
            for first in range(0, head.points, _BLOCK):
                count = min(_BLOCK, head.points - first)
                rows = np.frombuffer(stream.read(count * head.bytes_each), np.uint8).reshape(count, -1)
                yield _block(
                    head, [rows[:, at : at + np.dtype(kind).itemsize] for kind, at, _ in head.columns.values()]
                )
            return
        data = _unpacked(path, stream, size)
        sides = []
        for kind, at, _ in head.columns.values():
            first, width = at * head.points, np.dtype(kind).itemsize
            sides.append(np.frombuffer(data, np.uint8, width * head.points, first).reshape(head.points, width))
        yield _block(head, sides)


def _read_header(path: Path, stream: BinaryIO, wanted: Wanted) -> PcdHeader:
    stated: dict[str, list[str]] = {}
    lines = 0
    while "DATA" not in stated:
        line, lines = stream.readline(_LINE_BYTES), lines + 1
        words = line.split(b"#")[0].decode("latin-1").split()
        if not line or stream.tell() > _HEAD_BYTES:
            raise InputError(f"{path}: no line DATA within {_HEAD_BYTES:,} bytes; it is no PCD file, or truncated")
        if words:
            stated[words[0].upper()] = words[1:]
    fields = stated.get("FIELDS", stated.get("COLUMNS", []))
    sizes = _numbers(path, "SIZE", stated.get("SIZE", []))
    counts = _numbers(path, "COUNT", stated.get("COUNT", ["1"] * len(fields)))
    kinds = [kind.upper() for kind in stated.get("TYPE", [])]
    if not len(fields) == len(sizes) == len(kinds) == len(counts) or not {"x", "y", "z"} <= set(fields):
        raise InputError(f"{path}: its header has no FIELDS x y z with a SIZE, TYPE and COUNT each")
    width, height = (_numbers(path, name, stated.get(name, ["1"]))[:1] or [1] for name in ("WIDTH", "HEIGHT"))
    points = (_numbers(path, "POINTS", stated.get("POINTS", [])) or [width[0] * height[0]])[0]
    kind = " ".join(stated["DATA"]).lower()
    if kind not in ("ascii", "binary", "binary_compressed") or not points:
        raise InputError(f"{path}: its header states {points} points, and DATA {kind[:40] or 'of no kind'}")
    bytes_at, words_at = (
        np.cumsum([0, *each], dtype=object) for each in ([a * b for a, b in zip(sizes, counts, strict=True)], counts)
    )
    columns = {}
    for field, name in _fields_read(fields, wanted).items():
        k = fields.index(name)
        if sizes[k] not in _TYPES.get(kinds[k], ()) or counts[k] != 1 or (field == "rgb" and sizes[k] != _RGB_BYTES):
            raise InputError(
                f"{path}: its header states {name[:40]} as {counts[k]} numbers {kinds[k][:9]} of {sizes[k]} bytes"
            )
        columns[field] = (f"<{kinds[k].lower()}{sizes[k]}", bytes_at[k], words_at[k])
    _warn_of_viewpoint(path, stated.get("VIEWPOINT", []))
    return PcdHeader(points, columns, bytes_at[-1], kind, lines)


def _warn_of_viewpoint(path: Path, stated: list[str]) -> None:
    """Warn of a place and a turn of the scanner: they say where points were seen from, and move none.

    References
    ----------
    Point Cloud Library, `PCLPointCloud2` of `PCDReader`: the viewpoint is handed out beside the points
    """
    with suppress(ValueError):
        if stated and [plain_number(word) for word in stated] != _NO_VIEWPOINT:
            warn_user(
                f"states the VIEWPOINT {' '.join(stated)[:80]}, the scanner's place and turn; it moves no "
                "point, as in PCL; a cloud in the scanner's own frame is to be moved before it is given",
                of=path.name,
            )


def _fields_read(fields: list[str], wanted: Wanted) -> dict[str, str]:
    """Return the file's own names of x, y, z and the fields that are wanted; `rgb` if its colours are packed."""
    found = dict(zip("xyz", "xyz", strict=True)) | fields_of(fields, wanted)
    packed = [name for name in fields if name.lower() in _PACKED]
    return found | ({"rgb": packed[0]} if packed and wanted.colours and "red" not in found else {})


def _numbers(path: Path, name: str, words: list[str]) -> list[int]:
    if not all(word.isdecimal() and len(word) < 19 for word in words):
        raise InputError(f"{path}: its header states {name} {' '.join(words)[:60]}; want numbers of 0 and more")
    return [int(word) for word in words]


def _block(head: PcdHeader, sides: list[np.ndarray]) -> PointBlock:
    """Return the points whose fields have these bytes (n, size)."""
    columns = {
        field: np.ascontiguousarray(side).view(kind)[:, 0]
        for side, (field, (kind, _, _)) in zip(sides, head.columns.items(), strict=True)
    }
    return _with_colours(head, columns)


def _with_colours(head: PcdHeader, columns: dict[str, np.ndarray]) -> PointBlock:
    """Return the points of columns (n,), with colours if one of them packs these."""
    if "rgb" in columns:
        with np.errstate(over="ignore", invalid="ignore"):
            packed = np.ascontiguousarray(columns["rgb"].astype(head.columns["rgb"][0]))
        blue, green, red, _ = packed.view(np.uint8).reshape(-1, _RGB_BYTES).T
        columns = columns | dict(zip(COLOURS, (red, green, blue), strict=True))
    return block_of(np.column_stack([columns[axis] for axis in "xyz"]), columns)


def _text(path: Path, stream: BinaryIO, head: PcdHeader) -> Iterator[PointBlock]:
    layout = TextLayout(0, None, {field: word for field, (_, _, word) in head.columns.items()})
    lines = (line.decode("latin-1") for line in stream)
    found, number = 0, head.lines
    while block := list(itertools.islice(lines, _BLOCK)):
        rows = [line for line in block if line.strip()]
        found += len(rows)
        if rows:
            yield _with_colours(head, parse_rows(path, block, number, layout))
        number += len(block)
    if found != head.points:
        raise InputError(f"{path}: {found} rows, but its header states {head.points} points; is it truncated?")


def _unpacked(path: Path, stream: BinaryIO, wanted: int) -> bytearray:
    packed, size = (int.from_bytes(stream.read(4), "little") for _ in range(2))
    data, most = stream.read(), reader_limits().cloud_bytes
    if size > most:
        raise InputError(f"{path}: unpacks to {size:,} bytes; the limit is {most:,} (cloud_bytes in {FILE})")
    if len(data) < packed or size != wanted:
        raise InputError(
            f"{path}: {len(data)} of {packed} packed bytes, which hold {size}; its header states points of {wanted}"
        )
    try:
        found = _unpack(data[:packed], size)
    except (IndexError, ValueError):
        found = bytearray()
    if len(found) != size:
        raise InputError(f"{path}: its packed points cannot be unpacked to {size} bytes; copy or export it again")
    return found


def _unpack(data: bytes, most: int) -> bytearray:
    """Return what LZF has packed, no more than `most` bytes and a copy."""
    out, at = bytearray(), 0
    while at < len(data) and len(out) <= most:
        mark = data[at]
        at += 1
        if mark < _COPY:
            out += data[at : at + mark + 1]
            at += mark + 1
            continue
        length = mark >> 5
        if length == _LONG:
            length += data[at]
            at += 1
        back = ((mark & (_COPY - 1)) << 8) + data[at] + 1
        at += 1
        if back > len(out):
            raise ValueError(back)
        piece = bytes(out[-back:][: length + _LEAST_COPY])
        out += (piece * ((length + _LEAST_COPY) // len(piece) + 1))[: length + _LEAST_COPY]  # a copy may repeat itself
    return out
