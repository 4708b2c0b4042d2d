"""What `cavern` says of its adjustment: misclosures, printed lengths, stations that hang on nothing, declinations.

Put another version of `cavern` first in PATH to test it.
"""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from minesurveys.formats import solver_limits
from minesurveys.solved.survex_3d import read_3d
from minesurveys.solved_surveys import solve_file
from minesurveys.survex import cavern
from minesurveys.survex.adjustment import computed_declinations, require_printed_length, warn_of_computed
from pipeline.errors import InputError
from pipeline.params.survey import PassageSurveyParams
from pipeline.survey.vector_survey import read_vector_survey
from tests.project import ROOT
from tests.solved import needs_cavern, position_of, write

GIVEN = ROOT.parent / "shared/data/turn4"
SHOTS = "*data normal from to tape compass clino\n"
HIDDEN = "*fix a 0 0 0 1 1 1\n*fix b 100 3 0 1 1 1\n"
# As 1.4.22 and 1.4.4 print it.
HANGING = """cavern: warning: Survey not all connected to fixed stations
The following survey stations are not attached to a fixed point:
a.svx:16: info: a.1
a.svx:5: info: 3

Survey contains 11 survey stations, joined by 10 legs.
"""
REFUSED = """cavern: error: Survey not all connected to fixed stations
The following survey stations are not attached to a fixed point:
mine.lower.1
"""
UTM = "*cs UTM33N\n*cs out UTM33N\n*fix 1 400000 5000000 500\n*declination auto 400000 5000000 500\n"


def given(name: str) -> Path:
    if not (GIVEN / name).is_file():
        pytest.skip("the shared inputs are not here")
    return GIVEN / name


def length_of(survey) -> float:
    legs = survey.legs[survey.centreline()]
    return float(np.linalg.norm(np.diff(survey.positions_m[legs], axis=1)[:, 0], axis=1).sum())


def printed_length(path: Path, folder: Path) -> float:
    said = subprocess.run(["cavern", "-q", "-o", folder / "p.3d", path], check=True, capture_output=True, text=True)
    return float(re.search(r"Total length of survey legs = .*\( *([\d.]+)m adjusted", said.stdout)[1])


@needs_cavern
def test_a_traverse_between_two_fixes_with_deviations_begins_at_its_station(tmp_path):
    path = given("survex-gps-sd.svx")
    survey = solve_file(path)
    assert length_of(survey) == pytest.approx(printed_length(path, tmp_path), abs=0.02)
    assert length_of(survey) == pytest.approx(140.0, abs=0.02)
    assert position_of(survey)["gps.e2"].tolist() == [106, 0, 500]
    assert not (survey.positions_m[:, 0] == 112).any()


@needs_cavern
@pytest.mark.parametrize(
    "text",
    [
        f"{HIDDEN}*fix c 50 44 0 2 2 2\n{SHOTS}"
        "a 1 50 90 0\n1 b 50 90 0\n1 c 40 0 0\nb x 30 0 0\nb y 30 90 0\na z 10 270 0\n",
        f"{HIDDEN}{SHOTS}a b 99 90 0\nb x 30 0 0\n",
        f"{HIDDEN}*equate b c\n*equate c d\n*equate a q\n{SHOTS}q b 99 90 0\nd x 30 0 0\n",
        f"*fix a 0 0 0 1 1 1\n{SHOTS}a b 99 90 0\nb x 30 0 0\n",
        f"{HIDDEN}{SHOTS}a 1 50 90 0\n1 b 50 90 0\n1 2 20 0 0\n2 3 20 90 0\n3 1 28 225 0\n",
    ],
)
def test_the_length_of_the_legs_is_the_one_that_cavern_prints(tmp_path, text):
    path = write(tmp_path, text)
    survey = solve_file(path)
    assert length_of(survey) == pytest.approx(printed_length(path, tmp_path), abs=0.05)
    (tmp_path / "copy.3d").write_bytes((tmp_path / "p.3d").read_bytes())
    assert length_of(solve_file(tmp_path / "copy.3d")) == pytest.approx(length_of(survey), abs=0.001)


@needs_cavern
def test_a_result_of_another_length_than_cavern_prints_is_refused(tmp_path):
    path = given("typo-loop.svx")
    subprocess.run(["cavern", "-qs", "-o", tmp_path / "a.3d", path], check=True, capture_output=True)
    survey = read_3d(tmp_path / "a.3d")
    line = "Total length of survey legs =  240.00m ( {:.2f}m adjusted)"
    require_printed_length(path, line.format(242.34), survey)
    with pytest.raises(InputError, match=r"Survex prints 236\.34 m of legs, and its result has 242\.34 m"):
        require_printed_length(path, line.format(236.34), survey)


@needs_cavern
def test_a_loop_with_a_typing_error_is_listed_with_its_misclosure(capsys):
    solve_file(given("typo-loop.svx"))
    assert (
        "typo-loop.svx: the loop level.1 - level.2 - level.3 - level.4 - level.1 misses by 20.00 m in 180.0 m "
        "(11.1 %), 18 times what its readings allow: look for a wrong one" in capsys.readouterr().err
    )


@needs_cavern
@pytest.mark.parametrize(
    ("text", "remark"),
    [
        (
            f"*fix 1 0 0 0\n*fix 3 60 18 0\n{SHOTS}1 2 30 90 0\n2 3 30 90 0\n",
            "the traverse 1 - 2 - 3 misses by 18.00 m in 60.0",
        ),
        (
            f"{SHOTS}1 2 30 90 0\n2 3 30 90 0\n*flags splay\n1 s 5 0 0\n2 s 5 0 0\n",
            "the loop 1 - 2 - s - 1 misses by 30.00 m",
        ),
        (
            f"{SHOTS}1 2 30 90 0\n2 3 30 0 0\n3 1 42.5 225 0\n",
            "the loop 1 - 2 - 3 - 1 misses by 0.07 m in 102.5 m (0.1 %)\n",
        ),
    ],
)
def test_what_does_not_close_is_listed(tmp_path, capsys, text, remark):
    solve_file(write(tmp_path, text))
    said = capsys.readouterr().err
    names = re.sub(r"(?<=traverse )3 - 2 - 1", "1 - 2 - 3", said)  # in either direction
    assert remark in names


@needs_cavern
def test_a_loop_of_the_user_s_own_names_is_listed_with_them(tmp_path, capsys):
    (tmp_path / "m.th").write_text(
        "survey m\ncentreline\ndata normal from to length compass clino\n"
        "P1' b 30 90 0\nb c 30 0 0\nc P1' 49 225 0\nendcentreline\nendsurvey\n"
    )
    solve_file(tmp_path / "m.th")
    assert "the loop m.P1' - m.b - m.c - m.P1' misses by" in capsys.readouterr().err


@needs_cavern
def test_a_survey_without_loops_lists_no_misclosure(tmp_path, capsys):
    solve_file(write(tmp_path, f"{SHOTS}1 2 30 90 0\n2 3 30 0 0\n"))
    assert capsys.readouterr().err == ""


def test_a_station_of_each_piece_that_hangs_on_nothing_is_found_in_the_words_of_both_versions():
    assert cavern.hanging_stations(HANGING) == ["a.1", "3"]
    assert cavern.hanging_stations(REFUSED) == ["mine.lower.1"]
    assert cavern.hanging_stations("Survey contains 11 survey stations\n") == []


@needs_cavern
@pytest.mark.parametrize("tie", ["*equate mine.lower.1 mine.upper.3\n", "*fix mine.lower.1 120 0 100\n"])
def test_an_untied_survey_is_refused_with_its_station_and_the_advice_works(tmp_path, capsys, tie):
    text = given("survex-floating.svx").read_text()
    path = write(tmp_path, text)
    if cavern._version(cavern._run(["cavern", "--version"])[1]) < (1, 4, 10):
        with pytest.raises(
            InputError, match=r"a\.svx: mine\.lower\.1: no leg and no equate leads from there to a fixed"
        ):
            solve_file(path)
    else:
        assert length_of(solve_file(path)) == pytest.approx(120, abs=0.02)
        assert "left out: that of mine.lower.1" in capsys.readouterr().err
    assert length_of(solve_file(write(tmp_path, text + tie))) == pytest.approx(200, abs=0.02)


@needs_cavern
def test_a_computed_declination_is_listed_with_its_model_its_dates_and_its_values(tmp_path, capsys):
    text = f"{UTM}{SHOTS}*date 2001.05.03\n1 2 1000 0 0\n*date 2012.05.03\n2 3 1000 0 0\n"
    solve_file(write(tmp_path, text))
    said = capsys.readouterr().err
    assert re.search(r"declinations are computed by IGRF-1\d of Survex 1\.4\.\d+: \d\.\d deg on 2001-05-03", said)
    assert "--declination overrules it" in said
    assert "after the last year" not in said


def test_dates_after_the_last_year_of_the_model_are_listed(capsys):
    output = "a.svx:5: info: Declination: 4.7° @ 2026-05-03, grid convergence: -0.9°\n *declination auto 1 2 3\n"
    found = computed_declinations(output)
    warn_of_computed(Path("a.svx"), (1, 4, 4), found)
    said = capsys.readouterr().err
    assert "computed by IGRF-13 of Survex 1.4.4: 4.7 deg on 2026-05-03; --declination overrules it" in said
    assert "1 dates are after the last year of IGRF-13, 2025" in said
    warn_of_computed(Path("b.svx"), (1, 4, 24), found)
    said = capsys.readouterr().err
    assert "IGRF-14" in said
    assert "after the last year" not in said


@needs_cavern
@pytest.mark.parametrize("is_included", [False, True])
def test_a_stated_declination_takes_the_place_of_computed_ones(tmp_path, is_included):
    shots = f"*date 2012.05.03\n{SHOTS}1 2 1000 0 0\n"
    head, _, auto = UTM.partition("*declination")
    text = f"{head}*declination{auto}{shots}"
    if is_included:
        (tmp_path / "below").mkdir()
        (tmp_path / "below/b.svx").write_text(f"  *Declination{auto}{shots}")
        text = f"{head}*include below/b\n"
    path = write(tmp_path, text)
    before = path.read_text()
    at = position_of(solve_file(path, 10.0))
    bearing = np.degrees(np.arctan2(*(at["2"] - at["1"])[:2]))
    assert bearing == pytest.approx(10.0 + 0.9018, abs=0.002)  # the convergence is that of Therion's log
    assert path.read_text() == before


@needs_cavern
def test_a_stated_declination_that_replaces_none_is_listed(tmp_path, capsys):
    solve_file(write(tmp_path, f"{SHOTS}1 2 10 0 0\n"), 10.0)
    assert "--declination changes nothing: no declination is computed" in capsys.readouterr().err


@needs_cavern
def test_legs_that_cross_because_a_loop_does_not_close_are_refused_with_the_loop(tmp_path):
    shots = "1 2 40 90 0\n2 3 40 0 0\n3 4 40 90 0\n4 1 40 180 0\n1 5 40 0 0\n"  # 3 to 4 is to 270
    walls = "*data passage station left right up down\n" + "".join(f"{k} 2 2 2 1\n" for k in (1, 2, 3, 4, 1))
    path = write(tmp_path, f"{SHOTS}{shots}{walls}")
    params = PassageSurveyParams(kind="passages", name="a", file="data/x").model_copy(update={"file": str(path)})
    with pytest.raises(InputError) as error:
        read_vector_survey(params)
    said = r"a\.svx: .* crosses .* at \(.*\) without a station; the loop 1 - 2 - 3 - 4 - 1 misses by 80\.00 m"
    assert re.search(said, str(error.value))
    right = write(tmp_path, f"{SHOTS}{shots}{walls}".replace("3 4 40 90", "3 4 40 270"))
    assert read_vector_survey(params.model_copy(update={"file": str(right)})).workings.area > 0


def test_a_survey_that_survex_solves_has_the_time_that_its_network_needs():
    limits = solver_limits(Path("a.svx"))
    assert limits["extra_s"] >= 1180  # a grid of 60 x 60 junctions, on one core of 2026
    assert limits["scratch_bytes"] > 0
    assert solver_limits(Path("a.csv")) == {}


RING = """*begin s
*fix 1 0 0 0
*entrance {entrance}
{shots}1 2 10 90 0
2 3 10 0 0
*begin t
1 2 10 270 0
2 3 10 180 0
*end t
*equate 3 t.1
*equate 1 {end}
*end s
"""


@needs_cavern
def test_names_of_no_leg_are_listed_as_the_loop_that_they_should_tie_stays_open(tmp_path, capsys):
    solve_file(write(tmp_path, RING.format(shots=SHOTS, entrance="1", end="t.3")))
    assert "of no station" not in capsys.readouterr().err
    solve_file(write(tmp_path, RING.format(shots=SHOTS, entrance="11", end="t.30")))
    said = capsys.readouterr().err
    assert "a.svx: 2 names in equates, entrances or exports are of no station of a leg, and tie or open nothing" in said
    assert re.search(r"the first is a\.svx:(3: Station .s\.11. |13: Station .s\.t\.30. )", said)


@needs_cavern
def test_a_name_of_no_leg_is_listed_where_survex_is_silent(tmp_path, capsys):
    """Survex warns of no equate that names a station of its own survey."""
    solve_file(write(tmp_path, "*fix 9 0 0 0\n1 2 10 90 0\n2 3 10 0 0\n*equate 1 9\n*equate 3 33\n"))
    said = capsys.readouterr().err
    assert "a.svx: 1 names in equates, entrances or exports are of no station of a leg" in said
    assert "the first is 33" in said


@needs_cavern
def test_a_piece_that_hangs_on_a_mistyped_equate_is_refused_with_its_line(tmp_path):
    text = RING.format(shots=SHOTS, entrance="1", end="t.3").replace("*equate 3 t.1\n*equate 1 t.3", "*equate s.3 t.1")
    with pytest.raises(InputError, match=r"a\.svx: s\.t\.\d: no leg .*; a\.svx:11: Station .s\.s\.3. "):
        solve_file(write(tmp_path, text))
