"""Models of one robot leave out what costs time, and change no digit of its motion."""

import mujoco
import numpy as np
import pytest

from minexplore.physics.local_models import ALONE, TILE_M, LocalModels, part_vertices
from minexplore.physics.robot import RobotParams, free_joint_qpos
from minexplore.physics.robots import find_robot
from minexplore.task import TaskParams
from minexplore.world import load_world

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


def driven_into_rock(model, pose):
    """Return the states of a robot that drives ahead from a pose, and whether it touched rock."""
    data = mujoco.MjData(model)
    data.qpos[:7] = pose
    rng = np.random.default_rng(3)
    states, touched = np.zeros((200, mujoco.mj_stateSize(model, _STATE))), False
    for state in states:
        data.ctrl[:] = rng.uniform(4.0, 9.0, 2)
        mujoco.mj_step(model, data)
        mujoco.mj_getState(model, data, state, _STATE)
        touched |= bool(data.sensordata[0])
    return states, touched


@pytest.mark.parametrize(("yaw_rad", "meets_rock"), [(-1.6, True), (-1.2, True), (0.4, False)])
def test_a_robot_alone_moves_to_the_last_digit_as_with_the_geoms_that_others_meet(tee, yaw_rad, meets_rock):
    models = LocalModels(load_world(tee.bundle), TaskParams(), RobotParams())
    place = np.array([11.0, 0.6])
    tile = tuple(models.tiles_of(place[None])[0].tolist())
    alone, among = models.model(tile), models.spec(tile).compile()
    assert alone.ngeom == among.ngeom - 2
    assert alone.opt.disableflags == among.opt.disableflags | ALONE
    pose = free_joint_qpos(models.T_world_mine, RobotParams(), *place, yaw_rad)
    (one, touched), (two, _) = (driven_into_rock(model, pose) for model in (alone, among))
    np.testing.assert_array_equal(one, two)
    assert touched == meets_rock


def test_tiles_with_the_same_in_reach_have_one_model_and_all_have_that_of_their_own(tee):
    models = LocalModels(load_world(tee.bundle), TaskParams(), RobotParams())
    tiles = [(x, y) for x in range(-3, 12) for y in range(-3, 6)]
    places = (np.array(tiles) + 0.5) * TILE_M
    found = [tuple(tile) for tile in models.tiles_of(places).tolist()]
    assert 4 < len(set(found)) < len(tiles) / 4
    for tile, first in zip(tiles, found, strict=True):
        assert [geom.name for geom in models.spec(tile).geoms] == [geom.name for geom in models.spec(first).geoms]
    assert models.tiles_of(np.zeros((0, 2))).shape == (0, 2)


def test_a_model_of_all_rock_and_another_robot_keep_their_geoms(tee):
    world = load_world(tee.bundle)
    whole = LocalModels(world, TaskParams(), RobotParams(), whole=True).model((5, 1))
    assert mujoco.mj_name2id(whole, mujoco.mjtObj.mjOBJ_GEOM, "robot_bumper") >= 0
    assert not whole.opt.disableflags & ALONE
    models = LocalModels(world, TaskParams(), find_robot("husky"))
    assert models.model((5, 1)).ngeom == models.spec((5, 1)).compile().ngeom


def test_vertices_that_are_counted_first_are_those_of_the_spec():
    spec, stated = mujoco.MjSpec(), np.random.default_rng(0).normal(size=(5, 3)).astype(np.float32)
    spec.add_mesh(name="part", uservert=stated.ravel())
    geom = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="part")
    np.testing.assert_array_equal(part_vertices(spec, geom), stated)
