"""Drawings and plans with heights through `python -m pipeline new`: one volume each, with a certificate."""

import json
import sys

import pytest

from tests.project import Project
from tests.survey.levels.test_drawn_levels import MINE, closed, write

pytestmark = pytest.mark.slow
ROOM = [(0, 0), (60, 0), (60, 5), (0, 5)]
UNDER = [(10, -20), (15, -20), (15, 40), (10, 40)]
SPOTS = "easting_m,northing_m,elevation_m\n0,2.5,100\n30,2.5,101\n60,2.5,104\n"


def flat(points):
    return closed([(x, y, 0) for x, y in points])


def drawing(name):
    """Return the layers of a drawing, those without elevations, and the options."""
    pillars = [[(x, y), (x + 6, y), (x + 6, y + 6), (x, y + 6)] for x in (8, 22, 36) for y in (8, 22)]
    rings = [[(0, 0), (50, 0), (50, 40), (0, 40)], *pillars]
    seam = [closed([(x, y, 0.1 * x - 0.04 * y) for x, y in ring]) for ring in rings]
    levels = {"upper": [flat(ROOM)], "lower": [flat(UNDER)]}
    return {
        "ramp": (MINE, (), ()),
        "levels": (levels, ("upper", "lower"), ("--elevation", "upper=100", "--elevation", "lower=80")),
        "seam": ({"seam": seam}, (), ()),
        "spots": ({"plan": [flat(ROOM)]}, ("plan",), ("--heights", "spots.csv")),
        "grade": ({"plan": [flat(ROOM)]}, ("plan",), ("--grade", "0.05")),
    }[name]


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    folder = tmp_path_factory.mktemp("areas") / "mine"
    folder.mkdir()
    (folder / "spots.csv").write_text(SPOTS)
    return Project(folder, tiny=False)


@pytest.mark.parametrize(
    ("name", "look"), [(n, "preset=light") for n in ("levels", "seam", "spots", "grade")] + [("ramp", "")]
)
def test_a_drawing_with_heights_is_one_volume_whose_floors_are_the_drawn_ones(project, name, look):
    layers, plane, options = drawing(name)
    world = f"{name}-{'light' if look else 'rock'}"
    write(project.folder / f"{name}.dxf", layers, lift_m=0 if plane else 400, flat=plane)
    words = [sys.executable, "-m", "pipeline", "new", world, "--from", f"{name}.dxf", *options, *look.split()]
    done = project.run(*words, check=False, COLUMNS="1000")
    assert done.returncode == 0, done.stderr
    metrics = json.loads((project.folder / f"artifacts/worlds/{world}/validation/metrics.json").read_text())
    assert metrics["certificate"]["holds"] == 1
    assert metrics["drawn"]["floor_mm"] < 5
    assert metrics["rock"]["shown"] == int(not look)
