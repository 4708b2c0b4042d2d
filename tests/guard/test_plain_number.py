import math

import pytest

from minesurveys.guard.plain_number import plain_number
from minesurveys.pictures.georeference import _six_numbers
from minesurveys.solved.node_links import _read
from minesurveys.stations.compass import _feet
from pipeline.errors import InputError
from pipeline.scans.sweeps import _finite

ODD = ["4_0", "\u0664\u0660", "40\u00a0", "0x1f", "1e", "", "1,5", "--1", "1 2", "+-3", "\x0c1"]


@pytest.mark.parametrize("text", ["0", "-1.5", "+.25", "3.", "1e3", "1E-3", " 12\t", "007", "-0", "9" * 400])
def test_a_number_is_read_as_python_reads_it(text):
    assert plain_number(text) == float(text)


def test_what_is_not_finite_is_left_to_the_caller():
    assert math.isnan(plain_number("NaN"))
    assert plain_number("-inf") == -math.inf


@pytest.mark.parametrize("text", ODD)
def test_what_no_surveying_program_writes_is_no_number(text):
    with pytest.raises(ValueError, match="is not a number"):
        plain_number(text)


@pytest.mark.parametrize("text", ["4_0", "\u0664"])
def test_all_readers_of_text_take_the_same_numbers(tmp_path, text):
    path = tmp_path / "numbers.txt"
    path.write_text("\n".join([text] * 6), encoding="utf-8")
    for read in (
        lambda: _feet(path, 1, text),
        lambda: _finite(path, text),
        lambda: _six_numbers(path),
        lambda: _read(path, 1, 1e6),
    ):
        with pytest.raises(InputError):
            read()
