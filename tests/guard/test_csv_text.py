import codecs

import pytest

from minesurveys.frames import METRIC
from minesurveys.guard.csv_text import read_csv_text
from minesurveys.spots import read_spots
from pipeline.errors import InputError
from pipeline.survey.solved.station_table import read_stations

HEADER = "leg,station,easting_m,northing_m,left_m,right_m\n"
TABLE = HEADER + "Größe,Schürf1,0,0,2,3\nGröße,Schürf2,10,0,2,3\n"


@pytest.mark.parametrize(
    ("encode", "name"),
    [
        (lambda text: codecs.BOM_UTF16_LE + text.encode("utf-16-le"), "UTF-16"),
        (lambda text: codecs.BOM_UTF16_BE + text.encode("utf-16-be"), "UTF-16"),
        (lambda text: text.encode("utf-16-le"), "UTF-16"),
        (lambda text: text.encode("utf-16-be"), "UTF-16"),
        (lambda text: text.encode("cp1252"), "Windows-1252"),
    ],
    ids=["little end first", "big end first", "without a mark", "big end first without a mark", "Windows"],
)
def test_a_table_in_an_encoding_of_spreadsheets_is_read_and_the_encoding_is_named(tmp_path, capsys, encode, name):
    path = tmp_path / "s.csv"
    for text in (TABLE, TABLE.replace("\n", "\r\n"), TABLE.replace(",", "\t"), TABLE.replace(",", ";")):
        path.write_bytes(encode(text))
        legs = read_stations(path)
        assert legs[0].name == "Größe"
        assert legs[0].stations == ["Schürf1", "Schürf2"]
        line = capsys.readouterr().err.strip()
        assert line.startswith(f"s.csv: read as {name}, as it is not UTF-8")
        assert len(line) <= 120


def test_a_table_in_utf_8_is_read_without_a_warning(tmp_path, capsys):
    path = tmp_path / "s.csv"
    for mark in (b"", codecs.BOM_UTF8):
        path.write_bytes(mark + TABLE.encode())
        assert read_stations(path)[0].name == "Größe"
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"leg,station\n\x89\x81\n", r"no text in UTF-8, UTF-16 or Windows-1252 \(byte 13\)"),
        (codecs.BOM_UTF16_LE + b"a\x00b", r"no text in UTF-8, UTF-16 or Windows-1252 \(byte 4\)"),
        (b"\x7fELF\x02\x01\x01\xff", "no text: it holds the control character 2"),
    ],
)
def test_what_is_no_text_is_refused(tmp_path, data, message):
    path = tmp_path / "s.csv"
    path.write_bytes(data)
    with pytest.raises(InputError, match=message):
        read_csv_text(path)


def test_spot_heights_of_a_spreadsheet_may_have_semicolons_or_tabs_and_decimal_commas(tmp_path):
    path = tmp_path / "spots.csv"
    for separator in (";", "\t"):
        path.write_text(
            separator.join(["easting_m", "northing_m", "elevation_m"]) + f"\n1,5{separator}2{separator}3,25\n"
        )
        heights = read_spots(path, METRIC)
        assert heights.spots == [(1.5, 2.0, 0.25)]
        assert heights.datum_m == 3.0


@pytest.mark.parametrize(
    ("line", "separator"), [("sep=;\n", ";"), ("sep=,\r\n", ","), ('"sep=;"\r\n', ";"), ("SEP=\t\n", "\t")]
)
def test_a_line_that_states_the_separator_for_excel_is_none_of_the_table(tmp_path, line, separator):
    path = tmp_path / "s.csv"
    path.write_text(line + TABLE.replace(",", separator), encoding="utf-8")
    assert read_stations(path)[0].stations == ["Schürf1", "Schürf2"]
