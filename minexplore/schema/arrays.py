"""Read one array of a .npz archive after a look at its header, so that nothing large is unpacked."""

from __future__ import annotations

import struct
import tokenize
import zipfile
import zlib

import numpy as np

from minexplore.bundle import BundleError

UNREADABLE = (zipfile.BadZipFile, zlib.error, OSError, EOFError, SyntaxError, tokenize.TokenError, struct.error)


def read_array(file: str, archive: zipfile.ZipFile, name: str, kind: str, dimensions: int, most: int) -> np.ndarray:
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
