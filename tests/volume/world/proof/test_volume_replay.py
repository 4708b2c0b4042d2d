"""Sweeps of known ranges, replayed in a slab that rises and has visible rock."""

import json
import math

import numpy as np
import pytest
import shapely

from pipeline.commands.proofs import replay
from pipeline.geometry.raycast import RayCaster, upright_walls
from pipeline.proof.lidar.replay import find_sweeps, replay_sweeps
from pipeline.volume.world.proof.certificate import open_volume
from pipeline.volume.world.proof.swept import swept_volume
from stages.validation import replayed_evidence
from tests.survey.levels.test_drawn_levels import closed, write
from tests.volume_worlds import WITH_ROCK, survey_of_areas, with_rock

TEE = shapely.Polygon([(0, 0), (24, 0), (24, 5), (16, 5), (16, 12), (11, 12), (11, 5), (0, 5)])
MOVED = shapely.union(TEE, shapely.box(0, -0.6, 24, 0))  # its south wall is 0.6 m farther south
GRADE, SENSOR_M = 0.12, 1.0  # level rays meet the floor 8.3 m uphill
POSES = {"A": (4.0, 2.4, 0.1), "B": (20.0, 2.6, -0.2), "C": (13.4, 9.0, 1.4)}


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    """The tee, which rises to the east, with visible rock."""
    corners = [(x, y, GRADE * x) for x, y in TEE.exterior.coords[:-1]]
    path = write(tmp_path_factory.mktemp("drawn") / "a.dxf", {"a": [closed(corners)]})
    return with_rock(survey_of_areas(path), path.parent) / "rocky"


@pytest.fixture(scope="module")
def swept(bundle):
    return swept_volume(bundle, open_volume(bundle))


def known_ranges(outline, pose, bearing):
    """Return the ranges (n,) m to the plumb walls of an outline, or to the floor where that is nearer."""
    x, y, heading = pose
    walls = RayCaster(upright_walls(outline, 2.0)).fan(np.array([[x, y]]), (heading + bearing)[None], SENSOR_M)[0]
    uphill = GRADE * np.cos(heading + bearing)
    return np.minimum(walls, np.where(uphill > 0, SENSOR_M / np.maximum(uphill, 1e-9), np.inf))


def write_sweeps(folder, outline, poses=POSES):
    folder.mkdir()
    rng, bearing = np.random.default_rng(3), np.radians(np.arange(-161.0, 161.0, 0.5))
    for name, pose in poses.items():
        ranges = known_ranges(outline, pose, bearing) + rng.normal(0, 0.01, len(bearing))
        rows = [f"{k * 0.1},{b},1e-6,{r},1e-4" for k, (b, r) in enumerate(zip(bearing, ranges, strict=True))]
        (folder / f"sweep_{name}.csv").write_text("times,theta_mu,theta_var,range_mu,range_var\n" + "\n".join(rows))
    lines = [f"{n},{x},{y},{h},{GRADE * x}" for n, (x, y, h) in poses.items()]
    (folder / "poses.csv").write_text("pose_num,x_truth,y_truth,theta_truth,z_truth\n" + "\n".join(lines) + "\n")
    return folder


def replayed(swept, folder):
    return replay_sweeps(swept, folder / "poses.csv", find_sweeps(folder), WITH_ROCK.validation.replay).report


def test_ranges_from_a_scanner_over_a_rising_floor_are_those_of_its_walls_and_its_floor(swept):
    bearing = np.radians(np.arange(0.25, 360.0, 0.5))
    for pose in POSES.values():
        found = swept.ranges(swept.collision, np.array([pose[:2]]), (pose[2] + bearing)[None], SENSOR_M)[0]
        assert found == pytest.approx(known_ranges(TEE, pose, bearing), abs=1e-4)
    assert known_ranges(TEE, POSES["A"], np.array([-0.1]))[0] == pytest.approx(SENSOR_M / GRADE)  # 20 m to the wall


def test_sweeps_of_known_ranges_are_replayed_with_errors_equal_to_their_noise(swept, tmp_path):
    found = replayed(swept, write_sweeps(tmp_path / "s", TEE))
    assert found.scale == pytest.approx(1.0, abs=0.01)
    assert found.grade_deg == pytest.approx(math.degrees(math.atan(GRADE)), abs=0.5)
    assert found.world_grade_deg == pytest.approx(found.grade_deg, abs=0.1)
    for name, sweep in found.sweeps.items():
        assert sweep.collision.median_m < 0.02, name
        assert sweep.collision.within_0_25_m > 0.98
        assert sweep.collision.median_m < sweep.visible.median_m < 0.3  # rock is behind the walls, by its relief
        assert sweep.pose_m[:2] == pytest.approx(POSES[name][:2], abs=0.1)


def test_a_wall_that_is_moved_is_seen_in_every_sweep_beside_it(swept, tmp_path):
    found = replayed(swept, write_sweeps(tmp_path / "s", MOVED))
    for name in ("A", "B"):
        assert found.sweeps[name].collision.within_0_25_m < 0.8, name
        assert found.sweeps[name].collision.p90_m > 0.4


def test_nobody_stands_beyond_the_floor(swept):
    places = np.array([[4.0, 2.4], [13.0, 11.0], [4.0, 8.0], [-1.0, 2.0]])
    assert swept.floor_m(places) == pytest.approx([GRADE * 4, GRADE * 13, np.inf, np.inf], abs=1e-6)
    assert np.isinf(swept.ranges(swept.collision, places, np.zeros((4, 3)), SENSOR_M)[2:]).all()


def test_the_command_replays_a_volume_and_draws_it(bundle, tmp_path, capsys):
    sweeps = write_sweeps(tmp_path / "s", TEE)
    replay(bundle, sweeps, sweeps / "poses.csv", tmp_path / "out", [])
    assert set(json.loads(capsys.readouterr().out)["sweeps"]) == set(POSES)
    assert (tmp_path / "out/replay.png").is_file()


@pytest.mark.parametrize("is_replayed", [False, True])
def test_stage_6_replays_the_sweeps_that_are_registered_and_none_where_none_are(bundle, tmp_path, is_replayed):
    params = WITH_ROCK.validation.replay
    if is_replayed:
        folder = write_sweeps(tmp_path / "s", TEE)
        sweeps = {name: path.as_posix() for name, path in find_sweeps(folder).items()}
        params = params.model_copy(update={"poses": (folder / "poses.csv").as_posix(), "sweeps": sweeps})
    found = replayed_evidence(params, lambda: swept_volume(bundle, open_volume(bundle)))
    assert set(found) == ({"replay.json", "replay.png"} if is_replayed else set())
