"""The paper's reward and the ends of episodes; `minexplore.tasks.exploration` is the reference."""

import numpy as np
import warp as wp

from minexplore.extra.warp.kernels.faults import NOT_FINITE, OUTSIDE
from minexplore.extra.warp.kernels.frames import MineFrame
from minexplore.tasks.exploration import COLLISION_PENALTY, COVERAGE_GAIN, IDLE_PENALTY, MILESTONES

_GAIN, _IDLE, _HIT = (wp.constant(wp.float64(x)) for x in (COVERAGE_GAIN, IDLE_PENALTY, COLLISION_PENALTY))


def milestone_arrays(total: int) -> tuple[wp.array, wp.array]:
    """Return the cells at which milestones lie, and what each pays, for `total` reachable cells."""
    cells = np.array([share * total for share, _ in MILESTONES])
    bonus = np.array([pays for _, pays in MILESTONES])
    return wp.array(cells, dtype=wp.float64), wp.array(bonus, dtype=wp.float64)


@wp.kernel(enable_backward=False)
def score_steps(
    frame: MineFrame,
    total: int,
    lines: wp.array[wp.float64],
    bonus: wp.array[wp.float64],
    max_steps: int,
    stall_steps: int,
    stall_speed_mps: wp.float64,
    max_forward_mps: wp.float64,
    drives: wp.array[bool],
    qvel: wp.array2d[float],
    previous: wp.array2d[float],
    gained: wp.array[int],
    touched: wp.array[bool],
    fault: wp.array[int],
    cells_seen: wp.array[int],
    steps: wp.array[int],
    stalled: wp.array[int],
    collisions: wp.array[int],
    reward: wp.array[float],
    truncated: wp.array[bool],
):
    """Give robots that drove their rewards and end their episodes, a thread a robot; the others get 0 and no end.

    An episode also ends where the physics failed, so that the next reset mends it; `fault` marks it.
    """
    robot = wp.tid()
    if not drives[robot]:
        reward[robot] = 0.0
        truncated[robot] = False
        return
    before = cells_seen[robot]
    after = before + gained[robot]
    value = -_IDLE
    if after > before:
        value = wp.float64(after - before) * _GAIN / wp.float64(total)
    for k in range(lines.shape[0]):
        if wp.float64(before) < lines[k] and wp.float64(after) >= lines[k]:
            value = value + bonus[k]
    if touched[robot]:
        value = value - _HIT
        collisions[robot] = collisions[robot] + 1
    reward[robot] = wp.float32(value)
    cells_seen[robot] = after
    steps[robot] = steps[robot] + 1
    along = wp.transpose(frame.rotation) * wp.vec3d(
        wp.float64(qvel[robot, 0]), wp.float64(qvel[robot, 1]), wp.float64(qvel[robot, 2])
    )
    speed = wp.sqrt(along[0] * along[0] + along[1] * along[1])
    commanded = max_forward_mps * wp.abs(wp.float64(previous[robot, 0]))
    if wp.min(speed, commanded) < stall_speed_mps:
        stalled[robot] = stalled[robot] + 1
    else:
        stalled[robot] = 0
    failed = (fault[robot] & (NOT_FINITE | OUTSIDE)) != 0
    truncated[robot] = steps[robot] >= max_steps or stalled[robot] >= stall_steps or failed
