"""Robots are thrown at walls all over a volume until their discs had the contacts with rock that were asked for."""

import numpy as np
import pytest

from minexplore.floors.volume_arrays import FacetLabel
from minexplore.physics.robot import RobotParams
from pipeline.proof.certificate import certify
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.proof.certificate import _robots
from pipeline.volume.world.proof.fronts import fronts_of
from pipeline.volume.world.proof.throws import Throws, run_ups, throw_robots
from tests.composed import compose
from tests.volume_worlds import HEADER, RAMP, VolumeWorld, proof

CRAWL = HEADER + "A,1,0,0,0,2,2,3,0\nA,2,5,0,0,2,2,3,0\nB,2,5,0,0,0.2,0.2,0.5,0\nB,3,30,0,0,0.2,0.2,0.5,0\n"
STEPS = 8  # of 0.1 s in a throw


@pytest.fixture(scope="module")
def ramp(tmp_path_factory):
    """Return the volume of a drift and a ramp, 60 m long, and its parts."""
    world = VolumeWorld(RAMP, tmp_path_factory.mktemp("ramp")).opened()
    volume = closed_volume(world.mine)
    return volume, fronts_of(volume, world.parts).parts


def thrown(volume, parts, contacts, seed=0, **more):
    return throw_robots(volume, parts, contacts, np.random.default_rng(seed), **more)


def test_as_many_contacts_are_asked_for_as_in_a_level_world():
    whole = compose([]).validation
    assert whole.volume.robot_contacts >= whole.certificate.contacts == 1000


def test_robots_are_thrown_until_their_discs_had_the_contacts(ramp):
    found = thrown(*ramp, 300)
    assert 300 <= found.contacts <= STEPS * found.throws
    assert found.contacts < 300 + STEPS * 12  # no throw after those that reached it
    assert found.throws >= 48
    assert (found.escapes, found.deepest_m < 0.1) == (0, True)


def test_wheels_and_floors_give_no_contacts_and_the_throws_end_without_them(ramp):
    volume, parts = ramp
    floors = [part for part in parts if volume.label[part.facets[0]] == FacetLabel.FLOOR]
    found = thrown(volume, floors, 5)
    assert found.throws == 20 * 12
    figures = {f"robots.{name}": value for name, value in _robots(found, 5).items()}
    assert (figures["robots.contacts"], figures["robots.contacts_share"]) == (0, 0)
    assert not certify("", figures, proof().applying(["robots"])).clauses["robots.contacts_share"].holds


def test_a_contact_too_few_does_not_hold():
    held = [
        certify("", {"robots.contacts_share": _robots(Throws(contacts=n, throws=12), 1000)["contacts_share"]}, limits)
        for n in (999, 1000)
        for limits in [{"robots.contacts_share": proof().limits["robots.contacts_share"]}]
    ]
    assert [one.holds for one in held] == [False, True]


def test_robots_start_all_over_the_floors_before_walls_that_they_do_not_touch_yet(ramp):
    volume, _ = ramp
    starts = run_ups(volume, np.random.default_rng(0))
    along = np.bincount((starts.places_m[:, 0] - volume.vertices[:, 0].min()).astype(int) // 5, minlength=12)
    assert along.min() > 20
    radius_m = RobotParams().radius_m
    assert volume.inside.are_farther(starts.places_m + starts.ups * (radius_m + 0.02), radius_m - 1e-3).all()
    ahead = np.column_stack([starts.towards, np.zeros(len(starts))])
    way = volume.inside.ways_m(starts.places_m + 0.3 * starts.ups, ahead)
    assert np.median(way) < radius_m + 0.6  # beside a corner the way may go on


def test_only_walls_that_are_asked_for_are_thrown_at(ramp):
    volume, _ = ramp
    east = volume.vertices[volume.faces][:, :, 0].min(axis=1) > volume.vertices[:, 0].mean() - 1
    starts = run_ups(volume, np.random.default_rng(0), east)
    assert len(starts)
    assert east[starts.facets].all()
    assert len(run_ups(volume, np.random.default_rng(0), np.zeros(len(volume.faces), bool))) == 0


def test_robots_are_thrown_where_they_fit_and_none_where_none_fits(tmp_path):
    world = VolumeWorld(CRAWL, tmp_path).opened()
    volume = closed_volume(world.mine)
    crawl = volume.vertices[volume.faces][:, :, 0].min(axis=1) > volume.vertices[:, 0].min() + 7
    parts = fronts_of(volume, world.parts).parts
    found = thrown(volume, parts, 20, targets=crawl)
    assert _robots(found, 20) == {
        "contacts": 0,
        "throws": 0,
        "escapes": 0,
        "contacts_share": 1.0,
        "deepest_m": 0.0,
    }
    assert thrown(volume, parts, 20).contacts >= 20
