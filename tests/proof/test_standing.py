"""Robots on the floor of a spiral ramp: they rest, climb, and have one floor zone at one place of the mine."""

import math

import mujoco
import numpy as np
import pytest

from minexplore.envs.robot_batch import RobotBatch
from minexplore.floors.floor import Floor
from minexplore.floors.floor_zones import zoned_box
from minexplore.physics import local_models
from minexplore.physics.local_models import LocalModels, physics_spec
from minexplore.physics.robot import FLOOR_BIT, RobotParams, stand_on_facets
from minexplore.task import TaskParams
from minexplore.world import load_world
from pipeline.mjcf.bundle import open_bundle
from pipeline.proof.certificate import certify
from pipeline.proof.standing import STEEPEST, measure_standing, turned_m
from tests.composed import compose
from tests.heights import spiral
from tests.mines import BuiltMine

LIMITS = ("rest_drift_m", "climb_share")


@pytest.fixture(scope="module")
def heights():
    return compose(["preset=light", "+mine=heights"])


@pytest.fixture(scope="module")
def ramp(mine_of_legs):
    return mine_of_legs(spiral(2, 20.0, 0.12), "preset=light", "+mine=heights")


def judged(mine, heights):
    limits = {name: heights.validation.certificate.limits[name] for name in LIMITS}
    return certify("", vars(measure_standing(mine.bundle, 9)), limits)


@pytest.mark.slow
def test_robots_rest_and_climb_on_a_spiral_ramp(ramp, heights):
    certificate = judged(ramp, heights)
    assert certificate.holds, certificate.clauses


@pytest.mark.slow
def test_with_rigid_castors_robots_slide_down_a_spiral_ramp_and_both_clauses_fail(ramp, heights, monkeypatch):
    monkeypatch.setattr(local_models, "stand_on_facets", lambda spec, name: None)
    assert not any(clause.holds for clause in judged(ramp, heights).clauses.values())


def test_castors_are_sprung_on_floors_with_heights_and_rigid_on_level_ones(ramp, tee: BuiltMine):
    level, heights = (
        LocalModels(load_world(mine.bundle), TaskParams(), RobotParams()).model((0, 0)) for mine in (tee, ramp)
    )
    assert (level.nq, level.opt.impratio) == (9, 1.0)
    assert (heights.nq, heights.opt.impratio) == (11, 10.0)


def test_turns_of_a_spiral_over_each_other_have_one_floor_zone(ramp):
    world, robot = load_world(ramp.bundle), RobotParams()
    batch = RobotBatch(world, TaskParams(), robot, 2)
    angles, pairs = np.linspace(0.3, 6.0, 12), 0
    for x, y in 20 * np.column_stack([np.cos(angles), np.sin(angles)]):
        column = np.column_stack(
            [np.full(400, x), np.full(400, y), np.linspace(*world.floor.spans_m.ravel()[[1, -2]], 400)]
        )
        places = np.unique(world.floor.unfold(column, 0.0)[:, :2].round(6), axis=0)
        apart = [p for p in places if world.floor.covers(p[None])[0]]
        if len(apart) < 2:
            continue
        pairs += 1
        for k, place in enumerate(apart[:2]):
            batch.place(k, place[0], place[1], 0.0)
        assert (batch.zones_under(np.arange(2)) == world.zones_at(np.array([x]))[0]).all()
    batch.close()
    assert pairs > 3


def test_a_wedge_of_the_floor_lies_in_its_zone_of_the_mine_frame(ramp):
    world = open_bundle(ramp.bundle)
    edges = {zone.name: (zone.west_m, zone.east_m) for zone in world.record.zones}
    assert edges["dry"][0] > -31
    assert edges["water"][1] < 31
    spec = load_world(ramp.bundle).spec()
    names = set()
    for geom in spec.geoms:
        if geom.name.startswith("floor_"):
            name = geom.name.split("_")[1]
            x = np.array(spec.mesh(geom.meshname).uservert)[::3] + geom.pos[0]
            assert edges[name][0] - 0.03 < x.min()
            assert x.max() < edges[name][1] + 0.03
            names.add(name)
    assert names == set(edges)


def test_zones_divide_the_box_about_the_sheets_in_their_places():
    triangle = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 8.0, 0.0]])
    floor = Floor(
        np.concatenate([triangle, triangle + np.array([40.0, 0.0, -5.0])]),
        np.array([[0, 1, 2], [3, 4, 5]], np.int32),
        np.array([0, 1], np.int32),
        np.array([[0.0, 0.0], [35.0, 0.0]]),
    )
    assert zoned_box((-1.0, -2.0, 53.0, 11.0), floor) == (-1.0, -2.0, 18.0, 11.0)
    assert zoned_box((-1.0, -2.0, 53.0, 11.0), Floor()) == (-1.0, -2.0, 53.0, 11.0)


def creep_m(slope: float, heading: float) -> float:
    """Return how far a robot moves in 5 s at rest on an even plane, beyond what its wheels turn."""
    robot, steep = RobotParams(), math.atan(slope)
    spec = physics_spec(TaskParams(terrain=False))
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], contype=FLOOR_BIT, conaffinity=0)
    robot.attach(spec, "robot")
    stand_on_facets(spec, "robot")
    model = spec.compile()
    data, g = mujoco.MjData(model), -model.opt.gravity[2]
    model.opt.gravity[:] = -g * math.sin(steep), 0, -g * math.cos(steep)
    data.qpos[:7] = 0, 0, robot.wheel_radius_m, math.cos(heading / 2), 0, 0, math.sin(heading / 2)
    mujoco.mj_step(model, data, round(1 / model.opt.timestep))
    start = data.qpos[:3].copy()
    mujoco.mj_step(model, data, round(5 / model.opt.timestep))
    return float(np.linalg.norm(data.qpos[:3] - start)) - turned_m(robot, np.array(slope), 5.0)


def test_on_even_planes_a_robot_rests_up_to_the_steepest_floor_that_is_judged_and_slides_on_steeper_ones():
    headings = np.linspace(0, np.pi, 5)
    assert max(creep_m(STEEPEST, heading) for heading in headings) < 0.005
    assert max(creep_m(0.3, heading) for heading in headings) > 0.01
