"""Pages of a PDF, rendered as pictures."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from minesurveys.errors import InputError
from minesurveys.frames import Image
from minesurveys.guard.plain_file import read_text_bytes
from minesurveys.pictures.page_unit import points_per_unit
from minesurveys.pictures.picture_header import MAX_SIDE_PX
from minesurveys.remarks import warn_user

if TYPE_CHECKING:
    import pypdfium2

USUAL_DPI, _LEAST_DPI = 200.0, 36.0  # of a page if none is stated, and the least that may be
_FITTING_PX = 40e6  # of a page: reading takes about 25 bytes a pixel beside libraries, 1 GB in all


def read_first_page(path: Path, max_megapixels: float) -> Image:
    """Render the first page at 200 dpi, a large one at less with a warning; `InputError` if the file is no PDF."""
    with open_page(path, 1) as opened:
        return opened.render(opened.fitting_dpi(), max_megapixels)


def read_page(path: Path, page: int, dpi: float, max_megapixels: float) -> Image:
    """Render a PDF page as `OpenPage.render`; `InputError` if the file is no PDF, or has no such page."""
    with open_page(path, page) as opened:
        return opened.render(dpi, max_megapixels)


@dataclass(frozen=True)
class OpenPage:
    """A page of a PDF that is open: its file, its number from 1 of `pages`, and the points of one of its units."""

    path: Path
    number: int
    pages: int
    content: pypdfium2.PdfPage
    unit: float

    def render(self, dpi: float, max_megapixels: float) -> Image:
        """Return the page on white paper as (rows, cols, 3) uint8 BGR; `InputError` if it is beyond a limit on size."""
        if self.pages > 1:
            text = f"page {self.number} of {self.pages} is read"
            warn_user(text, of=self.path.name, option="--page", advice="--page states another")
        self._require_size(dpi, max_megapixels)
        return np.ascontiguousarray(self.content.render(scale=self.unit * dpi / 72).to_numpy()[..., :3])

    def text(self) -> str:
        """Return the text of the page; it is empty for a scan."""
        return str(self.content.get_textpage().get_text_range())

    def fitting_dpi(self) -> float:
        """Return the resolution at which it is read if none is stated: 200, less for a large page, with a warning.

        Raises
        ------
        InputError
            If the page is too large at the least resolution.
        """
        width, height = (side / 72 for side in self._size())
        fits = math.sqrt(_FITTING_PX / max(width * height, 1e-9))
        if fits >= USUAL_DPI:
            return USUAL_DPI
        dpi = max(_LEAST_DPI, float(math.floor(fits)))
        self._require_size(dpi, MAX_SIDE_PX**2 / 1e6)
        warn_user(
            f"page of {width:.0f} x {height:.0f} in; it is read at {dpi:g} dpi",
            of=self.path.name,
            option="--dpi",
            advice="--dpi states another",
        )
        return dpi

    def _size(self) -> tuple[float, float]:
        """Return its width and height, points."""
        width, height = self.content.get_size()
        return self.unit * width, self.unit * height

    def _require_size(self, dpi: float, max_megapixels: float) -> None:
        width, height = (side * dpi / 72 for side in self._size())
        if max(width, height) > MAX_SIDE_PX or width * height > max_megapixels * 1e6 or min(width, height) < 8:
            raise InputError(
                f"{self.path}: page {self.number} is {width:.0f} x {height:.0f} px at survey.dpi = {dpi:g}; "
                f"the limits are {MAX_SIDE_PX} px a side and {max_megapixels:g} megapixels; --dpi states another"
            )


@contextmanager
def open_page(path: Path, page: int) -> Iterator[OpenPage]:
    """Open a page of a PDF, from 1.

    Raises
    ------
    InputError
        If the file is not PDF, or has no such page.
    """
    import pypdfium2  # takes 0.1 s to load, and few plans are PDFs

    try:
        document = pypdfium2.PdfDocument(read_text_bytes(path))
        try:
            if page > len(document):
                raise InputError(f"{path}: survey.page = {page}: the document has {len(document)} pages")
            unit = points_per_unit(path, document, page)
            yield OpenPage(path, page, len(document), document[page - 1], unit)
        finally:
            document.close()
    except pypdfium2.PdfiumError as error:
        raise InputError(f"{path}: cannot be read as PDF: it is broken, cut off or locked by a password") from error
