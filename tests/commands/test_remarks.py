"""Remarks of readers: one line each, or a table of counts, facts and the options that overrule them."""

import pytest

from minesurveys.remarks import Remark, collect_remarks, hand_on, warn_user
from pipeline.commands.remark_table import remark_table
from pipeline.findings import findings_of
from pipeline.survey.detection.detected_section import Detection
from tests.project import ROOT


@pytest.mark.parametrize(
    ("remark", "line"),
    [
        (
            Remark("layers are read as one plan", "3", "--layer", "m.dxf", "--layer chooses"),
            "m.dxf: 3 layers are read as one plan; --layer chooses",
        ),
        (Remark("stations have no measured roof", "217 of 268", of="m.3d"), "m.3d: 217 of 268 stations have no measur"),
        (Remark("is taken as the unit", "ft", "--unit"), "ft is taken as the unit; --unit overrules it"),
        (
            Remark("legs are steeper than 0.364 (survey.steepest_grade)", "36", "survey.steepest_grade", "m.3d"),
            "m.3d: 36 legs are steeper than 0.364 (survey.steepest_grade)",
        ),
        (Remark("2 layers"), "2 layers"),
    ],
)
def test_a_remark_is_one_line_that_names_an_option_once(remark, line):
    assert remark.line().startswith(line)
    assert remark.line().count(remark.option) == 1 or not remark.option


def test_in_a_table_a_remark_of_another_file_names_it():
    remark = Remark("heights lie outside", "9", of="other.tif")
    assert remark.named_in("m.dxf").what == "other.tif: heights lie outside"
    assert remark.named_in("other.tif") == remark
    assert Remark("ends are closed", "2", of="compile3d").named_in("m.dxf").what == "ends are closed"


def test_remarks_are_lines_unless_they_are_collected_each_once(capsys):
    warn_user("layers", of="a.dxf", count=2)
    assert capsys.readouterr().err == "a.dxf: 2 layers\n"
    with collect_remarks() as outer:
        with collect_remarks() as inner:
            warn_user("layers", of="a.dxf", count=2)
            warn_user("layers", of="a.dxf", count=2)
        warn_user("b\x1b[31m")
    assert (inner, outer) == ([Remark("layers", "2", of="a.dxf")], [Remark("b\x1b[31m")])
    assert capsys.readouterr().err == ""


def test_of_two_readings_of_a_file_the_figures_of_the_last_are_kept():
    in_feet = [Remark("a.dxf: 4 ends are less than 1 m from another line"), Remark("a.dxf: 2 layers (x, y)")]
    in_metres = [Remark("a.dxf: 9 ends are less than 1 m from another line"), Remark("a.dxf: 2 layers (x, y)")]
    with collect_remarks() as remarks:
        warn_user("a.dxf: page 1 is read")
        hand_on(in_feet)
        hand_on(in_metres)
    assert set(remarks) == {Remark("a.dxf: page 1 is read"), *in_metres}


def test_a_remark_of_two_readings_is_printed_once(capsys):
    hand_on([Remark("a.dxf: printed once")])
    hand_on([Remark("a.dxf: printed once"), Remark("a.dxf: printed later")])
    assert capsys.readouterr().err == "a.dxf: printed once\na.dxf: printed later\n"


def test_what_is_collected_is_bounded():
    with collect_remarks() as remarks:
        for number in range(1000):
            warn_user(f"remark {number}")
    assert len(remarks) == 100


def test_the_table_wraps_its_cells_and_holds_no_control_characters():
    long = "shafts are left out, the first at (1.0, 2.0) from 9.0 to 0.0 m, which meets no level " * 3
    text = remark_table(
        "a.dxf", [Remark(long, "12", "--piece", "a.dxf"), Remark("b\x1b[31m is kept", "3", "--layer")], 90
    )
    lines = text.splitlines()
    assert lines[0] == "a.dxf: guessed, dropped or assumed"
    assert lines[1].split() == ["how", "many", "what", "overruled", "by"]
    assert max(map(len, lines)) <= 90
    assert lines[2].split()[0] == "12"
    assert lines[2].endswith("--piece")
    assert lines[-1].split() == ["3", "b", "[31m", "is", "kept", "--layer"]
    assert "\x1b" not in text


@pytest.mark.parametrize(
    ("values", "width_m", "options"),
    [
        ({"kind": "plan", "scale": {"source": "bar"}}, 5.0, {"--bar-length, --bar-box"}),
        ({"kind": "plan", "scale": {"source": "stated"}}, 0.2, {"--px-per-m", "--bar-length, --px-per-m"}),
        ({"kind": "vector", "unit": "ft"}, 5.0, {"--unit"}),
        ({"kind": "passages"}, 1.2, {"--half-width"}),
        ({"kind": "grid"}, None, set()),
    ],
)
def test_what_was_detected_is_listed_with_the_option_that_overrules_it(values, width_m, options):
    detected = Detection(values, {"scale": "of the bar"} if "scale" in values else {}, width_m=width_m)
    listed = findings_of(detected, ROOT / "conf/survey/x.yaml")
    assert {remark.option for remark in listed[1:]} == {*options, "realism.zones"}
