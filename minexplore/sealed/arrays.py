"""Read the arrays of a .npz archive, each after a look at its header, so that nothing large is unpacked."""

from __future__ import annotations

import io
import struct
import tokenize
import zipfile
import zlib

import numpy as np

from minexplore.bundle import BundleError

_UNREADABLE = (
    *(zipfile.BadZipFile, zlib.error, OSError, EOFError, SyntaxError, tokenize.TokenError, struct.error),
    *(ValueError, RuntimeError),
)
# Other methods need the memory that the archive states: LZMA up to 4 GB.
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_NAME_AT = 26  # in the header of a member: the lengths of its name and of its extra field, which follow
_END, _END_SIGNATURE = "<4s4H2LH", b"PK\5\6"  # of an archive, with the bytes of its directory and of a comment


def read_arrays(file: str, data: bytes, table: dict[str, tuple[str, int]], most: int) -> dict[str, np.ndarray]:
    """Return the arrays of an archive, which holds those of a table and nothing else.

    Parameters
    ----------
    file : str
        For the message.
    data : bytes
    table : dict
        The dtype and the number of dimensions of each array by its name.
    most : int
        Values of each array.

    Raises
    ------
    BundleError
        If it is no archive of these arrays, holds other bytes before, between or after them, is packed by another
        method than deflate, or an array is too large.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = sorted(archive.namelist())
            if names != sorted(f"{name}.npy" for name in table):
                raise BundleError(f"{file}: holds {str(names)[:200]}, want {', '.join(table)}")
            odd = {entry.compress_type for entry in archive.infolist()} - {*_METHODS}
            if odd:
                raise BundleError(f"{file}: packed by method {min(odd)}, want 0 or 8")
            if _bytes_of(archive, data) != len(data):
                raise BundleError(f"{file}: holds other bytes than its arrays")
            return {name: _read_array(file, archive, name, *want, most) for name, want in table.items()}
    except BundleError:
        raise
    except _UNREADABLE as error:
        raise BundleError(f"{file}: cannot be read: no archive of arrays, or damaged") from error


def _bytes_of(archive: zipfile.ZipFile, data: bytes) -> int:
    """Return how many bytes the members, the directory and the end of an archive take; 0 if it does not end there."""
    signature, *_, directory, _, comment = struct.unpack_from(_END, data, len(data) - struct.calcsize(_END))
    if signature != _END_SIGNATURE or comment:
        return 0
    count = directory + struct.calcsize(_END)
    for entry in archive.infolist():
        name, extra = struct.unpack_from("<2H", data, entry.header_offset + _NAME_AT)
        count += _NAME_AT + 4 + name + extra + entry.compress_size
    return int(count)


def _read_array(file: str, archive: zipfile.ZipFile, name: str, kind: str, dimensions: int, most: int) -> np.ndarray:
    """Return an array of this dtype and number of dimensions with at most so many values.

    Raises
    ------
    BundleError
        If it is another array.
    """
    with archive.open(f"{name}.npy") as stream:
        version = np.lib.format.read_magic(stream)
        if version != (1, 0):
            raise BundleError(f"{file}: {name} has format {version}, want (1, 0)")
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream, max_header_size=1000)
        cells = int(np.prod(shape, dtype=object))
        if dtype.str != kind or len(shape) != dimensions or fortran or min(shape, default=0) < 0 or cells > most:
            raise BundleError(
                f"{file}: {name} is {dtype.str} of shape {shape}, want {kind} of {dimensions} dimensions and "
                f"at most {most} values"
            )
        raw = stream.read(cells * dtype.itemsize + 1)
    if len(raw) != cells * dtype.itemsize:
        raise BundleError(f"{file}: {name} does not hold {cells} values")
    return np.frombuffer(raw, dtype).reshape(shape)
