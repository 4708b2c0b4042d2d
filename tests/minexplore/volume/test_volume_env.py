"""Environments in worlds that are one volume: the interface of all others, with places in three dimensions."""

import copy
import dataclasses
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import minexplore
from minexplore.envs.env import MineEnv
from minexplore.envs.multi_agent import MineParallelEnv
from minexplore.envs.robot_batch import RobotBatch
from minexplore.floors.volume_arrays import VolumeFacets
from minexplore.physics.robot import RobotParams
from minexplore.sensing.coverage import CoverageGrid
from minexplore.task import TaskParams
from minexplore.volume.legs import leg_names
from minexplore.world import World, load_world
from pipeline.volume.world.content import closed_volume
from tests.volumes import HEADER, TEE, build_volume, spiral_with_side_drift

DRY = {"terrain": False}
PELL = Path("data/wheal_pell/pell.3d")
PIT = HEADER + (
    "A,1,0,0,2,2,0,3,0\nA,2,20,0,2,2,0,3,0\n"
    "B,2,20,0,2,2,0,3,0\nB,3,20,0,1,1,-12,3,0\nC,3,20,0,2,2,-12,3,0\nC,4,40,0,2,2,-12,3,0\n"
)


class OtherRobot(RobotParams):
    """A robot that is built by its own function, so that nobody knows its feet."""

    def attach(self, spec, name):
        """Add the same robot."""
        super().attach(spec, name)


def inside_of(world):
    """Return what says how far places of the mine frame are from rock."""
    facets = world.volume.facets
    return closed_volume(VolumeFacets(facets.vertices.copy(), facets.faces, facets.label, facets.leg)).inside


def spread(batch, rng, clearance_m=0.5):
    """Place all robots of a batch anywhere that they reach."""
    spans = batch.world.volume.spans
    places = spans.places_m[batch.ground._standing & (spans.clearance_m >= clearance_m)]
    for robot, (x, y, z) in enumerate(places[rng.choice(len(places), batch.count)].tolist()):
        batch.place(robot, x, y, rng.uniform(-np.pi, np.pi), z)


def placed(folder, *place, task=None, robot=None, whole=False):
    """Return a robot at a place of a world, as a batch, and its source of noise."""
    batch = RobotBatch(minexplore.load(folder), task or TaskParams(**DRY), robot or RobotParams(), 1, whole=whole)
    rngs = [np.random.default_rng(0)]
    batch.reset(np.zeros(1, int), rngs)
    batch.place(0, *place)
    return batch, rngs


def drive_all_out(world, seconds, seed=0, robots=32):
    """Drive robots at full throttle from anywhere; return how far each is from rock, and how many touched any."""
    rng = np.random.default_rng(seed)
    batch = RobotBatch(world, TaskParams(stall_steps=10**6), RobotParams(), robots)
    rngs = [np.random.default_rng(k) for k in range(robots)]
    batch.reset(np.arange(robots), rngs)
    spread(batch, rng)
    for step in range(round(10 * seconds)):
        if step % 10 == 0:
            turn = rng.uniform(-1, 1, robots)
        batch.step(np.column_stack([np.ones(robots), turn]), rngs)
    place = batch.qpos[:, :3] - world.T_world_mine[:3, 3]
    return inside_of(world).distance_m(place), batch.collisions


def test_gymnasiums_checker_accepts_an_environment_in_a_volume(over):
    made = gymnasium.make("MineXplore/World-v0", world=over)
    check_env(made.unwrapped, skip_render_check=True)


def test_a_seed_gives_one_episode_and_a_copy_goes_on_as_its_original(ramp):
    env, other = MineEnv(ramp), MineEnv(ramp)
    for one in (env, other):
        one.reset(seed=3)
    for step in range(20):
        if step == 10:
            other = copy.deepcopy(env)
        found = [one.step(np.array([0.8, 0.3]))[0] for one in (env, other)]
        assert (found[0] == found[1]).all()


def test_the_info_names_the_floor_and_the_leg_of_passages_over_each_other(over):
    batch = RobotBatch(minexplore.load(over), TaskParams(), RobotParams(), 2)
    rngs = [np.random.default_rng(k) for k in range(2)]
    batch.reset(np.arange(2), rngs)
    batch.place(0, 15.0, 0.0, 0.0, 8.0)
    batch.place(1, 15.0, 0.0, 0.0, 0.0)
    info = batch.step(np.zeros((2, 2)), rngs).info
    names = leg_names(batch.world)
    assert [names[leg] for leg in info["leg"]] == ["a to b", "e to f"]
    assert info["floor"][0] != info["floor"][1]
    assert info["height_m"] == pytest.approx([8.0, 0.0], abs=0.01)


def test_beams_mark_the_cells_of_their_own_passage_and_not_those_under_it(over):
    batch, rngs = placed(over, 15.0, 0.0, 0.0, 8.0)
    batch.seen[:] = False
    batch.step(np.zeros((1, 2)), rngs)
    low = batch.grid.low_m[batch.seen[0]]
    assert len(low) > 15
    assert (low > 7).all()
    assert batch.grid.total > len(np.unique(batch.grid.square))  # some lie over each other


def test_ranges_are_those_of_the_drift_that_was_surveyed(box):
    batch, _ = placed(box, 8.0, 0.5, 0.0, 0.0, task=TaskParams(**DRY, beams=4))
    assert batch.true_ranges(np.zeros(1, int))[0] == pytest.approx([10.0, 1.5, 8.0, 2.5], abs=1e-3)


def test_a_robot_climbs_a_ramp_as_fast_as_it_is_told_and_touches_nothing(ramp):
    batch, rngs = placed(ramp, 18.0, 0.0, 0.0, 0.0)
    for _ in range(100):
        info = batch.step(np.array([[1.0, 0.0]]), rngs).info
    x, _, yaw = info["pose_m_rad"][0]
    assert x == pytest.approx(18.0 + 15.0, abs=1.0)
    assert abs(yaw) < np.radians(4)  # a robot that starts at full torque slips a little
    assert info["height_m"][0] == pytest.approx(0.15 * (x - 20.0), abs=0.02)
    assert info["collisions"][0] == 0


def test_a_robot_at_rest_on_a_ramp_stays(ramp):
    batch, rngs = placed(ramp, 30.0, 0.0, 0.3, 3.0)
    for step in range(60):
        pose = batch.step(np.zeros((1, 2)), rngs).info["pose_m_rad"][0]
        start = pose if step == 9 else None if step < 9 else start
    assert np.linalg.norm(pose[:2] - start[:2]) < 0.01


def test_boxes_under_feet_and_the_floors_parts_carry_a_robot_alike(ramp):
    found = []
    for robot, whole in ((RobotParams(), False), (RobotParams(), True), (OtherRobot(), False)):
        batch, rngs = placed(ramp, 25.0, 0.0, 0.0, 1.0, robot=robot, whole=whole)
        for _ in range(30):
            info = batch.step(np.array([[0.5, 0.0]]), rngs).info
        x, y, yaw = info["pose_m_rad"][0]
        found.append([x, info["height_m"][0], y, yaw])
    for other in found[1:]:
        assert other == pytest.approx(found[0], abs=0.02)
    assert found[0][1] > 1.0


def test_a_robot_that_drives_into_a_pit_falls_no_faster_than_it_is_braked_and_lands(tmp_path):
    batch, rngs = placed(build_volume(PIT, tmp_path), 18.2, 0.0, 0.0, 12.0)
    fastest = 0.0
    for _ in range(75):
        info = batch.step(np.array([[1.0, 0.0]]), rngs).info
        fastest = max(fastest, -batch.qvel[0, 2])
    assert 2.5 < fastest < 5.0
    assert info["height_m"][0] < 1
    world = batch.world
    assert inside_of(world).distance_m(batch.qpos[:, :3] - world.T_world_mine[:3, 3])[0] > 0


def test_wheels_have_the_friction_of_the_zone_that_they_are_in(box):
    world = minexplore.load(box)
    border = world.floor_zones[0].east_m
    batch, _ = placed(
        box, border, 0.0, -np.pi / 2, 0.0, task=TaskParams()
    )  # heads south: the left wheel is in the east
    place = batch._mine_places(np.zeros(1, int))
    number, code = batch.ground.prepare(batch.stepper, np.zeros(1, int), place)[0].tolist()
    model = batch.local_models.model((number, code))
    frictions = [model.geom(f"robot_{side}").friction[0] for side in ("left", "right")]
    assert frictions == [zone.friction for zone in (world.floor_zones[1], world.floor_zones[0])]


def test_a_team_shares_cells_and_touches_rock_in_a_volume(over):
    env = MineParallelEnv(2, world=over, task=DRY)
    env.reset(seed=0)
    for _ in range(30):
        observation, _, _, _, info = env.step({agent: np.array([1.0, 0.0]) for agent in env.agents})
    assert info["robot_0"]["team_cells_seen"] == env.team.team_seen.sum()
    assert {leg_names(env.world)[one["leg"]] for one in info.values()} == {"a to b"}
    assert all(np.isfinite(row).all() for row in observation.values())
    assert env.team.collisions.sum() > 0


def test_a_teams_wheels_have_the_friction_of_their_zones(box):
    env = MineParallelEnv(1, world=box)
    env.reset(seed=0)
    zones = env.world.floor_zones
    env.team.place(0, zones[1].west_m + 2.0, 0.0, 0.0, 0.0)
    env.step({"robot_0": np.zeros(2)})
    assert env.team.model.geom("robot_0_left").friction[0] == zones[1].friction != zones[0].friction


def test_what_takes_plans_alone_refuses_a_volume_in_one_line(box):
    with pytest.raises(ValueError, match=r"world: its mine is one volume; this takes mines whose floors are drawn"):
        CoverageGrid(load_world(box), 2.0, 0.35, np.zeros(2), np.inf)


def test_pictures_show_the_plan_with_what_was_seen_and_the_robot_in_the_model(box):
    for camera, colour in (("top", (92, 168, 96)), ("chase", None)):
        env = MineEnv(box, render_mode="rgb_array", camera=camera)
        env.reset(seed=0)
        picture = env.render()
        assert picture.shape == (480, 640, 3)
        if colour is not None:
            assert (picture == colour).all(axis=2).mean() > 0.02
        assert picture.std() > 10
        env.close()


def slow(*values):
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    ("mine", "seconds", "least_m"),
    [(None, 3.0, 0.1), slow(TEE, 3.0, 0.1), slow(spiral_with_side_drift(), 5.0, 0.1), slow(PELL, 3.0, 0.05)],
    ids=["ramp", "tee", "spiral", "pell"],
)
def test_robots_at_full_throttle_stay_in_the_volume(ramp, tmp_path, mine, seconds, least_m):
    world = minexplore.load(build_volume(mine, tmp_path) if mine else ramp)
    distance, collisions = drive_all_out(world, seconds)
    assert collisions.sum() > 0
    assert (distance > least_m).all()


def test_a_robot_that_fits_nowhere_is_one_error(box):
    with pytest.raises(ValueError, match="no place where the robot fits"):
        MineEnv(box, robot=dataclasses.replace(RobotParams(), radius_m=3.0))


def test_cells_beyond_the_region_do_not_count(over):
    world = load_world(over)
    near, far = (RobotBatch(world, TaskParams(region_m=r), RobotParams(), 1).grid.total for r in (15.0, np.inf))
    assert 0 < near < far / 3


def test_an_environment_in_a_volume_never_gives_the_whole_model_to_mujoco(box, monkeypatch):
    """MuJoCo's specs take minutes for a cave's parts; models hold what a robot reaches, of the arrays."""

    def refuse(world):
        raise AssertionError(f"{world.folder}: mine.xml was read into a spec")

    monkeypatch.setattr(World, "spec", refuse)
    env = gymnasium.make("MineXplore/World-v0", world=box)
    start = env.reset(seed=0)[1]["pose_m_rad"]
    for _ in range(20):
        info = env.step(np.array([1.0, 0.5], np.float32))[4]
    assert np.linalg.norm(np.array(info["pose_m_rad"])[:2] - np.array(start)[:2]) > 0.02
