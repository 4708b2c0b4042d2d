import numpy as np

from minexplore.envs.vector import MineVectorEnv
from minexplore.physics.local_models import TILE_M, LocalModels
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from minexplore.tiles import tiles_at
from minexplore.world import load_world


def test_physics_keeps_few_models_and_its_trajectories_do_not_depend_on_how_many(tee, monkeypatch):
    """A model for each tile, though many of these are alike."""
    monkeypatch.setattr(LocalModels, "tiles_of", lambda self, xy: tiles_at(xy, TILE_M))
    places, kept = [], []
    for most in (1, 512):
        monkeypatch.setattr("minexplore.physics.stepper._KEPT_BATCHES", most)
        env = MineVectorEnv(2, world=tee.bundle)
        env.reset(seed=[0, 1])
        for x in range(4, 76, 4):
            env.robots.place(0, x, 2.5, 0.0)
            for _ in range(3):
                env.step(np.ones((2, 2)) * 0.5)
        places.append(env.robots.qpos.copy())
        kept.append(len(env.robots.stepper._batches))
        env.close()
    np.testing.assert_array_equal(*places)
    assert kept[0] <= 6  # four, and those that the last step made
    assert kept[1] >= 18


def test_a_model_of_a_tile_reserves_memory_for_the_contacts_of_its_geoms_only(tee):
    """A process keeps 512 batches with two such reserves each: 13 MB, MuJoCo's own value, makes 13 GB of addresses."""
    model = LocalModels(load_world(tee.bundle), TaskParams(), RobotParams()).model((20, 1))
    assert 32 * 1024 < model.narena < 1_000_000
