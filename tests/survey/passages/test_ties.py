"""Repeated legs tie passages, equated stations are one, and a leg that was read twice keeps its passage."""

import numpy as np
import pytest

from minesurveys.solved_surveys import solve_file
from minesurveys.survex.survex_text import flagged_together
from pipeline.params.survey import PassageSurveyParams
from pipeline.survey.passages.legs import legs_of
from pipeline.survey.passages.relief import has_relief
from pipeline.survey.whole_survey import built_piece, footprint, read_whole
from pipeline.types import lines_of
from tests.project import ROOT
from tests.solved import needs_cavern, write

pytestmark = needs_cavern
GIVEN = ROOT.parent / "shared/data/turn4"
PARAMS = PassageSurveyParams(kind="passages", name="a", file="data/x")
SHOTS = "*data normal from to tape compass clino\n"
MAIN = f"{SHOTS}1 2 30 090 -5\n2 3 30 090 -5\n"
WALLS = "*data passage station left right up down\n"
SIDE = (
    f"{SHOTS}b c 40 000 0\nc d 40 000 -5\n"
    f"{WALLS}1 2 2 2 1\n2 2 2 2 1\n3 2 2 2 1\n{WALLS}b 2 2 2 1\nc 2 2 2 1\nd 2 2 2 1\n"
)
DUPLICATE = "*flags duplicate\n{}*flags not duplicate\n"


def read(path, piece=None):
    survey, legs = read_whole(path, PARAMS)
    return legs, built_piece(path, survey, legs, piece)


def given(name):
    if not (GIVEN / name).is_file():
        pytest.skip("the shared inputs are not here")
    return GIVEN / name


def pairs(legs):
    return {frozenset(pair) for leg in legs for pair in zip(leg.stations, leg.stations[1:], strict=False)}


def test_a_side_passage_that_hangs_on_a_repeated_leg_belongs_to_the_piece(capsys):
    legs, piece = read(given("duplicate-tie.svx"))
    assert not len(piece.pieces_m)
    assert pairs(legs_of(piece)) == {frozenset({f"cave.{a}", f"cave.{b}"}) for a, b in ("12", "23", "bc", "cd")}
    assert piece.surveyed_m == pytest.approx(140, abs=0.02)
    assert "pieces" not in capsys.readouterr().err
    assert not has_relief(legs)


def test_a_repeated_leg_is_built_if_nothing_else_leads_to_what_hangs_on_it(tmp_path, capsys):
    beside, apart = (MAIN + DUPLICATE.format(f"1 b 31 {bearing} -5\n") + SIDE for bearing in ("089", "045"))
    path = write(tmp_path, beside)
    _, piece = read(path)
    assert frozenset("1b") not in pairs(legs_of(piece))
    assert footprint(path, legs_of(piece)).geom_type == "Polygon"
    assert "repeated" not in capsys.readouterr().err
    _, piece = read(write(tmp_path, apart))
    assert frozenset("1b") in pairs(legs_of(piece))
    assert not len(piece.pieces_m)
    assert footprint(path, legs_of(piece)).geom_type == "Polygon"
    assert "a.svx: 1 repeated legs alone lead to what hangs on them, and are built: " in capsys.readouterr().err


def test_repeated_legs_in_a_row_tie_as_one_does(tmp_path):
    text = MAIN + DUPLICATE.format("1 x 20 045 -5\nx b 20 045 -5\n") + SIDE
    _, piece = read(write(tmp_path, text))
    assert {frozenset("1x"), frozenset("xb")} <= pairs(legs_of(piece))
    assert not len(piece.pieces_m)


def test_a_leg_on_the_surface_ties_nothing(tmp_path):
    _, piece = read(write(tmp_path, MAIN + "*flags surface\n1 b 31 045 -5\n*flags not surface\n" + SIDE))
    assert len(piece.pieces_m) == 1


@pytest.mark.parametrize("between", ["", "; again\n\n"])
def test_the_passage_of_two_readings_stays_if_the_first_alone_is_flagged(tmp_path, between):
    text = SHOTS + DUPLICATE.format("1 2 30 90 0\n") + between + "1 2 31 90 0\n2 3 10 90 0\n"
    survey = solve_file(write(tmp_path, text))
    legs = survey.legs[survey.centreline()]
    steps = np.linalg.norm(np.diff(survey.positions_m[legs], axis=1)[:, 0], axis=1)
    assert sorted(steps.tolist()) == pytest.approx([10, 30.5])


@pytest.mark.parametrize(
    "lines",
    [
        ["*flags duplicate", "1 2 30 90 0", "*flags not duplicate", "2 3 31 90 0"],
        ["*flags duplicate", "1 2 30 90 0", "1 2 31 90 0"],
        ["*flags duplicate", "1 2 30 90 0", "*flags not duplicate", "2 1 31 270 0"],
        ["*flags duplicate", "1 2 30 90 0", "*end", "*flags not duplicate", "1 2 31 90 0"],
        ["1 2 30 90 0", "*flags duplicate", "1 2 31 90 0"],
    ],
)
def test_other_lines_stay_in_their_order(lines):
    assert flagged_together(lines) == lines


def test_an_entrance_is_open_whichever_of_its_names_the_legs_have():
    path = given("entrance-equated.svx")
    assert lines_of(read(path)[1].entrances) == ["mine.1"]


@pytest.mark.parametrize("piece", ["portal", "mine.1"])
def test_a_piece_is_chosen_by_any_name_of_an_equated_station(piece):
    _, built = read(given("entrance-equated.svx"), piece)
    assert pairs(legs_of(built)) == {frozenset({"mine.1", "mine.2"}), frozenset({"mine.2", "mine.3"})}
