"""The size of a PDF's page follows its UserUnit, its crop box and its turn.

Matplotlib writes the pages, and Pillow writes what is stated into them; packed pages are qpdf's.
"""

import cv2
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import PdfParser

from minesurveys.pictures.pages import open_page, read_page
from minesurveys.remarks import collect_remarks
from pipeline.errors import InputError
from pipeline.params.stated import StatedOptions
from pipeline.survey.detect import detect_survey
from tests.project import ROOT
from tests.survey.drawing.packed_pages import AES, PACKED

SHARED = ROOT.parent / "shared/data/turn4"
DPI = 100


def bar_page(path, inches=(8, 6), **entries):
    """Write a page with a black box, a quarter of the page wide and a tenth high, and entries of the page."""
    figure = Figure(figsize=inches)
    axis = figure.add_axes((0, 0, 1, 1))
    axis.set(xlim=(0, 1), ylim=(0, 1))
    axis.axis("off")
    axis.fill([0.25, 0.5, 0.5, 0.25], [0.4, 0.4, 0.5, 0.5], color="black", lw=0)
    figure.savefig(path)
    with PdfParser.PdfParser(str(path), mode="r+b") as pdf:
        (reference,) = pdf.pages
        page = pdf.read_indirect(reference)
        for name, value in entries.items():
            page[name.encode()] = value
        pdf.start_writing()
        pdf.write_obj(reference, page)
        pdf.write_xref_and_trailer()
    return path


def box_in(path, dpi=DPI):
    """Return the size of the page and of the black box in it, inches."""
    picture = read_page(path, 1, dpi, 200.0)
    _, _, wide, high = cv2.boundingRect((picture.max(axis=2) < 128).astype(np.uint8))
    return np.array([picture.shape[1], picture.shape[0], wide, high]) / dpi


@pytest.mark.parametrize("unit", [1, 2, 0.5, 2.5])
def test_a_page_is_as_large_as_its_user_unit_makes_it(tmp_path, unit):
    path = bar_page(tmp_path / "a.pdf", **({} if unit == 1 else {"UserUnit": unit}))
    assert box_in(path) == pytest.approx(unit * np.array([8, 6, 2, 0.6]), abs=0.03)


def test_a_turned_and_cropped_page_has_its_user_unit_too(tmp_path):
    turned = bar_page(tmp_path / "turned.pdf", UserUnit=2, Rotate=90)
    assert box_in(turned) == pytest.approx([12, 16, 1.2, 4], abs=0.03)
    cropped = bar_page(tmp_path / "cropped.pdf", UserUnit=2, CropBox=[72, 72, 504, 360])
    assert box_in(cropped) == pytest.approx([12, 8, 4, 1.2], abs=0.03)


@pytest.mark.parametrize("data", [PACKED, AES], ids=["packed objects", "encrypted"])
def test_the_user_unit_of_a_page_in_packed_objects_is_found(tmp_path, data):
    path = tmp_path / "a.pdf"
    path.write_bytes(data)
    picture = read_page(path, 1, 72, 200.0)
    assert picture.shape[:2] == pytest.approx((round(2.5 * 595), round(2.5 * 842)), abs=1)


def test_the_user_unit_is_listed_and_counts_for_the_resolution_that_fits(tmp_path):
    with collect_remarks() as remarks, open_page(bar_page(tmp_path / "a.pdf", (8, 6), UserUnit=10), 1) as page:
        assert page.fitting_dpi() == 91
    lines = [remark.line() for remark in remarks]
    assert "a.pdf: page 1 states a UserUnit of 10: its units are 10/72 inch" in lines
    assert any("page of 80 x 60 in" in line for line in lines)


def test_a_plan_of_two_points_a_unit_is_detected_as_that_of_one(tmp_path):
    one, two = (bar_page(tmp_path / f"{k}.pdf", (8 / k, 6 / k), UserUnit=k) for k in (1, 2))
    widths = [detect_survey(path, StatedOptions(ratio=500, dpi=100)).width_m for path in (one, two)]
    assert widths[0] == pytest.approx(0.6 * 0.0254 * 500, rel=0.05)
    assert widths[1] == pytest.approx(widths[0], rel=0.02)


@pytest.mark.skipif(not SHARED.is_dir(), reason=f"no {SHARED}")
def test_the_shared_page_of_user_unit_2_reads_as_that_of_1():
    found = [detect_survey(SHARED / f"plan-userunit{k}.pdf") for k in (1, 2)]
    assert found[0].width_m == pytest.approx(4.0, abs=0.1)
    assert found[1].width_m == found[0].width_m
    shapes = [read_page(SHARED / f"plan-userunit{k}.pdf", 1, 200, 200.0).shape for k in (1, 2)]
    assert shapes[0] == shapes[1]


@pytest.mark.parametrize("unit", [0, -2, 1e6])
def test_a_user_unit_that_is_no_size_is_refused(tmp_path, unit):
    with pytest.raises(InputError, match=r"a\.pdf: page 1 states the UserUnit .*, expected a number above 0"):
        read_page(bar_page(tmp_path / "a.pdf", UserUnit=unit), 1, DPI, 200.0)


def test_a_measure_of_a_page_is_listed_as_not_read(tmp_path):
    measure = {"Type": PdfParser.PdfName("Viewport"), "BBox": [0, 0, 576, 432]}
    with collect_remarks() as remarks:
        read_page(bar_page(tmp_path / "a.pdf", VP=[PdfParser.PdfDict(measure)]), 1, DPI, 200.0)
    assert any(
        "page 1 states a measure or a georeference (VP, LGIDict), which is not read" in r.line() for r in remarks
    )
