"""What ties a robot's file to places of the world: welds and connects to it, mocap bodies in keyframes, soft bodies."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from minexplore.rotations import quaternion

_WORLD = ("", "world")
_TIES = (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD)
_KEPT = ("type", "objtype", "active", "solref", "solimp")


def take_ties(spec: mujoco.MjSpec, name: str) -> list[dict[str, Any]]:
    """Take the welds and connects of bodies with the world out of a robot's spec; `attach` would leave some behind.

    Raises
    ------
    ValueError
        If a flex has vertices in the world, which cannot be moved.
    """
    for flex in spec.flexes:
        if any(body in _WORLD for body in flex.vertbody):
            raise ValueError(f"robot: {name}: flex {flex.name!r} has vertices in the world; want them in a body")
    ties = []
    for tie in list(spec.equalities):
        if (
            tie.type in _TIES
            and tie.objtype == mujoco.mjtObj.mjOBJ_BODY
            and not {tie.name1, tie.name2}.isdisjoint(_WORLD)
        ):
            kept = {
                field: np.copy(value) if np.ndim(value) else value for field in _KEPT for value in [getattr(tie, field)]
            }
            ties.append({**kept, "name": tie.name, "ends": (tie.name1, tie.name2), "data": np.array(tie.data)})
            spec.delete(tie)
    return ties


def add_ties(spec: mujoco.MjSpec, ties: list[dict[str, Any]], T_world_robot: np.ndarray, prefix: str) -> None:
    """Give a spec the ties of a robot that stands in it at a transform of its file's frame.

    `attach` would leave some out: findings/mujoco-attach-drops-world-equalities.sh.
    """
    for tie in ties:
        fields = dict(tie)
        first, second = fields.pop("ends")
        fields["name"] = prefix + fields["name"] if fields["name"] else ""
        fields["data"] = _moved(fields["data"], fields["type"], first in _WORLD, T_world_robot)
        ends = ["world" if end in _WORLD else prefix + end for end in (first, second)]
        spec.add_equality(name1=ends[0], name2=ends[1], **fields)


def moved_poses(places: np.ndarray, quats: np.ndarray, T_world_robot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return places (n, 3) m and quaternions (n, 4) of the file's frame in the world frame."""
    turn, turned = quaternion(T_world_robot[:3, :3]), np.empty_like(quats)
    for own, found in zip(quats, turned, strict=True):
        mujoco.mju_mulQuat(found, turn, own)
    return places @ T_world_robot[:3, :3].T + T_world_robot[:3, 3], turned


def _moved(data: np.ndarray, kind: mujoco.mjtEq, begins_in_world: bool, T_world_robot: np.ndarray) -> np.ndarray:
    """Return the data of a tie whose world has moved: MuJoCo's `eq_data`, an anchor, then a weld's relative pose."""
    moved = data.copy()
    is_weld = kind == mujoco.mjtEq.mjEQ_WELD
    if begins_in_world != is_weld:  # the anchor of a connect is in the first body's frame, a weld's in the second's
        moved[:3] = T_world_robot[:3, :3] @ data[:3] + T_world_robot[:3, 3]
    if not is_weld or not data[6:10].any():  # MuJoCo then takes the relative pose of the initial configuration
        return moved
    turn = quaternion(T_world_robot[:3, :3])
    if begins_in_world:
        moved[3:6] = T_world_robot[:3, :3] @ data[3:6] + T_world_robot[:3, 3]
        mujoco.mju_mulQuat(moved[6:10], turn, data[6:10])
    else:  # the point in the first body stays, and the world has turned against it
        mujoco.mju_mulQuat(moved[6:10], data[6:10], turn * [1, -1, -1, -1])
    return moved
