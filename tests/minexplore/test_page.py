"""The environment's page against what it describes."""

import numpy as np
import pytest
from gymnasium.utils import seeding

from minexplore.envs.env import MineEnv
from minexplore.envs.team import Team
from minexplore.page import option_values, page
from minexplore.physics.local_models import LocalModels
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from minexplore.world import load_world
from tests.mines import BuiltMine


def test_the_page_states_the_options_of_the_models_that_are_stepped(tee: BuiltMine):
    world = load_world(tee.bundle)
    models = LocalModels(world, TaskParams(), RobotParams())
    for model in (models.model((4, 1)), models.spec(None).compile(), Team(world, TaskParams(), RobotParams(), 2).model):
        for name, value in option_values(model).items():
            assert f"| {name} | {value} |" in page()


def test_the_page_states_the_robot_s_geoms_as_they_are_stepped(tee: BuiltMine):
    model = LocalModels(load_world(tee.bundle), TaskParams(), RobotParams()).spec((4, 1)).compile()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in page().splitlines() if "|" in line]
    by_name = {row[0]: row for row in rows}
    for name in ("chassis", "bumper", "front", "rear", "left", "right"):
        geom, row = model.geom(f"robot_{name}"), next(row for row in rows if row[0] == name and len(row) == 9)
        assert [int(cell) for cell in row[4:8]] == [
            geom.contype[0],
            geom.conaffinity[0],
            geom.condim[0],
            geom.priority[0],
        ]
        np.testing.assert_allclose([float(f) for f in row[8].split(",")], geom.friction)
    assert float(by_name["robot"][1]) == pytest.approx(model.body("robot").mass[0], rel=1e-3)
    np.testing.assert_allclose(
        [float(v) for v in by_name["robot"][3].split(",")], model.body("robot").inertia, rtol=1e-3
    )


def noise_of(env, observation):
    """Return the noise on the beams, m, of those whose reading is not clipped."""
    true = env.robots.true_ranges(np.arange(1))[0]
    free = (true > 0.2) & (true < 9.9)
    near, far = env.task.range_m
    return free, (observation[: env.task.beams] * (far - near) + near - np.clip(true, near, far))[free]


def test_random_numbers_are_drawn_in_the_page_s_order(tee: BuiltMine):
    env = MineEnv(tee.bundle)
    rng = seeding.np_random(12)[0]
    observation, info = env.reset(seed=12)
    assert info["pose_m_rad"][2] == pytest.approx(rng.uniform(-np.pi, np.pi), abs=1e-6)
    free, noise = noise_of(env, observation)
    np.testing.assert_allclose(noise, 0.01 * rng.standard_normal(16)[free], atol=1e-5)
    for x, zone in ((8.0, "dry"), (32.0, "mud"), (62.0, "water")):
        env.robots.place(0, x, 2.5, 0.0)
        observation, _, _, _, info = env.step(np.array([0.5, 0.0]))
        assert env.world.zone_names[info["zone"]] == zone
        (stated,) = (z for z in env.world.floor_zones if z.name == zone)
        drawn = rng.normal(0.0, stated.speed_noise_mps) if stated.speed_noise_mps else 0.0
        speed = env.robots.stepper.ctrl[0].mean() * env.robot.wheel_radius_m
        assert speed == pytest.approx(0.5 * 1.5 * stated.command_scale + drawn, abs=1e-9)
        free, noise = noise_of(env, observation)
        np.testing.assert_allclose(noise, 0.01 * rng.standard_normal(16)[free], atol=1e-5)


def test_a_robot_that_is_too_wide_for_the_anchor_draws_its_place_first(tee: BuiltMine):
    env = MineEnv(tee.bundle, robot={"radius_m": 0.55})
    rng = seeding.np_random(4)[0]
    _, info = env.reset(seed=4)
    spawn = env.world.record["spawn"]
    places = env.world.places_m(0.55)
    near = places[np.linalg.norm(places - spawn["centre_m"], axis=1) <= spawn["radius_m"]]
    np.testing.assert_allclose(info["pose_m_rad"][:2], near[rng.integers(len(near))], atol=1e-3)
    assert info["pose_m_rad"][2] == pytest.approx(rng.uniform(-np.pi, np.pi), abs=1e-6)
