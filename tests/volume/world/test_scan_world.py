"""Worlds of scans: certified, and measured against the scan's points."""

import json

import numpy as np
import pytest
from scipy.spatial import cKDTree

from minexplore.bundle import TOPOLOGY
from pipeline.params.survey import CloudSurveyParams
from pipeline.survey.load import read_unlimited
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.proof.certificate import validate_volume
from pipeline.volume.world.proof.scan import measure_scan
from tests.survey.clouds.test_cloud_files import write_timed
from tests.survey.clouds.test_cloud_volume import noisy, sampled
from tests.volume.world.test_solid_world import broken, crossing
from tests.volume_worlds import VolumeWorld, proof

pytestmark = pytest.mark.slow
WAY = [*((x, 2.0) for x in range(1, 40)), *((20.0, y) for y in range(-19, 24))]  # of the scanner, a metre a second


def times_along(points):
    """Return the times at which the scanner is nearest to points (n, 3)."""
    return cKDTree(np.array(WAY)).query(points[:, :2])[1].astype(float)


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scan")
    points = noisy(sampled(crossing(), 100))
    path, way = write_timed(folder / "a.laz", points, times_along(points)), folder / "way.txt"
    way.write_text("".join(f"{k} {x} {y} 1.3\n" for k, (x, y) in enumerate(WAY)))
    params = CloudSurveyParams(kind="cloud", name="test", file="data/x", heights=None)
    update = {"file": path.as_posix(), "trajectory": way.as_posix()}
    return VolumeWorld(read_unlimited(params.model_copy(update=update)), folder)


@pytest.fixture(scope="module")
def found(world):
    return validate_volume(proof(robot_contacts=300, ball_contacts=300), world.opened(), world.shape)


def test_the_world_of_a_scan_is_certified(found):
    assert broken(found) == set()
    assert found.certificate.contacts >= 300


def test_nearly_all_points_are_near_the_surface_and_all_of_it_was_seen(found):
    scan = found.metrics["scan"]
    assert scan["within_5cm"] >= 0.95
    assert scan["within_10cm"] >= 0.99
    assert abs(scan["mean_mm"]) <= 10
    assert scan["seen_share"] >= 0.99


def test_the_world_has_the_ranges_of_the_scan_where_its_scanner_was(found):
    rays = found.metrics["rays"]
    assert rays["rays"] >= 10_000
    assert rays["within_5cm"] >= 0.9  # noise of 2 cm in all directions is 4 cm along a ray at 60 degrees to the normal
    assert rays["within_10cm"] >= 0.97
    assert rays["through_share"] + rays["short_share"] <= 0.002
    assert abs(rays["median_mm"]) <= 10


def test_the_sign_of_the_deviation_is_positive_in_the_rock(world):
    under = world.shape.scan_m[world.shape.scan_m[:, 2] < world.shape.scan_m[:, 2].min() + 0.1] - [0, 0, 1.0]
    moved = measure_scan(closed_volume(world.opened().mine), under, np.random.default_rng(0))
    assert moved.figures["mean_mm"] == pytest.approx(1000, abs=100)
    assert moved.figures["seen_share"] == 0


def test_legs_are_those_of_the_crossing(world):
    network = json.loads((world.bundle / TOPOLOGY).read_bytes())
    assert (len(network["dead_ends"]), network["loops"], network["components"]) == (4, 0, 1)
