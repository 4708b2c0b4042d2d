"""Local models of mines with heights: planes and boxes have the surface of the wedges that they replace."""

import mujoco
import numpy as np
import pytest

from minexplore.floors.local_floor import simplify_floor

LOW, HIGH = np.array([-2.0, -2.0]), np.array([2.0, 2.0])
WEST, EAST = [(-9, -9), (0, -9), (0, 9), (-9, 9)], [(0, -9), (9, -9), (9, 9), (0, 9)]
BOX, PLANE = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_PLANE


def wedge(outline, height):
    """Return a wedge of 0.25 m under a height of two numbers, over an outline."""
    top = np.array([(x, y, height(x, y)) for x, y in outline], dtype=float)
    return np.vstack([top - [0, 0, 0.25], top])


def floor_heights(wedges, zones, places):
    """Return the heights at places of what stands for wedges, by rays from above."""
    primitives, kept = simplify_floor(wedges, zones, LOW, HIGH)
    spec = mujoco.MjSpec()
    for found in primitives:
        spec.worldbody.add_geom(type=found.type, pos=found.place, quat=found.quaternion, size=found.size)
    for number in kept:
        spec.add_mesh(name=f"{number}", uservert=wedges[number].ravel())
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"{number}")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return np.array([9.0 - ray(model, data, [x, y, 9.0])[0] for x, y in places])


def ray(model, data, start, group=None):
    """Return how far below a place the first geom is, and its number."""
    groups, hit = None, np.zeros(1, np.int32)
    if group is not None:
        groups = np.zeros(mujoco.mjNGROUP, np.uint8)
        groups[group] = 1
    distance = mujoco.mj_ray(model, data, np.array(start, float), np.array([0, 0, -1.0]), groups, 1, -1, hit, None)
    return distance, int(hit[0])


def kinds(wedges, zones=None):
    primitives, kept = simplify_floor(wedges, zones or ["dry"] * len(wedges), LOW, HIGH)
    return [found.type for found in primitives], kept


def test_wedges_of_one_slope_are_one_plane():
    def slope(x, y):
        return 0.1 * x - 0.05 * y + 3

    assert kinds([wedge(WEST, slope), wedge(EAST, slope)]) == ([PLANE], [])


@pytest.mark.parametrize(("bend", "kind"), [(abs, PLANE), (lambda x: -abs(x), BOX)])
def test_a_valley_is_two_planes_and_a_ridge_two_boxes(bend, kind):
    def height(x, y):
        return 0.15 * bend(x) + 0.02 * y

    wedges = [wedge(WEST, height), wedge(EAST, height)]
    assert kinds(wedges) == ([kind, kind], [])
    places = np.random.default_rng(0).uniform(LOW, HIGH, (500, 2))
    found = floor_heights(wedges, ["dry"] * 2, places)
    np.testing.assert_allclose(found, [height(x, y) for x, y in places], atol=1e-6)


def test_the_floor_of_one_zone_ends_where_the_next_begins():
    wedges = [wedge(outline, lambda x, y: 0.1 * y) for outline in (WEST, EAST)]
    primitives, kept = simplify_floor(wedges, ["dry", "mud"], LOW, HIGH)
    assert [found.type for found in primitives] == [BOX, BOX]
    assert kept == []
    for found in primitives:
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, found.quaternion)
        reach = np.abs(turn.reshape(3, 3)[0] * found.size).sum()
        ends = found.place[0] + np.array([-reach, reach])
        np.testing.assert_allclose(ends, [-2, 0] if found.wedge == 0 else [0, 2], atol=1e-3)


def test_a_wedge_between_two_ridges_that_meet_at_less_than_a_right_angle_is_kept():
    """A pyramid of six sides: no rectangle holds one side's tip without some of the next."""
    angle = np.radians(60 * np.arange(6))
    rim = 9 * np.column_stack([np.cos(angle), np.sin(angle)])
    sides = [np.vstack([[0, 0, 0], [*rim[k], -1.5], [*rim[(k + 1) % 6], -1.5]]) for k in range(6)]
    wedges = [np.vstack([side - [0, 0, 0.25], side]) for side in sides]
    assert kinds(wedges) == ([], [0, 1, 2, 3, 4, 5])


LEVEL = wedge(WEST, lambda x, y: 0.0)


@pytest.mark.parametrize(
    "corners",
    [
        np.vstack([LEVEL, [[-4.0, 0.0, 1.0]]]),
        LEVEL + np.repeat([[0.1, 0, 0], [0, 0, 0]], 4, axis=0),
        LEVEL[[3, 2, 1, 0, 7, 6, 5, 4]],
        LEVEL[[4, 5, 6, 7, 0, 1, 2, 3]],
    ],
    ids=["a corner too many", "a leaning one", "clockwise", "upside down"],
)
def test_beside_a_part_that_is_no_slab_all_wedges_are_kept(corners):
    assert kinds([wedge(EAST, lambda x, y: 0.0), corners]) == ([], [0, 1])
