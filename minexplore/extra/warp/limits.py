"""What is refused on Warp: other robots, and a limit that was too small: which one, how large it is, and whose."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from minexplore.physics.robot import RobotParams
from minexplore.physics.robots import RobotChoice, find_robot

# Bits of `mujoco_warp.OverflowType`, and the limit of `mujoco_warp.make_data` that each is of. It sets a bit for every
# robot of a shared limit, whichever robot's contacts did not fit.
_SHARED = {4: "naconmax", 8: "naconmax", 16: "naccdmax"}
_OWN = {1: "njmax"}
_COUNTS = {
    "naconmax": "contacts of all robots together",
    "naccdmax": "pairs of convex geoms of all robots together",
    "njmax": "rows of constraints of one robot",
}


def default_robot(robot: RobotChoice) -> RobotParams:
    """Return the default robot's parameters; `ValueError` names another robot."""
    found = find_robot(robot)
    if not isinstance(found, RobotParams):
        want = "the environment on Warp drives the default robot only; want RobotParams(...) or a dict of its fields"
        raise ValueError(f"robot = {robot!r:.60}: {want}")
    return found


def overflow_message(bits: np.ndarray, limits: Mapping[str, int]) -> str | None:
    """Return what did not fit, or None if everything did.

    Parameters
    ----------
    bits : (robots,) int
        Of `mujoco_warp.OverflowType`, without those of iterations.
    limits : mapping of int by name
        `naconmax`, `naccdmax` and `njmax` as given to `mujoco_warp.make_data`.
    """
    every = int(np.bitwise_or.reduce(bits, initial=0))
    if not every:
        return None
    shared = dict.fromkeys(name for bit, name in _SHARED.items() if every & bit)
    if shared:
        full = " and ".join(f"{name} = {limits[name]:,} ({_COUNTS[name]})" for name in shared)
        return f"MuJoCo Warp: {full} did not hold all of a step, so contacts were left out; no single robot is at fault"
    robot = int(np.flatnonzero(bits)[0])
    own = [f"{name} = {limits[name]:,} ({_COUNTS[name]})" for bit, name in _OWN.items() if every & bit]
    what = own[0] if own else f"a limit of the overflow bits {int(bits[robot])}"
    return f"robot {robot}: MuJoCo Warp: {what} did not hold all of a step, so contacts were left out"
