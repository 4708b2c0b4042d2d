"""Points of LAS and LAZ files, block by block, without those that the file marks as none."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from minesurveys.clouds.las.system import stated_system
from minesurveys.clouds.point_blocks import PointBlock, Wanted, block_of, fields_of
from minesurveys.errors import InputError
from minesurveys.remarks import warn_user

_BLOCK = 1_000_000
_HEAD, _POINTS_AT, _RECORDS_AT, _EXTENDED_AT = 375, 96, 100, 243  # bytes of the header and in it
_LAZ_CHUNK = 20  # bytes of its first point, which is not packed
_LIMITS = (-(2**31), 2**31 - 1)  # of a record: a coordinate beyond is clamped to it by programs that write it
_NOISE = {7: "low noise (class 7)", 18: "high noise (class 18)"}
_LISTED = ("synthetic", "key_point", "overlap")


def las_blocks(path: Path, wanted: Wanted) -> Iterator[PointBlock]:
    """Yield the points of a LAS or LAZ file in blocks, in its units, with the coordinate system that it states.

    Points flagged withheld and points of the classes of noise are left out, and counted in a remark.

    Raises
    ------
    InputError
        If the file is broken or truncated, its scale is none, all points are left out, or coordinates are clamped at
        the limits of a record.

    References
    ----------
    ASPRS, LAS Specification 1.4 - R15: 2.4 (scale and offset), tables 8, 16 and 17 (flags and classes).
    """
    import laspy

    _require_records(path)
    try:
        # The parallel decoder's threads do not survive a fork.
        with laspy.open(path, laz_backend=laspy.LazBackend.Lazrs) as reader:
            system, tally = stated_system(path, reader.header), _Tally(path)
            for chunk in reader.chunk_iterator(_BLOCK):
                chunk = chunk[tally.kept(chunk)]
                if tally.is_clamped or not len(chunk):
                    continue
                fields = fields_of(chunk.point_format.dimension_names, wanted)
                columns = {field: np.asarray(chunk[name]) for field, name in fields.items()}
                yield block_of(np.column_stack([chunk.x, chunk.y, chunk.z]), columns, system)
            if tally.count < reader.header.point_count:
                raise InputError(
                    f"{path}: {tally.count} points, but its header states {reader.header.point_count}; the file is "
                    "truncated"
                )
            tally.finish()
            _warn_of_more(path, reader.header)
    except (laspy.errors.LaspyException, struct.error, OSError, ValueError, RuntimeError, OverflowError) as error:
        raise InputError(
            f"{path}: cannot be read as LAS or LAZ; it is broken or cut off, and behind a wrong byte of a LAZ file no "
            "point can be unpacked; copy or export it again"
        ) from error


def _warn_of_more(path: Path, header: Any) -> None:
    """List points behind the last one that a header counts, as in a file whose writer did not finish."""
    if path.suffix.lower() != ".las" or header.number_of_evlrs or header.start_of_waveform_data_packet_record:
        return
    room = (path.stat().st_size - header.offset_to_point_data) // header.point_format.size
    if room > header.point_count:
        warn_user(
            "points lie behind those that its header counts, and are not read; export it again",
            of=path.name,
            count=f"{room - header.point_count:,} of {room:,}",
        )


class _Tally:
    """Counts of the points of a file by what it states of them."""

    def __init__(self, path: Path) -> None:
        """Begin to count."""
        self.path, self.count = path, 0
        self.left_out: Counter[str] = Counter()
        self.listed: Counter[str] = Counter()
        self.clamped: Counter[tuple[str, int]] = Counter()

    @property
    def is_clamped(self) -> bool:
        """Return whether a coordinate lies at the limit of a record."""
        return bool(self.clamped)

    def kept(self, chunk: Any) -> np.ndarray:
        """Return which points (n,) of a block are read, and count the others."""
        self.count += len(chunk)
        names, classes = set(chunk.point_format.dimension_names), np.asarray(chunk["classification"])
        kept = np.ones(len(chunk), bool)
        withheld = np.asarray(chunk["withheld"], bool) if "withheld" in names else ~kept
        for name, rows in (("flagged withheld", withheld), *((text, classes == k) for k, text in _NOISE.items())):
            self.left_out[name] += int((rows & kept).sum())
            kept &= ~rows
        for name in _LISTED:
            if name in names:
                self.listed[name] += int((np.asarray(chunk[name], bool) & kept).sum())
        for axis in "XYZ":
            raw = np.asarray(chunk[axis])[kept]
            for limit in _LIMITS:
                self.clamped[axis, limit] += int((raw == limit).sum())
        self.clamped = +self.clamped
        return kept

    def finish(self) -> None:
        """List what was left out or changes nothing; refuse a file with clamped coordinates or no points."""
        kept = self.count - sum(self.left_out.values())
        if self.clamped:
            (axis, limit), most = self.clamped.most_common(1)[0]
            raise InputError(
                f"{self.path}: {100 * most / kept:.3g} % of its {axis} are {limit}, the limit of a record: coordinates "
                "beyond it were clamped when the file was written; export it again with an offset near the workings, "
                "or a larger scale factor"
            )
        left_out, listed = +self.left_out, +self.listed
        if left_out:
            text = " and ".join(f"{count} {name}" for name, count in left_out.items())
            if not kept:
                raise InputError(f"{self.path}: all of its points are left out: {text}; clear the flags to read them")
            warn_user(f"{text} of {self.count} points are left out, as the file states", of=self.path.name)
        if listed:
            text = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in listed.items())
            warn_user(f"points flagged {text} are read as the others", of=self.path.name)


def _require_records(path: Path) -> None:
    """Refuse a header that states more variable length records, or bytes before the points, than the file can hold.

    laspy would look for each record, and reserve memory for the bytes.

    References
    ----------
    ASPRS, LAS Specification 1.4, tables 3 and 20
    """
    with path.open("rb") as stream:
        head, size = stream.read(_HEAD), path.stat().st_size
    for at, least in ((_RECORDS_AT, 54), (_EXTENDED_AT, 60)):
        count = int.from_bytes(head[at : at + 4], "little")
        if count * least > size and (at == _RECORDS_AT or head[25:26] >= b"\4"):
            raise InputError(
                f"{path}: its header states {count:,} variable length records, which need {count * least:,} bytes; "
                f"the file has {size:,}"
            )
    points_at = int.from_bytes(head[_POINTS_AT : _POINTS_AT + 4], "little")
    if points_at > size:
        raise InputError(f"{path}: its header states points behind byte {points_at:,}; the file has {size:,}")
    _require_chunks(path, points_at, size)


def _require_chunks(path: Path, points_at: int, size: int) -> None:
    """Refuse a LAZ file whose table states more chunks than it can hold; lazrs would reserve memory for each."""
    if path.suffix.lower() != ".laz":
        return
    with path.open("rb") as stream:
        stream.seek(points_at)
        table_at = int.from_bytes(stream.read(8), "little")
        if not points_at < table_at < size:  # at the end of the file, or nowhere
            return
        stream.seek(table_at + 4)
        chunks = int.from_bytes(stream.read(4), "little")
    if chunks * _LAZ_CHUNK > size:
        raise InputError(
            f"{path}: its table states {chunks:,} packed chunks, more than it can hold; copy or export it again"
        )
