"""What robots observe, with noise, and where they are; `minexplore.sensing.observation` is the reference."""

import warp as wp

from minexplore.extra.warp.kernels.drive import zone_at
from minexplore.extra.warp.kernels.faults import NOT_FINITE
from minexplore.extra.warp.kernels.frames import MineFrame, body_place, body_rotation, is_finite
from minexplore.extra.warp.kernels.philox import BEAM, draw, normal


@wp.kernel(enable_backward=False)
def observe_beams(
    near_m: wp.float64,
    far_m: wp.float64,
    noise_m: wp.float64,
    keys: wp.array2d[wp.uint32],
    draws: wp.array[wp.uint32],
    asked: wp.array[bool],
    ranges: wp.array2d[float],
    previous: wp.array2d[float],
    observation: wp.array2d[float],
):
    """Write the observations (robots, beams + 3) of robots that are `asked`, a thread a beam."""
    robot, beam = wp.tid()
    if not asked[robot]:
        return
    true_m = wp.clamp(wp.float64(ranges[robot, beam]), near_m, far_m)
    noisy_m = true_m + noise_m * normal(draw(keys, draws, robot, beam, BEAM))
    scaled = wp.clamp((noisy_m - near_m) / (far_m - near_m), wp.float64(0.0), wp.float64(1.0))
    observation[robot, beam] = wp.float32(scaled)
    if beam == 0:
        beams = ranges.shape[1]
        observation[robot, beams] = previous[robot, 0]
        observation[robot, beams + 1] = 0.0
        observation[robot, beams + 2] = previous[robot, 1]


@wp.kernel(enable_backward=False)
def describe_robots(
    frame: MineFrame,
    edges_m: wp.array[wp.float64],
    wheel_m: wp.float64,
    total: int,
    qpos: wp.array2d[float],
    cells_seen: wp.array[int],
    pose: wp.array2d[float],
    height: wp.array[float],
    pitch: wp.array[float],
    roll: wp.array[float],
    zone: wp.array[int],
    coverage: wp.array[float],
):
    """Write every robot's pose (x, y in m and yaw in rad, mine frame), floor zone and coverage, a thread a robot.

    Height (m) is that of the floor under wheels of radius `wheel_m`; pitch, nose up, and roll, left side up, are
    against the level (rad), as in `RobotBatch`.
    """
    robot = wp.tid()
    place = body_place(frame, qpos, robot)
    rotation = body_rotation(qpos, robot)
    axes = wp.transpose(frame.rotation) * rotation
    one = wp.float64(1.0)
    height[robot] = wp.float32(place[2] - wheel_m)
    pitch[robot] = wp.float32(wp.asin(wp.clamp(rotation[2, 0], -one, one)))
    roll[robot] = wp.float32(wp.asin(wp.clamp(rotation[2, 1], -one, one)))
    pose[robot, 0] = wp.float32(place[0])
    pose[robot, 1] = wp.float32(place[1])
    pose[robot, 2] = wp.float32(wp.atan2(axes[1, 0], axes[0, 0]))
    zone[robot] = zone_at(edges_m, place[0])
    coverage[robot] = wp.float32(wp.float64(cells_seen[robot]) / wp.float64(total))


@wp.kernel(enable_backward=False)
def find_failures(qpos: wp.array2d[float], fault: wp.array[int]):
    """Note the robots whose physics gave a number that is not finite, a thread a robot."""
    robot = wp.tid()
    if not is_finite(qpos, robot):
        fault[robot] = fault[robot] | NOT_FINITE
