"""Begin new episodes of some robots: a place near the entrance, a random yaw, nothing seen."""

import numpy as np
import warp as wp

from minexplore.extra.warp.kernels.frames import MineFrame
from minexplore.extra.warp.kernels.philox import START, draw, uniform
from minexplore.physics.robot import RobotParams
from minexplore.world import World

_PI = wp.constant(wp.float64(np.pi))


def start_places(world: World, robot: RobotParams) -> np.ndarray:
    """Return where episodes begin (n, 2) m, mine frame: the anchor, or where it is too narrow all places near it.

    Raises
    ------
    ValueError
        If the robot fits nowhere near the entrance.
    """
    spawn = world.record["spawn"]
    if spawn["anchor_clearance_m"] >= spawn["clearance_m"] >= robot.radius_m:
        return np.array([spawn["anchor_m"]], dtype=np.float64)
    places = world.places_m(robot.radius_m)
    near = places[np.linalg.norm(places - spawn["centre_m"], axis=1) <= spawn["radius_m"]]
    if not len(near):
        raise ValueError(f"{world.folder}: the robot ({robot.radius_m} m) fits nowhere near the entrance")
    return near


@wp.kernel(enable_backward=False)
def restart_robots(
    frame: MineFrame,
    turn: wp.quatd,
    height_m: wp.float64,
    places_m: wp.array[wp.vec2d],
    qpos0: wp.array[float],
    keys: wp.array2d[wp.uint32],
    asked: wp.array[bool],
    draws: wp.array[wp.uint32],
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    warmstart: wp.array2d[float],
    previous: wp.array2d[float],
    steps: wp.array[int],
    stalled: wp.array[int],
    collisions: wp.array[int],
    touched: wp.array[bool],
):
    """Place the robots that are `asked` at rest, a thread a robot; `turn` is the mine frame's rotation in the world."""
    robot = wp.tid()
    if not asked[robot]:
        return
    draws[robot] = draws[robot] + wp.uint32(1)
    words = draw(keys, draws, robot, 0, START)
    count = places_m.shape[0]
    place = places_m[wp.min(int(uniform(words[0]) * wp.float64(count)), count - 1)]
    yaw = _PI * (wp.float64(2.0) * uniform(words[1]) - wp.float64(1.0))
    for k in range(qpos.shape[1]):
        qpos[robot, k] = qpos0[k]
    for k in range(qvel.shape[1]):
        qvel[robot, k] = 0.0
        warmstart[robot, k] = 0.0
    origin = frame.rotation * wp.vec3d(place[0], place[1], height_m) + frame.origin
    half = yaw / wp.float64(2.0)
    heading = turn * wp.quatd(wp.float64(0.0), wp.float64(0.0), wp.sin(half), wp.cos(half))  # Warp: w last
    for k in range(3):
        qpos[robot, k] = wp.float32(origin[k])
        qpos[robot, 4 + k] = wp.float32(heading[k])
    qpos[robot, 3] = wp.float32(heading[3])
    for k in range(2):
        previous[robot, k] = 0.0
    steps[robot] = 0
    stalled[robot] = 0
    collisions[robot] = 0
    touched[robot] = False


@wp.kernel(enable_backward=False)
def forget_cells(asked: wp.array[bool], seen: wp.array2d[wp.uint32]):
    """Forget what the robots that are `asked` have seen, a thread a robot and word."""
    robot, word = wp.tid()
    if asked[robot]:
        seen[robot, word] = wp.uint32(0)


@wp.kernel(enable_backward=False)
def count_first_look(asked: wp.array[bool], gained: wp.array[int], cells_seen: wp.array[int]):
    """Take what the first look saw: no step earned these cells."""
    robot = wp.tid()
    if asked[robot]:
        cells_seen[robot] = gained[robot]
