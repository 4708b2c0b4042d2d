"""Diagrams have the same bytes on machines with other fonts."""

import copy
from pathlib import Path

import matplotlib
from matplotlib.font_manager import FontEntry, fontManager

from pipeline.report.figures.style import use_own_fonts


def test_a_font_of_the_machine_is_not_taken() -> None:
    manager = copy.copy(fontManager)
    manager.ttflist = [FontEntry(fname="/fonts/DejaVuSans.ttf", name="DejaVu Sans", size="scalable")]
    use_own_fonts(manager)
    found = Path(manager.findfont("DejaVu Sans"))
    assert found == Path(matplotlib.get_data_path(), "fonts/ttf/DejaVuSans.ttf")
