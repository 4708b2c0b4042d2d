"""Mines with heights through `python -m pipeline new`: the generated cases of docs/levels.md, and Wheal Pell."""

import json
import sys

import numpy as np
import pytest

from minexplore.floor import Floor
from pipeline.store.codecs import decode
from pipeline.survey.sheet_cells import floor_of
from pipeline.survey.solved.read import read_passages
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
