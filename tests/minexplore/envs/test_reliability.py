import hashlib
import inspect
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely
from tqdm import tqdm

from minexplore.envs.env import MineEnv
from minexplore.envs.robot_batch import RobotBatch
from minexplore.envs.vector import MineVectorEnv
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from minexplore.world import load_world
from pipeline.store.codecs import decode
from pipeline.types import FreeSpace
from tests.mines import BuiltMine
from tests.minexplore.envs.test_env import drive, place
from tests.project import ROOT, Project


def roll(bundle: str) -> str:
    """Return the hash of the observations and rewards of four robots in 60 steps."""
    env = MineVectorEnv(4, bundle)
    digest = hashlib.sha256(env.reset(seed=5)[0].tobytes())
    rng = np.random.default_rng(0)
    for _ in range(60):
        observation, reward, *_ = env.step(rng.uniform(-1, 1, (4, 2)))
        digest.update(observation.tobytes() + reward.tobytes())
    return digest.hexdigest()


def test_seeds_give_identical_episodes_across_processes(tee: BuiltMine):
    imports = "import hashlib, sys, numpy as np\nfrom minexplore.envs.vector import MineVectorEnv\n"
    command = [sys.executable, "-c", f"{imports}{inspect.getsource(roll)}print(roll(sys.argv[1]))", str(tee.bundle)]
    assert subprocess.run(command, capture_output=True, text=True, cwd=ROOT).stdout.strip() == roll(tee.bundle)


@pytest.mark.parametrize(
    ("zone", "x", "scale", "speed_tolerance", "turn_tolerance"),
    [("dry", 8.0, 1.0, 0.02, 0.05), ("mud", 32.0, 0.7, 0.06, 0.08), ("water", 62.0, 0.4, 0.15, 0.25)],
)
def test_the_driven_twist_is_near_the_commanded_one_in_every_zone(
    tee: BuiltMine, zone, x, scale, speed_tolerance, turn_tolerance
):
    """Relative differences of mean speed and turn rate; on the slope, slip and the speed's own noise included."""
    env = MineEnv(tee.bundle)
    place(env, x, 2.5, 0.0)
    drive(env, [0.8, 0.0], 8)
    poses, infos = drive(env, [0.8, 0.0], 25)
    assert env.world.zone_names[infos[-1]["zone"]] == zone
    assert not any(info["collision"] for info in infos)
    assert abs(poses[-1, 2]) < 0.1
    driven = np.linalg.norm(poses[-1, :2] - poses[0, :2]) / 2.4
    assert driven == pytest.approx(0.8 * 1.5 * scale, rel=speed_tolerance)
    place(env, x, 2.5, 0.0)
    drive(env, [0.0, 0.5], 8)
    poses, _ = drive(env, [0.0, 0.5], 25)
    assert np.linalg.norm(poses[-1, :2] - [x, 2.5]) < 0.1 / scale  # it slides where the floor is slippery
    turned = np.unwrap(poses[:, 2])
    assert (turned[-1] - turned[0]) / 2.4 == pytest.approx(0.5 * 1.5 * scale, rel=turn_tolerance)


def drive_hard(robots: RobotBatch, inside, steps: int, seed: int) -> int:
    """Drive at random, full throttle and into walls; return how many control steps were made."""
    count = robots.count
    rngs = [np.random.default_rng([seed, i]) for i in range(count)]
    robots.reset(np.arange(count), rngs)
    rng = np.random.default_rng(seed)
    actions = np.zeros((count, 2))
    made = 0
    for step in tqdm(range(steps), desc="control steps", disable=None):
        change = rng.random(count) < 0.1
        fresh = np.column_stack([rng.choice([1.0, -1.0, 0.3], count, p=[0.7, 0.2, 0.1]), rng.uniform(-1, 1, count)])
        actions[change] = fresh[change]
        outcome = robots.step(actions, rngs)
        made += count
        x, y, _ = outcome.info["pose_m_rad"].T
        assert np.isfinite(outcome.observation).all()
        assert np.isfinite(robots.state).all()
        assert shapely.contains_xy(inside, x, y).all(), (step, np.flatnonzero(~shapely.contains_xy(inside, x, y)))
        assert (outcome.reward <= 100).all()
        over = np.flatnonzero(outcome.truncated | (rng.random(count) < 1e-4))
        if len(over):
            robots.reset(over, rngs)
    return made


def test_hard_driving_leaves_no_nan_and_no_robot_outside(tee: BuiltMine):
    inside = tee.free_space.polygon.buffer(0.01)
    shapely.prepare(inside)
    robots = RobotBatch(load_world(tee.bundle), TaskParams(), RobotParams(), 25)
    assert drive_hard(robots, inside, 200, 1) == 5_000


@pytest.mark.slow
def test_a_hundred_thousand_hard_steps_on_the_real_mine(built: Project):
    """10^5 control steps, 2 * 10^6 physics steps: no NaN, no warning, no robot outside by more than 1 cm."""
    bundle = built.folder / "artifacts" / "realism" / "world"
    inside = decode(bundle / "free_space.geojson", FreeSpace).polygon.buffer(0.01)
    shapely.prepare(inside)
    robots = RobotBatch(load_world(bundle), TaskParams(), RobotParams(), 200, threads=2)
    assert drive_hard(robots, inside, 500, 2) == 100_000


@pytest.mark.slow
def test_memory_does_not_grow_over_a_hundred_thousand_resets(tee: BuiltMine):
    env = MineVectorEnv(100, tee.bundle)

    def resident_mb() -> float:
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

    env.reset(seed=0)
    for _ in range(100):
        env.reset()
    before = resident_mb()
    for _ in range(1000):
        env.reset()
    assert resident_mb() - before < 20
