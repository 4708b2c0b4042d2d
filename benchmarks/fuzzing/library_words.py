"""Words by which a message shows that it is a library's exception and no sentence of ours."""

from __future__ import annotations

import re

_NAMES = (
    *("OpenCV", "cv2", "PDFium", "Pdfium", "pypdfium2", "ezdxf", "GDAL", "OGR", "rasterio", "pyogrio", "GEOS"),
    *("GEOSException", "shapely", "numpy", "pyproj", "laspy", "trimesh", "open3d", "pydantic", "sqlite3", "omegaconf"),
)
_PHRASES = (  # of Python, NumPy and their like
    *(r"\w+(?:Error|Exception)\b", "NoneType", "Traceback", "has no attribute", "index out of range"),
    *("invalid literal", "could not convert", "not subscriptable", "not iterable", "unexpected keyword", "argmax"),
    *("to unpack", "empty sequence", "unsupported operand", r"codec can't decode", "buffer is smaller"),
    *("StopIteration", r"sqlite3_\w+", r"\bfread\b", r"\(char \d+\)", r"line \d+ column"),  # of parsers
)
_PATTERN = re.compile(rf"\b(?:{'|'.join(_NAMES)})\b|{'|'.join(_PHRASES)}")


def library_words(message: str) -> list[str]:
    """Return the words of a message that are a library's; none is the rule."""
    return _PATTERN.findall(message)
