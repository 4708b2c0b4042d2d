"""What a robot is commanded, what the floor zone makes of it, and the wheels' speeds."""

import warp as wp

from minexplore.extra.warp.kernels.faults import BAD_ACTION
from minexplore.extra.warp.kernels.frames import MineFrame, body_place
from minexplore.extra.warp.kernels.philox import SPEED, draw, normal


@wp.func
def zone_at(edges_m: wp.array[wp.float64], east_m: wp.float64) -> int:
    """Return the number of the floor zone at an easting; `edges_m` are the zones' borders, west to east."""
    zone = int(0)
    for k in range(edges_m.shape[0]):
        if edges_m[k] <= east_m:
            zone = k + 1
    return zone


@wp.kernel(enable_backward=False)
def command_wheels(
    frame: MineFrame,
    edges_m: wp.array[wp.float64],
    zone_scale: wp.array[wp.float64],
    zone_noise_mps: wp.array[wp.float64],
    fastest: wp.vec2d,
    gains: wp.array2d[wp.float64],
    keys: wp.array2d[wp.uint32],
    drives: wp.array[bool],
    qpos: wp.array2d[float],
    action: wp.array2d[float],
    draws: wp.array[wp.uint32],
    previous: wp.array2d[float],
    touched: wp.array[bool],
    fault: wp.array[int],
    ctrl: wp.array2d[float],
):
    """Set the controls of robots, a thread a robot: an action in [-1, 1] becomes a twist, and that the wheels' speeds.

    `fastest` is what 1 means, m/s and rad/s; `gains` (controls, 2) are the controls of a unit twist. A robot that does
    not drive is given zero. An action that is not finite counts as zero, and as a fault.
    """
    robot = wp.tid()
    draws[robot] = draws[robot] + wp.uint32(1)
    touched[robot] = False
    forward = wp.float64(0.0)
    turn = wp.float64(0.0)
    if drives[robot]:
        for k in range(2):
            asked = action[robot, k]
            if not wp.isfinite(asked):
                fault[robot] = fault[robot] | BAD_ACTION
                asked = 0.0
            previous[robot, k] = wp.clamp(asked, -1.0, 1.0)
        zone = zone_at(edges_m, body_place(frame, qpos, robot)[0])
        forward = wp.float64(previous[robot, 0]) * fastest[0] * zone_scale[zone]
        forward = forward + zone_noise_mps[zone] * normal(draw(keys, draws, robot, 0, SPEED))
        turn = wp.float64(previous[robot, 1]) * fastest[1] * zone_scale[zone]
    for k in range(gains.shape[0]):
        ctrl[robot, k] = wp.float32(gains[k, 0] * forward + gains[k, 1] * turn)
