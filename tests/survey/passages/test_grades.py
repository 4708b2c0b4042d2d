"""Grades of the legs of a station table: elevations, loops, refusals, and their ways in."""

import argparse
from pathlib import Path

import numpy as np
import pytest
import yaml
from pydantic import TypeAdapter

from pipeline.commands.arguments import grade
from pipeline.errors import InputError, ParamsError
from pipeline.import_mine import survey_yaml
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import PassageSurveyParams, SurveyParams
from pipeline.survey.detect import detect_survey
from pipeline.survey.scaled import plan_of_stations
from pipeline.survey.solved.station_table import read_station_legs, read_stations
from pipeline.survey.vector_survey import read_vector_survey
from pipeline.types import DrawnPlan
from tests.composed import compose
from tests.project import ROOT

HEADER = "leg,station,easting_m,northing_m,left_m,right_m"
# A loop of 200 m in three legs, and a dead end of 30 m.
LOOP = {
    "A": [("a", 0, 0), ("b", 30, 0), ("c", 60, 0)],
    "B": [("c", 60, 0), ("d", 60, 40)],
    "C": [("d", 60, 40), ("e", 0, 40), ("a", 0, 0)],
    "D": [("b", 30, 0), ("f", 30, -30)],
}
EMBEDDED = ROOT / "data/chilean_mine/stations.csv"


def write(tmp_path, legs=LOOP, column="", value=lambda leg, station: ""):
    rows = [
        f"{leg},{name},{x},{y},2,2" + (f",{value(leg, name)}" if column else "")
        for leg, stations in legs.items()
        for name, x, y in stations
    ]
    path = tmp_path / "s.csv"
    path.write_text("\n".join([HEADER + (f",{column}" if column else ""), *rows]) + "\n")
    return path


def elevations(legs):
    return {name: z for leg in legs for name, z in zip(leg.stations, leg.heights_m[:, 0], strict=True)}


def section(path, **values):
    """Return the section of a station table at any place."""
    params = PassageSurveyParams(kind="passages", name="graded", file="data/s.csv", **values)
    return params.model_copy(update={"file": path.as_posix()})


def test_grades_of_legs_give_stations_elevations_from_the_first_one_on(tmp_path, capsys):
    found = elevations(read_station_legs(write(tmp_path), {"A": 0.02, "B": 0.01, "C": -0.016, "D": -0.1}))
    assert found == pytest.approx({"a": 0.0, "b": 0.6, "c": 1.2, "d": 1.6, "e": 0.64, "f": -2.4})
    assert "misses" not in capsys.readouterr().err


def test_a_misclosure_is_distributed_and_the_warning_names_its_leg(tmp_path, capsys):
    found = elevations(read_station_legs(write(tmp_path), {"A": 0.02, "B": 0.01, "C": -0.011}))
    assert found == pytest.approx({"a": 0.0, "b": 0.525, "c": 1.05, "d": 1.35, "e": 0.54, "f": 0.525})
    told = capsys.readouterr().err
    assert "s.csv: the loop of grades through leg " in told
    assert "misses by 0.50 m" in told
    assert "changes grades by up to 0.00250" in told


def test_a_column_of_the_table_has_grades_too(tmp_path):
    def of_table(leg, station):
        return {"a": "0.02", "b": "-0.01", "c": ""}[station] if leg == "A" else "-"

    path = write(tmp_path, column="rise_over_run", value=of_table)
    found = elevations(read_station_legs(path, {"D": 0.1}))
    ends = {"a": 0.0, "b": 0.6, "c": 0.3, "d": 0.3 * 100 / 140, "e": 0.3 * 40 / 140, "f": 3.6}
    assert found == pytest.approx(ends, abs=1e-6)
    with pytest.raises(InputError, match="leg A has grades in the column rise_over_run; a second one is stated"):
        read_station_legs(path, {"A": 0.1})


def test_a_column_without_a_grade_leaves_a_survey_flat(tmp_path):
    legs = read_stations(write(tmp_path, column="rise_over_run"))
    assert all(leg.heights_m is None for leg in legs)


@pytest.mark.parametrize(
    ("grades", "message"),
    [
        ({"X": 0.1}, r"s\.csv: a grade of leg X, which it does not have; there are A, B, C, D"),
        (
            {"B": 0.4},
            r"leg B, c to d at \(60\.0, 0\.0\): a grade of 0\.4 is steeper than 0\.364 \(survey\.steepest_grade\)",
        ),
        (
            {"A": 0.02, "B": 0.01, "C": -0.004},
            r"the loop of grades through leg ., . to . at .*, misses by 1\.20 m; closing it changes a grade by "
            r"0\.00600, at most 0\.005 \(survey\.grade_change\)",
        ),
        ({"A": 0.3, "C": 0.3}, r"leg B, c to d at \(60\.0, 0\.0\): a grade of -1\.2 is steeper than 0\.364"),
    ],
)
def test_grades_that_cannot_be_used_are_refused_with_their_leg(tmp_path, grades, message):
    with pytest.raises(InputError, match=message):
        read_station_legs(write(tmp_path), grades)


def test_grades_beside_elevations_are_refused(tmp_path):
    path = write(tmp_path, column="elevation_m", value=lambda leg, station: "5")
    for read in (read_stations, read_station_legs):
        with pytest.raises(InputError, match=r"has elevations .*, and grades are stated; give one of them"):
            read(path, {"A": 0.1})


def test_legs_with_grades_must_be_connected(tmp_path):
    path = write(tmp_path, LOOP | {"E": [("x", 0, 100), ("y", 50, 100)]})
    with pytest.raises(InputError, match="legs E share no station with leg A"):
        read_station_legs(path, {"A": 0.1})


def test_small_grades_make_a_world_with_heights(tmp_path):
    path = write(tmp_path)
    assert isinstance(read_vector_survey(section(path)).shape, DrawnPlan)
    legs = read_vector_survey(section(path, grade={"A": 0.005})).shape
    assert legs.positions_m[:, 2].max() == pytest.approx(0.3)


def test_the_embedded_survey_with_grades_keeps_its_drawing():
    flat, graded = compose([]).survey, compose(["survey=graded"]).survey
    coarse = {"px_per_m": 2.0}  # of the drawing; the embedded one takes 4 s
    one, other = (plan_of_stations(params.model_copy(update=coarse)) for params in (flat, graded))
    assert (one.plan == other.plan).all()
    assert one.heights is None
    assert len(other.heights.lines) == 32
    for leg, line in zip(read_stations(EMBEDDED), map(np.array, other.heights.lines), strict=True):
        run = np.linalg.norm(np.diff(leg.positions_m, axis=0), axis=1).sum()
        assert (line[-1, 2] - line[0, 2]) / run == pytest.approx(graded.grade[leg.name], abs=1e-4)


def test_workings_that_grades_put_over_each_other_are_no_drawn_plan(tmp_path):
    # A ramp down and back beside itself: the walls of both ways overlap in plan, 6 m over each other.
    ramp = {"A": [("a", 0, 0), ("b", 60, 0)], "B": [("b", 60, 0), ("c", 60, 3.5)], "C": [("c", 60, 3.5), ("d", 0, 3.5)]}
    path = write(tmp_path, ramp)
    params = compose([]).survey.model_copy(update={"stations": path.as_posix(), "grade": {"A": -0.1, "C": -0.1}})
    with pytest.raises(InputError, match=r"b to c passes over|passes over .* survey\.kind=passages builds"):
        plan_of_stations(params)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["+survey.grade={L00:steep}"], "survey.grade.L00 = 'steep': want a number"),
        (["+survey.grade=0.5"], "survey.grade = 0.5: want at most 0.36"),
        (["+survey.grade={}"], "survey.grade: want 1 or more, got 0"),
        (["survey=procedural", "+survey.grade={A:0.1}"], "survey: grade: a grade for each leg needs a station table"),
    ],
)
def test_wrong_grades_in_a_section_are_one_line(overrides, message):
    with pytest.raises(ParamsError) as error:
        compose(overrides)
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


def test_the_option_takes_one_grade_or_one_a_leg():
    assert grade("-0.02") == -0.02
    assert grade("A=0.02, L=1=-0.01") == {"A": 0.02, "L=1": -0.01}
    for wrong in ("=0.1", "A=0.1,A=0.2", "A=nan", "A=0.1,0.2"):
        with pytest.raises(argparse.ArgumentTypeError):
            grade(wrong)


def test_a_section_with_grades_is_written_so_that_it_reads_back(tmp_path):
    legs = {{"A": "1", "B": "no", "C": "L: #3", "D": "D"}[name]: stations for name, stations in LOOP.items()}
    path, grades = write(tmp_path, legs), {"1": 0.02, "no": 0.01, "L: #3": -0.016, "D": -0.1}
    detected = detect_survey(path, StatedOptions(grade=grades))
    assert detected.has_heights
    text = survey_yaml("graded", Path("data/mines/graded/s.csv"), detected, StatedOptions())
    assert TypeAdapter(SurveyParams).validate_python(yaml.safe_load(text)["survey"]).grade == grades


@pytest.mark.parametrize("name", ["plan.png", "cave.svx", "drifts.dxf"])
def test_grades_of_legs_need_a_table_whose_legs_have_names(tmp_path, name):
    (tmp_path / name).write_bytes(b"x")
    with pytest.raises(InputError, match=rf"{name}: --grade: a grade for each leg needs a station table"):
        detect_survey(tmp_path / name, StatedOptions(grade={"A": 0.1}))
