import json
import math
import re
import shutil

import mujoco
import numpy as np
import pytest

from minexplore.bundle import MODEL, RECORD, BundleError, world_sha256
from minexplore.envs.env import MineEnv
from minexplore.floors.floor_zones import FloorZone, read_zones
from minexplore.physics.local_models import LocalModels
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from minexplore.world import load_world
from tests.mines import BuiltMine

DRY = {"name": "dry", "friction": 1.0, "command_scale": 1.0, "speed_noise_mps": 0.0, "west_m": 0.0, "east_m": 10.0}
ICE = {"name": "ice", "friction": 0.05, "command_scale": 0.9, "speed_noise_mps": 0.3, "west_m": 10.0, "east_m": 20.0}


def reseal(bundle, change):
    """Change a bundle's record and renew its hash."""
    record = json.loads((bundle / RECORD).read_text())
    change(record)
    record["world_sha256"] = world_sha256(record)
    (bundle / RECORD).write_text(json.dumps(record))


@pytest.fixture
def bundle(tee: BuiltMine, tmp_path):
    shutil.copytree(tee.bundle, tmp_path / "world")
    return tmp_path / "world"


def test_zones_are_read_as_they_stand(tmp_path):
    assert read_zones(tmp_path, [DRY, ICE]) == [
        FloorZone("dry", 0.0, 10.0, 1.0, 1.0, 0.0),
        FloorZone("ice", 10.0, 20.0, 0.05, 0.9, 0.3),
    ]


@pytest.mark.parametrize(
    ("zone", "words"),
    [
        ({"command_scale": None}, "zones[1].command_scale = None: want a finite number, above 0 and at most 1"),
        ({"command_scale": 0.0}, "zones[1].command_scale = 0.0: want a finite number, above 0 and at most 1"),
        ({"command_scale": 1.5}, "zones[1].command_scale = 1.5: want a finite number, above 0 and at most 1"),
        (
            {"speed_noise_mps": math.nan},
            "speed_noise_mps = nan: want a finite number, 0 or more and at most 1",
        ),
        ({"speed_noise_mps": "0.1"}, "zones[1].speed_noise_mps = '0.1': want a finite number"),
        ({"friction": -1.0}, "zones[1].friction = -1.0: want a finite number, 0 or more"),
        ({"friction": math.inf}, "zones[1].friction = inf: want a finite number, 0 or more"),
        ({"east_m": 10.0}, "zones[1].east_m = 10.0: want more than west_m, 10.0"),
        ({"slipperiness": 3}, "zones[1].slipperiness = 3: unknown; a zone has west_m, east_m, friction"),
        ({"name": 7}, "zones[1].name = 7: want a text"),
        ({"west_m": 11.0}, "zones[1].west_m = 11.0: want 10.0, the end of the last"),
        ({"name": "dry"}, "want zones of different names"),
    ],
)
def test_a_zone_that_is_not_whole_is_refused_with_its_value_and_limit(tmp_path, zone, words):
    with pytest.raises(BundleError, match=re.escape(words)):
        read_zones(tmp_path, [DRY, {**ICE, **zone}])


@pytest.mark.parametrize("field", ["friction", "command_scale", "speed_noise_mps", "west_m", "east_m"])
def test_a_zone_without_a_field_is_refused(tmp_path, field):
    with pytest.raises(BundleError, match=rf"zones\[1\]\.{field} = None"):
        read_zones(tmp_path, [DRY, {k: v for k, v in ICE.items() if k != field}])


def test_a_world_says_which_zone_is_not_whole(bundle):
    reseal(bundle, lambda record: record["zones"][1].pop("command_scale"))
    with pytest.raises(BundleError, match=r"world\.json: zones\[1\]\.command_scale = None: want a finite number"):
        MineEnv(bundle)


def test_a_zone_without_a_floor_is_refused(bundle):
    def rename(record):
        record["zones"][1] |= {"name": "gravel", "command_scale": 0.9, "speed_noise_mps": 0.0}

    reseal(bundle, rename)
    with pytest.raises(BundleError, match=r"mine\.xml: no geom 'floor_gravel' of a floor zone that world\.json names"):
        MineEnv(bundle)


def test_a_robot_drives_as_its_zone_says_whatever_the_zone_is_called(bundle):
    def slow_down(record):
        record["zones"][0] |= {"command_scale": 0.25, "speed_noise_mps": 0.0}

    reseal(bundle, slow_down)
    env = MineEnv(bundle)
    env.reset(seed=0)
    env.robots.place(0, 8.0, 2.5, 0.0)
    poses = np.array([env.step(np.array([1.0, 0.0]))[4]["pose_m_rad"] for _ in range(30)])
    assert np.linalg.norm(poses[-1, :2] - poses[9, :2]) / 2.0 == pytest.approx(0.25 * 1.5, rel=0.03)


def test_the_noise_of_a_zone_is_in_the_commands_to_the_wheels(bundle):
    def shake(record):
        record["zones"][0] |= {"command_scale": 0.5, "speed_noise_mps": 0.2}

    reseal(bundle, shake)
    env = MineEnv(bundle)
    env.reset(seed=0)
    speeds = []
    for _ in range(400):
        env.robots.place(0, 8.0, 2.5, 0.0)
        env.step(np.array([0.8, 0.0]))
        speeds.append(env.robots.stepper.ctrl[0].mean() * env.robot.wheel_radius_m)
    assert np.mean(speeds) == pytest.approx(0.5 * 0.8 * 1.5, abs=0.03)
    assert np.std(speeds) == pytest.approx(0.2, rel=0.15)


def test_friction_is_that_of_the_zone_or_none_of_it(tee: BuiltMine):
    world = load_world(tee.bundle)
    for terrain in (True, False):
        model = LocalModels(world, TaskParams(terrain=terrain), RobotParams()).spec(None).compile()
        for zone in world.active_zones(terrain):
            assert model.geom(zone.geom).friction[0] == zone.friction
            assert zone.friction == 1.0 or terrain


def test_the_record_and_the_model_agree_on_friction(tee: BuiltMine):
    model = mujoco.MjModel.from_xml_path(str(tee.bundle / MODEL))
    for zone in load_world(tee.bundle).floor_zones:
        assert model.geom(zone.geom).friction[0] == pytest.approx(zone.friction, abs=1e-6)
