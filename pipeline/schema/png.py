"""What a picture of a bundle holds beyond a header and an image of its size, which `minexplore` checks."""

from __future__ import annotations

import struct

import numpy as np

from minexplore.bundle import BundleError
from minexplore.sealed.png import PALETTE, chunks_of, image_blocks


def inflate_png(name: str, data: bytes) -> None:
    """Check that the image of a picture that `check_png` accepts is whole, and names only colours of its palette.

    Raises
    ------
    BundleError
        As `image_blocks`; or naming a colour that is not there, or rows that are filtered.
    """
    if data[25] != PALETTE:
        for _ in image_blocks(name, data):
            pass
        return
    palette = next(len(body) // 3 for kind, body in chunks_of(data) if kind == b"PLTE")
    row = 1 + struct.unpack(">I", data[16:20])[0]
    highest, filtered, found = 0, False, 0
    for block in image_blocks(name, data):
        values = np.frombuffer(block, np.uint8)
        highest = max(highest, int(values.max()))
        filtered |= bool(values[-found % row :: row].any())  # a row begins with the number of its filter
        found += len(block)
    if highest >= palette or filtered:
        raise BundleError(f"{name}: colour {highest} of a palette of {palette}, or rows that are filtered")
