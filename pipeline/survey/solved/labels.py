"""Bytes of a `.3d` file: numbers, places, and the label that every item changes a little."""

from __future__ import annotations

import struct
from pathlib import Path

from pipeline.errors import InputError
from pipeline.params.reader_limits import FILE, reader_limits


class Cursor:
    """A position in a file's bytes."""

    def __init__(self, path: Path, data: bytes) -> None:
        """Begin at the first byte."""
        self.path, self.data, self.at = path, data, 0

    def take(self, count: int) -> bytes:
        """Return the next bytes; refuse a file that ends before them."""
        end = self.at + count
        if end > len(self.data):
            raise InputError(f"{self.path}: ends at byte {len(self.data)} within an item; it is cut off")
        taken, self.at = self.data[self.at : end], end
        return taken

    def byte(self) -> int:
        """Return the next byte."""
        return self.take(1)[0]

    def line(self) -> bytes:
        """Return the bytes up to the next line feed, without it."""
        end = self.data.find(b"\n", self.at)
        if end < 0:
            raise InputError(f"{self.path}: ends at byte {len(self.data)} within its header; it is cut off")
        return self.take(end + 1 - self.at)[:-1]

    def place(self) -> tuple[int, int, int]:
        """Return three coordinates, cm."""
        x, y, z = struct.unpack("<3i", self.take(12))
        return x, y, z


def read_label(cursor: Cursor, label: bytearray) -> None:
    """Change the label as an item of version 8 states: remove bytes from its end, then add bytes."""
    first = cursor.byte()
    if first:
        remove, add = first >> 4, first & 0x0F
    else:
        remove, add = _count(cursor), _count(cursor)
    _remove(cursor, label, remove)
    _add(cursor, label, add)


def read_old_label(cursor: Cursor, label: bytearray) -> None:
    """Add the bytes of an item of versions 3 to 7 to the label."""
    size = cursor.byte()
    if size == 0xFE:
        size += struct.unpack("<H", cursor.take(2))[0]
    elif size == 0xFF:
        (size,) = struct.unpack("<I", cursor.take(4))
    _add(cursor, label, size)


def trim_old_label(cursor: Cursor, label: bytearray, code: int) -> None:
    """Shorten the label as the codes 0x01 to 0x1f of versions 3 to 7 state."""
    if code >= 0x10:
        _remove(cursor, label, code - 15)
        return
    _remove(cursor, label, min(16, len(label)))
    for _ in range(code):
        dot = label.rfind(b".", 0, max(len(label) - 1, 0))  # the label may end with a dot, which was kept before
        if dot < 0:
            raise InputError(f"{cursor.path}: byte {cursor.at}: more of a label is removed than it has")
        del label[dot + 1 :]


def _count(cursor: Cursor) -> int:
    count = cursor.byte()
    return struct.unpack("<I", cursor.take(4))[0] if count == 0xFF else count


def _remove(cursor: Cursor, label: bytearray, count: int) -> None:
    if count > len(label):
        raise InputError(f"{cursor.path}: byte {cursor.at}: {count} bytes of a label of {len(label)} are removed")
    del label[len(label) - count :]


def _add(cursor: Cursor, label: bytearray, count: int) -> None:
    most = reader_limits().survex_name_bytes
    if len(label) + count > most:
        raise InputError(
            f"{cursor.path}: byte {cursor.at}: a name of more than {most} bytes (survex_name_bytes in {FILE})"
        )
    label += cursor.take(count)
