"""What a PDF's page states of its size: UserUnit, of how many points its unit is."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PIL import PdfParser

from minesurveys.errors import InputError
from minesurveys.remarks import warn_user

if TYPE_CHECKING:
    import pypdfium2

_UNIT, _MEASURES = b"UserUnit", (b"VP", b"LGIDict")
_LARGEST = 75_000.0  # ISO 32000-2, annex C: the largest UserUnit that Acrobat reads


def points_per_unit(path: Path, document: pypdfium2.PdfDocument, page: int) -> float:
    """Return how many points, 1/72 inch, a unit of a page has: its UserUnit, or 1.

    PDFium does not give a page's UserUnit (findings/pdfium-user-unit-not-applied.sh). So it copies
    the page into a document of its own, which it writes without encryption and packed objects, and Pillow's reader of
    PDF takes the page's entries from there.

    Parameters
    ----------
    path : Path
    document : pypdfium2.PdfDocument
    page : int
        From 1.

    Raises
    ------
    InputError
        If it is not a number above 0.

    References
    ----------
    ISO 32000-2:2020, table 31 (UserUnit, VP)
    """
    entries = _entries(document, page)
    if any(name in entries for name in _MEASURES):
        warn_user(
            f"page {page} states a measure or a georeference (VP, LGIDict), which is not read; --scale "
            "1:N of the paper states the scale",
            of=path.name,
            option="--scale",
        )
    unit = entries.get(_UNIT, 1)
    if not isinstance(unit, int | float) or not math.isfinite(unit) or not 0 < unit <= _LARGEST:
        raise InputError(
            f"{path}: page {page} states the UserUnit {unit!s:.40}, expected a number above 0, at most {_LARGEST:g}; "
            "print it to a new PDF"
        )
    if unit != 1:
        warn_user(f"page {page} states a UserUnit of {unit:g}: its units are {unit:g}/72 inch", of=path.name)
    return float(unit)


def _entries(document: pypdfium2.PdfDocument, page: int) -> dict[bytes, Any]:
    """Return the entries of a page, those of numbers resolved."""
    import pypdfium2  # takes 0.1 s to load, and few plans are PDFs

    alone, copy = pypdfium2.PdfDocument.new(), io.BytesIO()
    try:
        alone.import_pages(document, [page - 1])
        alone.save(copy)
    finally:
        alone.close()
    found = PdfParser.PdfParser(buf=copy.getvalue())
    entries = dict(found.read_indirect(found.pages[0]))
    unit = entries.get(_UNIT)
    if isinstance(unit, PdfParser.IndirectReference):
        entries[_UNIT] = found.read_indirect(unit)
    return entries
