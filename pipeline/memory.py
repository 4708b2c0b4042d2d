"""The memory of this process: how it is kept, and given back to the system."""

from __future__ import annotations

import atexit
import ctypes
import gc
import sys
from typing import Any

# Numbers of glibc's mallopt.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
_KEPT_BYTES = 1 << 27  # at the end of the heap; an array of a million numbers has 8 MB
_MAPPED_BYTES = 1 << 26


def keep_memory() -> None:
    """Set this process up for arrays that come and go, and for objects that stay.

    The C library gives each large array back to the system at once, and the system clears every page of the next one.
    When it ends, Python searches all objects for circles once more, which takes 0.6 s with the libraries of a stage
    loaded.
    """
    atexit.register(gc.freeze)
    library = _c_library()
    if hasattr(library, "mallopt"):
        library.mallopt(_TRIM_THRESHOLD, _KEPT_BYTES)
        library.mallopt(_MMAP_THRESHOLD, _MAPPED_BYTES)


def give_back() -> None:
    """Give back to the system the memory that was freed; elsewhere than on Linux with glibc nothing happens.

    The C library keeps what it was given, for later: after rays were cast at the rock of the default mine 0.4 GB, after
    its model was compiled 0.35 GB. Over the stages of a mine these add up.
    """
    library = _c_library()
    if hasattr(library, "malloc_trim"):
        library.malloc_trim(0)


def _c_library() -> Any:
    """Return the C library on Linux; musl has neither function. None elsewhere."""
    return ctypes.CDLL(None) if sys.platform == "linux" else None
