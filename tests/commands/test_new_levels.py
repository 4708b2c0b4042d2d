"""Mines with heights through `python -m pipeline new`: the cases of docs/evidence/parts/cases.md."""

import json
import sys

import numpy as np
import pytest
import yaml

from benchmarks.pictures.case_figures import case_figures
from minexplore.floors.floor import Floor
from pipeline.geometry.polyline import arc_length
from pipeline.report.figures.levels import leg_grades
from pipeline.store.codecs import decode
from pipeline.survey.stations.table import read_stations
from pipeline.types import DriftNetwork, Survey
from tests.heights import UNDER, levels, seam, shelves, spiral, table
from tests.project import ROOT, Project

pytestmark = pytest.mark.slow
CASES = {  # legs, loops, shafts
    "spiral": (spiral(3), 0, 0),
    "levels": (levels(), 3, 1),
    "seam": (seam(), 9, 0),
    "under": (UNDER, 0, 0),
    "shelves": (shelves(), 0, 0),
}
STATION_M, GRADE_DEG = 0.02, 0.2
END_M = 4.0  # between the ends of a surveyed leg and of the traced one


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    folder = tmp_path_factory.mktemp("levels") / "mine"
    folder.mkdir()
    return Project(folder, tiny=False)


def built(project, name, source, half_width_m=None):
    """Run `new`; return what it said, and the figures of its world, whose floor must be the survey's."""
    options = [] if half_width_m is None else ["--half-width", str(half_width_m)]
    done = project.run(sys.executable, "-m", "pipeline", "new", name, "--from", source, *options, COLUMNS="1000")
    assert done.returncode == 0, done.stderr
    figures = case_figures(project.folder / "artifacts/worlds" / name, project.folder / source, half_width_m)
    assert figures.certificate
    assert figures.z_m < STATION_M
    assert figures.grade_deg < GRADE_DEG
    assert figures.pieces_built == 1
    return " ".join(done.stderr.split()), figures  # the table with one line a remark


@pytest.mark.parametrize("name", CASES)
def test_a_generated_mine_with_heights_comes_out_whole_without_an_option(name, project):
    legs, loops, shafts = CASES[name]
    (project.folder / f"{name}.csv").write_text(table(legs))
    _, figures = built(project, f"case-{name}", f"{name}.csv")
    assert (figures.built, figures.left_out_m) == (figures.stations, 0)
    assert (figures.loops_surveyed, figures.loops_built, figures.shafts) == (loops, loops, shafts)


def test_wheal_pell_becomes_a_world_and_what_is_left_out_is_listed(project):
    told, figures = built(project, "pell", "data/wheal_pell/pell.3d")
    for text in (
        "in 2 pieces that share no station, the longest 1219 m about pell.2024-04-14.30, 678 m about",
        "3 shafts are not drivable",
        "36 legs are steeper than",
        "kept is the one of 509 m about pell.2025-04-27.10",
        "survey.half_width_m",
        "217 of 268 stations have no measured roof; 1.45 m over the floor is taken",
        "the shaft from pell.2025-04-27.10 to pell.2025-04-27.9 at (8.8, 422.1) is left out: 1 m wide, it has no 0.9 m",
    ):
        assert text in told
    assert (figures.stations, figures.built, figures.left_out_m) == (60, 60, 0)
    assert (figures.loops_surveyed, figures.loops_built, figures.shafts) == (0, 0, 0)
    assert figures.roof_m == (1.5, 1.5)


@pytest.mark.parametrize(
    ("station", "length_m", "raises_m", "leaning"),
    [
        ("pell.2023-11-25.17", 49, [26.0, 38.5], 0),
        ("pell.2025-06-08.15", 211, [24.1, 2.9], 1),
        ("pell.2025-08-30.28", 166, [9.1, 21.1], 1),
    ],
)
def test_a_chosen_piece_of_wheal_pell_is_built_with_its_raises(station, length_m, raises_m, leaning, project):
    name = f"pell-{length_m}"
    source = ("--from", "data/wheal_pell/pell.3d", "--piece", station)
    done = project.run(sys.executable, "-m", "pipeline", "new", name, *source, "preset=light", COLUMNS="1000")
    assert done.returncode == 0, done.stderr
    assert f"kept is the one of {length_m} m about" in done.stderr
    root = project.folder / "artifacts/worlds" / name
    assert json.loads((root / "validation/certificate.json").read_text())["holds"]
    openings = json.loads((root / "realism/world/world.json").read_text())["openings"]
    assert [opening["sheet"] for opening in openings] == [None] * len(raises_m)
    assert [opening["top_m"] - opening["bottom_m"] for opening in openings] == pytest.approx(raises_m, abs=0.1)
    assert sum("bends_m" in opening for opening in openings) == leaning


def test_a_station_that_no_survey_has_is_refused_and_leaves_nothing(project):
    source = ("--from", "data/wheal_pell/pell.3d", "--piece", "pell.2023-11-25.99")
    done = project.run(sys.executable, "-m", "pipeline", "new", "pell-none", *source)
    assert done.returncode == 2
    last = done.stderr.splitlines()[-1]
    assert (
        "pell.3d: survey.piece = 'pell.2023-11-25.99': no station has this name; names like it are pell.2023-11-25.9"
        in last
    )
    assert not (project.folder / "artifacts/worlds/pell-none").exists()
    assert not (project.folder / "conf/survey/pell-none.yaml").exists()


def test_sakany_becomes_a_world_with_the_loops_of_its_drivable_part(project):
    told, figures = built(project, "sakany", "data/sakany/Sakany_nodes.dat", 1.0)
    assert "2 shots, 10 m, lie less than 4 m over or under others that they do not meet" in told
    assert (figures.stations, figures.built) == (60, 58)  # the two left out are dead ends
    assert 10 < figures.left_out_m < 11
    assert (figures.loops_surveyed, figures.loops_built) == (2, 2)
    assert figures.sheets == 2


def ends_of(places):
    return np.array([places[0], places[-1]])


def test_the_embedded_mine_with_a_grade_for_each_leg_holds_its_certificate(project):
    for stage in ("survey", "contours", "compile3d", "surface", "realism", "validation"):
        done = project.stage(stage, "survey=graded")
        assert done.returncode == 0, done.stderr
    root = project.folder / "artifacts"
    assert json.loads((root / "validation/certificate.json").read_text())["holds"]
    survey = decode(root / "survey/survey.json", Survey)
    network = decode(root / "contours/topology.json", DriftNetwork)
    floor = decode(root / "compile3d/floor.npz", Floor)
    stated = yaml.safe_load((ROOT / "conf/survey/graded.yaml").read_text())["survey"]["grade"]
    reported = leg_grades(network, floor, survey.heights.datum_m)
    found = 0
    for leg in read_stations(ROOT / "data/chilean_mine/stations.csv"):
        want = np.degrees(np.arctan(stated[leg.name]))
        here = np.flatnonzero(floor.covers(leg.positions_m))  # the end of one is narrower than the plan's pixels
        run = arc_length(leg.positions_m)[here]
        rise = floor.heights_at(leg.positions_m[here])
        assert np.degrees(np.arctan2(rise[-1] - rise[0], run[-1] - run[0])) == pytest.approx(want, abs=GRADE_DEG)
        for way, row in zip(network.legs, reported, strict=True):
            for ends, sign in ((ends_of(way.stations_m), 1), (ends_of(way.stations_m)[::-1], -1)):
                if np.abs(ends - ends_of(leg.positions_m)).max() < END_M:
                    assert np.degrees(np.arctan(sign * row.mean)) == pytest.approx(want, abs=GRADE_DEG)
                    found += 1
    assert found >= 28  # of 32: the network has no dead end of 6 m, and joins what it parts, and one end is too narrow
