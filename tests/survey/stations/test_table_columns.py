"""Columns of tables that another program made: by their names and units, by --columns, or refused with a way on."""

import argparse
import re
import shutil

import numpy as np
import pytest
import yaml

from minesurveys.clouds.cloud_formats import read_blocks
from minesurveys.remarks import collect_remarks
from minesurveys.solved_surveys import solve_file
from pipeline.commands.options import add_options, stated_options
from pipeline.errors import InputError
from pipeline.import_mine import draft_import
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import CloudSurveyParams
from pipeline.survey.clouds.read import thinned_scan
from pipeline.survey.detect import detect_survey
from pipeline.survey.solved.station_table import read_station_legs, read_stations
from tests.project import shared_file


def with_legs(text, separator):
    """A table with a column leg before the others, as the refusal of a list of points says."""
    head, *rows = text.splitlines()
    return "\n".join([f"leg{separator}{head}", *(f"A{separator}{row}" for row in rows)]) + "\n"


TOTAL_STATION = """Punkt;Hochwert;Rechtswert;Hoehe;Code
1;5712345,12;3456789,10;412,30;SOHLE
2;5712345,90;3456829,05;412,10;SOHLE
3;5712385,40;3456830,00;411,95;SOHLE
"""
ENGLISH = """Point ID,Northing (m),Easting (m),Elev. (m),Description
1,5712345.12,3456789.10,412.30,FLOOR
2,5712345.90,3456829.05,412.10,FLOOR
3,5712385.40,3456830.00,411.95,FLOOR
"""


@pytest.mark.parametrize(("text", "separator"), [(TOTAL_STATION, ";"), (ENGLISH, ",")])
def test_a_list_of_points_is_refused_and_read_with_the_legs_that_the_refusal_asks_for(tmp_path, text, separator):
    path = tmp_path / "s.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=r"s\.csv: a list of points \(P.* is station, .* add a column leg"):
        detect_survey(path)
    path.write_text(with_legs(text, separator))
    with collect_remarks() as said:
        (leg,) = read_station_legs(path)
    assert leg.stations == ["1", "2", "3"]
    steps = np.diff(leg.positions_m, axis=0)
    assert steps == pytest.approx(np.array([[39.95, 0.78], [0.95, 39.5]]))
    assert leg.heights_m[:, 0] == pytest.approx([412.3, 412.1, 411.95])
    assert any("as easting_m" in remark.line() and "as northing_m" in remark.line() for remark in said)
    found = detect_survey(path, StatedOptions(half_width_m=2.0))
    assert found.values["origin"][:2] == [3456780.0, 5712340.0]


def test_a_list_of_points_that_another_made_is_refused_with_its_columns_and_the_way_to_ours():
    with pytest.raises(
        InputError,
        match="Punkt is station, Rechtswert is easting_m, Hochwert is northing_m, Hoehe is elevation_m",
    ):
        detect_survey(shared_file("total-station.csv"))


def test_columns_of_others_in_feet_are_read_in_feet_and_our_own_names_come_first(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text("leg,name,station,East (ft),North [ft],left_ft,right_ft\nA,x,a,0,0,6,6\nA,y,b,100,0,6,6\n")
    (leg,) = read_stations(path)
    assert leg.stations == ["a", "b"]
    assert leg.positions_m == pytest.approx(np.array([[0, 0], [30.48, 0]]))


@pytest.mark.parametrize("above", ["", "# 2024.05.01 created by TopoDroid v 6.2.1\n\n# mine\n# "])
def test_a_table_of_shots_is_refused_with_the_program_that_reads_it(tmp_path, above):
    path = tmp_path / "s.csv"
    path.write_text(f"{above}from,to,tape,compass,clino\na,b,10.0,90.0,0.0\nb,c,10.0,0.0,0.0\n")
    with pytest.raises(InputError, match="a table of shots") as caught:
        detect_survey(path)
    if above:
        assert "TopoDroid exports the same survey for Survex or Therion: give the .svx or .th" in str(caught.value)
    else:
        assert read_by_survex(path, str(caught.value)).values["file"] == "s.svx"


def read_by_survex(path, refusal):
    """Follow the refusal: its lines, and the rows of the table with blanks between fields, in a file for Survex."""
    rows = [row.replace(",", " ").replace(";", " ") for row in path.read_text().splitlines()[1:]]
    lines = re.findall(r"'(\*[a-z]+ [a-z0-9 -]+)'", refusal)
    path.with_suffix(".svx").write_text("\n".join([*lines, *rows]) + "\n")
    if not shutil.which("cavern"):
        pytest.skip("Survex is not installed (Debian: survex)")
    return detect_survey(path.with_suffix(".svx"), StatedOptions(half_width_m=2.0))


@pytest.mark.parametrize(
    ("head", "rows"),
    [
        ("From,To,Hz,Zenith,SlopeDist,Note", "a,b,90,80,10,x\nb,c,0,90,20,y\n"),
        ("von;nach;Hz [gon];V [gon];SD [ft]", "a;b;100;88.888889;32.808399\nb;c;0;100;65.616798\n"),
    ],
)
def test_directions_and_zenith_angles_are_read_by_survex_as_the_refusal_says(tmp_path, head, rows):
    path = tmp_path / "s.csv"
    path.write_text(f"{head}\n{rows}")
    with pytest.raises(InputError, match="a table of shots") as caught:
        detect_survey(path)
    read_by_survex(path, str(caught.value))
    east, north, up = np.ptp(solve_file(tmp_path / "s.svx").positions_m, axis=0)
    run = 10 * np.cos(np.radians(10))
    assert (east, north, up) == pytest.approx((run, 20, 10 * np.sin(np.radians(10))), abs=0.01)


def test_readings_without_stations_are_refused_with_their_columns(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text("Pt,Hz,V,SD\n1,10.0,90.0,30.0\n2,100.0,90.0,30.0\n")
    with pytest.raises(InputError, match=r"its columns \(Pt, Hz, V, SD\) are distances and angles .* add the columns"):
        detect_survey(path)
    path.write_text("from,to,Hz,V,SD\na,1,10.0,90.0,30.0\n1,2,100.0,90.0,30.0\n")  # as it says
    with pytest.raises(InputError, match="Survex reads them"):
        detect_survey(path)


POINTS = (
    "1,5712345.12,3456789.10,412.30,FLOOR\n2,5712345.90,3456829.05,412.10,FLOOR\n3,5712385.40,3456830.00,411.95,FLOOR\n"
)
STEPS = np.array([[39.95, 0.78], [0.95, 39.5]])


def typed(path, *words):
    parser = argparse.ArgumentParser()
    add_options(parser)
    return stated_options(path, parser.parse_args([*words, "--half-width", "2"]))


@pytest.mark.parametrize(
    ("head", "columns", "metres"),
    [
        ("P,N,E,Z,code\n", "leg=code", 1.0),  # the others by their names
        ("a,b,c,d,e\n", "leg=e,station=a,northing_m=b,easting_m=c,elevation_m=d", 1.0),
        ("a,b,c,d,e\n", "leg=e,station=a,northing_ft=b,easting_ft=c,elevation_ft=d", 0.3048),
        ("P,N [usft],E [usft],Z [usft],code\n", "leg=code", 1200 / 3937),
        ("P,N,E,Z,code\n", "leg=code,northing_cm=N,easting_cm=E,elevation_cm=Z", 0.01),
        ("", "leg=5,station=1,northing_m=2,easting_m=3,elevation_m=4", 1.0),
    ],
)
def test_stated_columns_are_read_in_their_unit_whatever_their_names(tmp_path, head, columns, metres):
    path = tmp_path / "s.csv"
    path.write_text(head + POINTS)
    stated = typed(path, "--columns", columns)
    (leg,) = read_station_legs(path, columns=stated.columns)
    assert leg.name == "FLOOR"
    assert leg.stations == ["1", "2", "3"]
    assert np.diff(leg.positions_m, axis=0) == pytest.approx(metres * STEPS)
    assert leg.heights_m[:, 0] == pytest.approx(metres * np.array([412.3, 412.1, 411.95]))
    if metres == 1.0:
        draft = draft_import("columns", path, stated)
        assert yaml.safe_load(draft.section)["survey"]["columns"] == stated.columns


def test_a_table_without_names_is_refused_with_the_option_that_numbers_its_columns(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text(POINTS)
    with pytest.raises(InputError, match=r"names: --columns leg=NUMBER,station=NUMBER,easting_m=NUMBER,northing_m=NUM"):
        detect_survey(path)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ("leg=kode", r"--columns leg=kode: no such column; there are P, N, E, Z, code"),
        ("drift=code", r"--columns drift: no column of a station table; there are leg, station, easting"),
        ("easting_miles=E", r"--columns easting_miles: no column of a station table"),
        ("easting_m=E,northing_m=E", r"--columns northing_m=E: stated twice"),
    ],
)
def test_a_stated_column_that_is_none_is_refused_with_those_that_are(tmp_path, columns, message):
    path = tmp_path / "s.csv"
    path.write_text("P,N,E,Z,code\n" + POINTS)
    with pytest.raises(InputError, match=message):
        detect_survey(path, typed(path, "--columns", columns))
    with pytest.raises(InputError, match=r"--columns names the columns of a station table \(\.csv\)"):
        detect_survey(shared_file("duplicate-tie.svx"), typed(path, "--columns", columns))


@pytest.mark.parametrize(("unit", "metres"), [("ft", 0.3048), ("usft", 1200 / 3937), ("in", 0.0254), ("m", 1.0)])
def test_the_unit_in_a_columns_name_is_read(tmp_path, unit, metres):
    path = tmp_path / "s.csv"
    path.write_text(f"leg,station,x_{unit},Y ({unit}),left_{unit},right [{unit}]\nA,a,0,0,60,60\nA,b,1000,500,60,60\n")
    with collect_remarks() as said:
        (leg,) = read_stations(path)
    assert leg.positions_m[1] == pytest.approx((1000 * metres, 500 * metres))
    assert leg.walls_m == pytest.approx(np.full((2, 2), 60 * metres))
    assert any(f"x_{unit} as easting_{unit}, Y ({unit}) as northing_{unit}" in remark.line() for remark in said)


def test_a_unit_that_is_not_known_is_refused_and_the_option_reads_the_column(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text("leg,station,Easting (chains),northing_m,left_m,right_m\nA,a,0,0,2,2\nA,b,30,0,2,2\n")
    with pytest.raises(InputError, match="the unit of the column 'Easting \\(chains\\)' is not known") as caught:
        detect_survey(path)
    ours = re.search(r"--columns (\w+)='(.*?)'", str(caught.value))
    detect_survey(path, typed(path, "--columns", f"{ours[1]}={ours[2]}"))


@pytest.mark.parametrize(
    ("head", "metres"),
    [
        ("x_ft,y_ft,z_ft", 0.3048),
        ("X (ft),Y (ft),Z (ft)", 0.3048),
        ("E [mm],N [mm],Z_mm", 0.001),
        ("x,y,z", 1.0),
    ],
)
def test_points_have_the_unit_that_their_columns_state(tmp_path, head, metres):
    path = tmp_path / "s.csv"
    rows = np.random.default_rng(0).uniform(0, 5 / metres, (500, head.count(",") + 1))
    np.savetxt(path, rows, delimiter=",", header=head, comments="")
    params = CloudSurveyParams.model_validate({"kind": "cloud", "name": "points", "file": "data/x"})
    with collect_remarks() as said:
        scan = thinned_scan(params.model_copy(update={"file": path.as_posix()}), 0.01, look=True)
    assert np.ptp(scan.cloud.points_m, axis=0) == pytest.approx(np.full(3, 5.0), abs=0.1)
    assert (f"a unit of {metres:g} m" in " ".join(remark.line() for remark in said)) == (metres != 1.0)


def test_points_of_two_units_and_rows_that_are_counted_are_refused(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text("x_ft,y_m,z_m\n" + "1,2,3\n" * 200)
    with pytest.raises(InputError, match="the columns 'x_ft' and 'y_m' have different units"):
        list(read_blocks(path, 1.0))
    rows = "".join(f"{k},{k % 7},{k % 5},{k % 3}\n" for k in range(1, 201))
    path.write_text(rows)
    with pytest.raises(InputError, match="its first column counts its rows") as caught:
        list(read_blocks(path, 1.0))
    path.write_text(re.search(r"'(number.*)'", str(caught.value))[1].replace(" ", ",") + "\n" + rows)
    (block,) = read_blocks(path, 1.0)
    assert block.points[0] == pytest.approx((1, 1, 1))
