"""Where a robot is in the mine frame, in 64 bits: physics gives 32 bits of the world frame."""

import warp as wp


@wp.struct
class MineFrame:
    """The mine frame in the world frame: the rotation and the origin (m) of `T_world_mine`."""

    rotation: wp.mat33d
    origin: wp.vec3d


@wp.func
def body_rotation(qpos: wp.array2d[float], robot: int) -> wp.mat33d:
    """Return the rotation of a robot's body in the world frame."""
    w = wp.float64(qpos[robot, 3])
    x = wp.float64(qpos[robot, 4])
    y = wp.float64(qpos[robot, 5])
    z = wp.float64(qpos[robot, 6])
    two = wp.float64(2.0)
    return wp.mat33d(
        w * w + x * x - y * y - z * z, two * (x * y - w * z), two * (x * z + w * y),
        two * (x * y + w * z), w * w - x * x + y * y - z * z, two * (y * z - w * x),
        two * (x * z - w * y), two * (y * z + w * x), w * w - x * x - y * y + z * z,
    )  # fmt: skip


@wp.func
def body_place(frame: MineFrame, qpos: wp.array2d[float], robot: int) -> wp.vec3d:
    """Return the place (m, mine frame) of a robot's body."""
    place = wp.vec3d(wp.float64(qpos[robot, 0]), wp.float64(qpos[robot, 1]), wp.float64(qpos[robot, 2]))
    return wp.transpose(frame.rotation) * (place - frame.origin)


@wp.func
def is_finite(qpos: wp.array2d[float], robot: int) -> bool:
    """Return whether the seven numbers of a robot's free joint are finite."""
    total = float(0.0)
    for k in range(7):
        total += wp.abs(qpos[robot, k])
    return wp.isfinite(total)
