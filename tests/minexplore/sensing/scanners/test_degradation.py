"""Dust, water and grazing incidence: against formulas, and what presets do to a scan."""

import dataclasses

import numpy as np
import pytest

from minexplore.sensing.params import SensorParams, sensor_params
from minexplore.sensing.scanners import LABELS, Mount, Pose3D, load_pattern, scanner_of
from minexplore.sensing.scanners.caster import Hits
from minexplore.sensing.scanners.degradation import degrade_hits, fresnel_reflectance
from minexplore.sensing.scanners.labels import DUST, NUMBERS, ROCK, WATER
from minexplore.world import load_world

COUNT = 20_000


class Mirror:
    """A caster whose rays all hit rock at 3 m, head on."""

    def cast(self, origins, directions):
        count = len(directions)
        return Hits(np.full(count, 3, np.float32), np.full(count, ROCK, np.uint8), np.ones(count, np.float32))


def degraded(range_m, cosine, params, label=ROCK, seed=0):
    hits = Hits(
        np.full(COUNT, range_m, np.float32), np.full(COUNT, label, np.uint8), np.full(COUNT, cosine, np.float32)
    )
    down = np.tile(np.array([[0.6, 0, -0.8]], np.float32), (COUNT, 1))
    pattern = load_pattern("os1-64")
    return degrade_hits(hits, np.array([0, 0, 1.0]), down, pattern, params, Mirror(), np.random.default_rng(seed))


def kept(hits):
    return np.isfinite(hits.range_m).mean()


def test_the_noise_has_the_standard_deviation_of_the_data_sheet():
    hits = degraded(10, 1, SensorParams(noise=1.0))
    assert (hits.range_m - 10).std() == pytest.approx(0.015, rel=0.03)
    assert kept(hits) == 1


@pytest.mark.parametrize(("cosine", "expected"), [(0.09, 1), (0.08, 0)])
def test_a_grazing_ray_is_lost_where_the_data_sheet_ends(cosine, expected):
    # 0.3 cos i / 0.1 (40 / 20)^2 = 1 at cos i = 0.0833
    assert kept(degraded(20, cosine, SensorParams(noise=1.0))) == expected


def test_half_of_the_rays_return_from_dust_where_it_transmits_what_the_source_says():
    params = SensorParams(dust_per_m=0.1, dust_transmittance=0.725)
    hits = degraded(-np.log(0.725) / 0.1, 1, params)
    assert (hits.label == DUST).mean() == pytest.approx(0.5 - 0.01, abs=0.02)  # some are nearer than the sensor sees
    assert (hits.range_m[hits.label == DUST] < 3.3).all()


def test_dust_of_a_ventilated_mine_hides_nothing_within_the_reach_of_the_robots_beams():
    share = {name: (degraded(10, 1, sensor_params(name)).label == DUST).mean() for name in ("typical", "dusty")}
    assert share["typical"] < 0.01
    assert share["dusty"] > 0.5


def test_dust_attenuates_by_the_law_of_beer_and_lambert():
    # A surface returns if 0.3 / 0.1 (40 / r)^2 exp(-2 a r) >= 1: with a = 0.1, up to 15.18 m.
    thick = SensorParams(dust_per_m=0.1, noise=1e-6)
    assert kept(degraded(15.1, 1, thick)) == 1
    assert kept(degraded(15.3, 1, thick)) == 0


def test_water_reflects_two_percent_head_on_and_all_at_grazing_incidence():
    found = fresnel_reflectance(np.array([1.0, 0.5, 0.0]))
    assert found[0] == pytest.approx(0.0201, abs=1e-3)
    assert found[1] == pytest.approx(0.0594, abs=2e-3)
    assert found[2] == pytest.approx(1.0)


def test_water_at_grazing_incidence_shows_a_ghost_as_far_as_the_whole_way():
    still = SensorParams(film_share=1.0)
    steep = degraded(5, 0.9, still, label=WATER)
    assert (steep.range_m == 5).all() or kept(steep) == 0
    grazing = degraded(5, 0.05, still, label=WATER)
    assert (grazing.range_m == 8).all()
    assert (grazing.label == ROCK).all()


def test_presets_lose_returns_and_add_dust_and_the_ideal_one_draws_nothing(small_world):
    world = load_world(small_world)
    pose = Pose3D(np.array([*world.record["spawn"]["anchor_m"], 0.0]), np.eye(3))
    clouds = {
        name: scanner_of("os1-64", world, Mount(), sensor_params(name)).scan(pose, np.random.default_rng(0))
        for name in ("ideal", "typical", "dusty", "wet")
    }
    dust = {name: cloud.counts().get("dust", 0) for name, cloud in clouds.items()}
    assert dust["ideal"] == dust["wet"] == 0 < dust["typical"] < dust["dusty"]
    assert min(len(clouds["typical"]), len(clouds["wet"])) < len(clouds["ideal"])
    with pytest.raises(ValueError, match="want rng"):
        scanner_of("os1-64", world, Mount(), sensor_params("typical")).scan(pose)


def test_the_same_seed_gives_the_same_cloud(small_world):
    world = load_world(small_world)
    pose = Pose3D(np.array([*world.record["spawn"]["anchor_m"], 0.0]), np.eye(3))
    scanner = scanner_of("vlp-16", world, Mount(), sensor_params("dusty"))
    one, two = (scanner.scan(pose, np.random.default_rng(7)) for _ in range(2))
    for field in dataclasses.fields(one):
        np.testing.assert_array_equal(getattr(one, field.name), getattr(two, field.name))


def test_labels_fit_a_byte_and_are_different():
    assert len(LABELS) == len(set(LABELS)) == len(NUMBERS) < 256
