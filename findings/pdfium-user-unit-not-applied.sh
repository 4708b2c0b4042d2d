#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check pypdfium2==5.15.2 pypdf==6.4.0
venv/bin/python - <<'PY'
import sys

import pypdf
import pypdfium2
from pypdf.generic import NameObject, NumberObject


def side_in(user_unit):
    """Return the sides in points of a page of 100 x 100 units, as PDFium and as pypdf's `user_unit` give them."""
    writer = pypdf.PdfWriter()
    page = writer.add_blank_page(100, 100)
    page[NameObject("/UserUnit")] = NumberObject(user_unit)
    writer.write("plan.pdf")
    read = pypdfium2.PdfDocument("plan.pdf")[0]
    page = pypdf.PdfReader("plan.pdf").pages[0]
    return read.get_width(), float(page.mediabox.width) * page.user_unit


found = {unit: side_in(unit) for unit in (1, 2)}
print(f"version: pypdfium2 {pypdfium2.version.PYPDFIUM_INFO}, PDFium {pypdfium2.version.PDFIUM_INFO}")
print(
    "behaviour: PDFium gives the same size to a page whose UserUnit is 2, so a plan at a stated scale comes out at half its "
    "size; a good guess says that a size in points includes the page's unit"
)
print(f"seen: width in points by PDFium and by the page's own unit, by UserUnit: {found}")
sys.exit(found != {1: (100.0, 100.0), 2: (100.0, 200.0)})
PY
