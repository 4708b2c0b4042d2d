"""Mines with heights through `python -m pipeline new`: the generated cases of docs/levels.md, and Wheal Pell."""

import json
import sys

import numpy as np
import pytest
import yaml

from minexplore.floor import Floor
from pipeline.geometry.polyline import arc_length
from pipeline.report.levels import leg_grades
from pipeline.store.codecs import decode
from pipeline.survey.sheet_cells import floor_of
from pipeline.survey.solved.read import read_passages
from pipeline.survey.stations import read_stations
from pipeline.types import DriftNetwork, Survey
from tests.heights import UNDER, levels, seam, shelves, spiral, table
from tests.project import ROOT, Project

pytestmark = pytest.mark.slow
CASES = {
    "spiral": (spiral(3), 0),
    "levels": (levels(), 3),
    "seam": (seam(), 9),
    "under": (UNDER, 0),
    "shelves": (shelves(), 0),
}
STATION_M, GRADE_DEG = 0.02, 0.2
END_M = 4.0  # between the ends of a surveyed leg and of the traced one


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    folder = tmp_path_factory.mktemp("levels") / "mine"
    folder.mkdir()
    return Project(folder, tiny=False)


def built(project, name, *arguments):
    """Run `new`; return its result, and survey, network and floor of the world, whose certificate must hold."""
    done = project.run(sys.executable, "-m", "pipeline", "new", name, "--from", *arguments)
    assert done.returncode == 0, done.stderr
    world = project.folder / "artifacts/worlds" / name
    assert json.loads((world / "validation/certificate.json").read_text())["holds"]
    survey = decode(world / "survey/survey.json", Survey)
    return (
        done,
        survey,
        decode(world / "contours/topology.json", DriftNetwork),
        decode(world / "compile3d/floor.npz", Floor),
    )


def worst_of(survey, floor):
    """Return the largest differences between survey and built floor: of heights, m, and of the grades of legs, deg."""
    off, turned = [0.0], [0.0]
    for line in map(np.array, survey.heights.lines):
        heights = floor.heights_at(line[:, :2])
        off.append(np.abs(heights - line[:, 2]).max())
        run = np.hypot(*np.diff(line[:, :2], axis=0).T)
        grades = [np.degrees(np.arctan2(np.diff(z), run)) for z in (heights, line[:, 2])]
        turned.append(np.abs(grades[0] - grades[1])[run > 0.5].max(initial=0.0))
    return max(off), max(turned)


@pytest.mark.parametrize("name", CASES)
def test_a_generated_mine_with_heights_comes_out_whole_without_an_option(name, project):
    legs, loops = CASES[name]
    (project.folder / f"{name}.csv").write_text(table(legs))
    _, survey, network, floor = built(project, f"case-{name}", f"{name}.csv")
    off, turned = worst_of(survey, floor)
    assert off < STATION_M
    assert turned < GRADE_DEG
    assert (network.loops, network.components) == (loops, 1)


def test_wheal_pell_becomes_a_world_and_what_is_left_out_is_told(project):
    done, survey, _, floor = built(project, "pell", "data/wheal_pell/pell.3d")
    for told in (
        "in 2 pieces that share no station",
        "3 shafts are not drivable",
        "are steeper than",
        "survey.half_width_m",
    ):
        assert told in done.stderr
    off, turned = worst_of(survey, floor)
    assert off < STATION_M
    assert turned < GRADE_DEG
    legs, _ = read_passages(ROOT / "data/wheal_pell/pell.3d")
    places = np.concatenate([np.column_stack([leg.positions_m, floor_of(leg)]) for leg in legs])
    places -= [*survey.georeference.origin, survey.heights.datum_m]
    here = places[floor.covers(places[:, :2])]
    assert len(here) > 50
    assert np.median(np.abs(floor.heights_at(here[:, :2]) - here[:, 2])) < STATION_M


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
