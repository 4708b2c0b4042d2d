"""An episode step by step, with what its sensors read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from minexplore.envs.env import MineEnv
from minexplore.extra.record.policies import Drive
from minexplore.sensing.mount import Pose3D


@dataclass(frozen=True)
class SensedStep:
    """One control step.

    `robot` is the true pose in the mine frame, its origin on the floor under the robot's middle; `counted` that which
    its wheels count, level, or of a robot without wheels the true one. `speed_mps` (3,), ahead, left and up, and
    `turn_radps` are the twist of that pose, means of the step. `readings` holds the sensors' by name; it is empty in
    the steps between two looks.
    """

    time_ns: int
    robot: Pose3D
    counted: Pose3D
    speed_mps: np.ndarray
    turn_radps: float
    readings: dict[str, Any]
    coverage: float


def frames_of(
    env: MineEnv, drive: Drive, sensors: Sequence[str], steps: int, seed: int, every: int = 1, true_pose: bool = True
) -> Iterator[SensedStep]:
    """Drive an episode and yield its frames, the first before the first step.

    Parameters
    ----------
    env : MineEnv
        Made with `pose="odometry"` if it has wheels, and without `sensors`: those are read here, one look in `every`
        steps.
    drive : Drive
    true_pose : bool
        Whether the policy gets the true pose; else that which the wheels count.
    """
    step_ns = round(1e9 * env.task.control_s)
    observation, info = env.reset(seed=seed)
    yaw, wheels = info["pose_m_rad"][2], "true_pose_m_rad" in info
    last: Pose3D | None = None
    for step in range(steps + 1):
        if step:
            given = {**info, "pose_m_rad": info["true_pose_m_rad"]} if true_pose and wheels else info
            observation, _, *ends, info = env.step(drive(observation, given))
        looks = sensors if step % every == 0 else ()
        counted = level_pose(info["pose_m_rad"]) if wheels else env.suite.pose()
        turn = float((info["pose_m_rad"][2] - yaw + np.pi) % (2 * np.pi) - np.pi)
        yield SensedStep(
            time_ns=step * step_ns,
            robot=env.suite.pose(),
            counted=counted,
            speed_mps=moved_between(last or counted, counted) / env.task.control_s,
            turn_radps=turn / env.task.control_s,
            readings={name: env.capture(name) for name in looks},
            coverage=float(info["coverage"]),
        )
        yaw, last = info["pose_m_rad"][2], counted
        if step and any(ends):
            return


def moved_between(before: Pose3D, after: Pose3D) -> np.ndarray:
    """Return the way (3,) m from one pose to another, in the axes halfway between theirs."""
    halfway = before.axes + after.axes
    way: np.ndarray = (halfway / np.linalg.norm(halfway, axis=0)).T @ (after.place_m - before.place_m)
    return way


def level_pose(pose_m_rad: np.ndarray) -> Pose3D:
    """Return the pose of x, y, m, and yaw, rad, at the height 0."""
    x, y, yaw = map(float, pose_m_rad)
    cos, sin = np.cos(yaw), np.sin(yaw)
    return Pose3D(np.array([x, y, 0.0]), np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]]))


def inverse(pose: Pose3D) -> Pose3D:
    """Return the pose of the outer frame in the inner one."""
    return Pose3D(-pose.axes.T @ pose.place_m, pose.axes.T)


def composed(outer: Pose3D, inner: Pose3D) -> Pose3D:
    """Return the pose of `inner`, which is in the frame of `outer`, in the frame that `outer` is in."""
    return Pose3D(outer.place_m + outer.axes @ inner.place_m, outer.axes @ inner.axes)
