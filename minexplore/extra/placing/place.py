"""Any MJCF robot in any world: rock round it, a place to stand or to hover, and contacts and options that agree."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from minexplore.bundle import MINE_BODY, line_of
from minexplore.extra.placing.anchors import add_ties, moved_poses, take_ties
from minexplore.extra.placing.robot_file import RobotFile, RobotStance, read_robot
from minexplore.extra.placing.sites import Pose, Site, site_of
from minexplore.limits import Span
from minexplore.physics.robot import ROCK_BODY
from minexplore.rotations import quaternion
from minexplore.world import World, find_world, load_world

SPAWN, REPORT = "spawn", "placement"  # the keyframe, and the text with what differs, of a placed robot's model
_GAP_M = 0.005  # between a robot that stands and the floor; contacts begin below that
_DEEP_M = 0.01  # a robot that reaches so far into rock does not fit
_BESIDE_M = 1.0  # of the rock that a spawn is tried in
_REACH = Span(0.1, math.inf)


class PlacementWarning(UserWarning):
    """What differs between a robot in its own file and the same robot in a mine."""


def place(
    world: World | str | Path,
    robot: str | Path | mujoco.MjSpec,
    pose: Pose | tuple[float, ...],
    *,
    keyframe: str | None = None,
    reach_m: float = 25.0,
    prefix: str = "robot/",
) -> mujoco.MjSpec:
    """Return the spec of a robot of any MJCF file in a world, to be changed or compiled.

    Its keyframe `spawn` is the robot at the pose; its text `placement` holds what differs from the robot's own file,
    which a `PlacementWarning` lists too.

    Parameters
    ----------
    world : World, str or Path
        As `minexplore.load` returns it; or a bundle's folder or the name of a world.
    robot : str, Path or mujoco.MjSpec
        An MJCF file, or `menagerie:NAME` for one of MuJoCo Menagerie. The file's own floor and lights are left out.
    pose : Pose or tuple
        `(x, y, yaw)`, m and rad, mine frame: the robot stands on the floor. `(x, y, yaw, z)`: it hovers. `Pose` says
        which floor where there are several.
    keyframe : str, optional
        Of the robot's file: how it stands. Its first one by default, or where it has none its `qpos0`.
    reach_m : float
        How far from the pose the model holds rock, m; `math.inf` for the whole mine. Beyond it there is no floor.
    prefix : str
        Of all the robot's names.

    Raises
    ------
    ValueError
        If the robot cannot be read or does not fit at the pose, or a parameter is refused.
    FileNotFoundError
        If there is no such world or file.
    BundleError
        If the world is not what its hashes or tables say.
    """
    if not _REACH.accepts(reach_m):
        raise ValueError(f"place: reach_m = {reach_m!r}: want {_REACH}")
    if not isinstance(prefix, str) or not prefix:
        raise ValueError(f"place: prefix = {prefix!r}: want a text that the robot's names begin with")
    if not isinstance(pose, Pose):
        pose = _pose_of(pose)
    world = world if isinstance(world, World) else load_world(find_world(world))
    file = read_robot(robot)
    file.settle_masses()
    file.drop_scenery()
    stance = file.stance(keyframe)
    site = site_of(world)
    T_world_robot = site.T_world_mine @ _stand(site, stance, pose)
    near = _compose(site, _copy(file), stance, T_world_robot, stance.radius_m + _BESIDE_M, prefix)
    near.compiler.discardvisual = True  # its meshes take longest
    _require_room(world, near, file, pose, stance)
    spec = _compose(site, file, stance, T_world_robot, reach_m, prefix)
    spec.modelname = f"{file.name} in {world.record['name']}"
    report = "; ".join(file.changes)
    spec.add_text(name=REPORT, data=report)
    warnings.warn(f"{file.name}: {report}", PlacementWarning, stacklevel=2)
    return spec


def _pose_of(pose: Any) -> Pose:
    if not isinstance(pose, tuple | list | np.ndarray) or len(pose) not in (2, 3, 4):
        raise ValueError(f"pose = {pose!r:.100}: want (x, y), (x, y, yaw) or (x, y, yaw, z), m and rad")
    return Pose(*pose)


def _copy(file: RobotFile) -> RobotFile:
    return replace(file, spec=file.spec.copy(), changes=[])


def _stand(site: Site, stance: RobotStance, pose: Pose) -> np.ndarray:
    """Return T_mine_robot (4, 4): from the frame of the robot's file into the mine frame."""
    ahead = np.array([math.cos(pose.yaw_rad), math.sin(pose.yaw_rad), 0.0])
    foot, normal = site.floor_at(pose)
    if pose.hovers:
        up = site.T_world_mine[2, :3]  # of the world, in the mine frame: a mine may dip
        foot, turn, lift = np.array([pose.x_m, pose.y_m, pose.z_m]), _upright(up, ahead), 0.0
    else:
        turn = _upright(normal, ahead)
        lift = _GAP_M + site.rise(stance, foot, turn)
    T_mine_robot = np.eye(4)
    T_mine_robot[:3, :3] = turn
    T_mine_robot[:3, 3] = foot + turn @ [-stance.origin_m[0], -stance.origin_m[1], lift - stance.low_m[2]]
    return T_mine_robot


def _upright(up: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """Return the axes (3, 3), as columns, of what stands along `up` and faces `ahead`, made square to it."""
    level = ahead - (ahead @ up) * up
    level = level / np.linalg.norm(level)
    return np.column_stack([level, np.cross(up, level), up])


def _compose(
    site: Site, file: RobotFile, stance: RobotStance, T_world_robot: np.ndarray, reach_m: float, prefix: str
) -> mujoco.MjSpec:
    """Return the spec of the rock within reach and the robot at a transform of its file's frame."""
    root = T_world_robot @ [*stance.origin_m, stance.low_m[2], 1.0]
    here = (root[:3] - site.T_world_mine[:3, 3]) @ site.T_world_mine[:3, :3]
    spec = site.rock(here, reach_m)
    file.take_options(spec)
    file.meet(spec.geoms)
    file.prepare_to_join(spec)
    ties = take_ties(file.spec, file.name)
    quat = quaternion(T_world_robot[:3, :3])
    frame = spec.worldbody.add_frame(pos=T_world_robot[:3, 3], quat=quat)
    spec.attach(file.spec, prefix=prefix, frame=frame)
    add_ties(spec, ties, T_world_robot, prefix)
    qpos = stance.qpos.copy()
    for at in stance.free:
        qpos[at : at + 3] = T_world_robot[:3, :3] @ qpos[at : at + 3] + T_world_robot[:3, 3]
        mujoco.mju_mulQuat(qpos[at + 3 : at + 7], quat, stance.qpos[at + 3 : at + 7])
    mpos, mquat = moved_poses(stance.mocap_m, stance.mocap_quat, T_world_robot)
    mocap = {"mpos": mpos.ravel(), "mquat": mquat.ravel()} if len(mpos) else {}
    spec.add_key(name=SPAWN, qpos=qpos, ctrl=stance.ctrl, act=stance.act, **mocap)
    return spec


def _require_room(world: World, spec: mujoco.MjSpec, file: RobotFile, pose: Pose, stance: RobotStance) -> None:
    """Refuse a pose at which the robot reaches into rock or floor."""
    try:
        model = spec.compile()
    except ValueError as error:
        name = f"{file.name} in {world.record['name']}"
        raise ValueError(f"robot: {name}: MuJoCo does not compile the two: {line_of(error)}") from error
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(SPAWN).id)
    mujoco.mj_forward(model, data)
    mine = {model.body(MINE_BODY).id, model.body(ROCK_BODY).id}
    for contact in data.contact[: data.ncon]:
        rock = [model.geom(geom).name for geom in contact.geom if model.geom_bodyid[geom] in mine]
        if len(rock) == 1 and contact.dist < -_DEEP_M:
            place, radius = f"({pose.x_m:g}, {pose.y_m:g})", f"{stance.radius_m:.2f}"
            raise ValueError(
                f"pose: (x, y) = {place}: {file.name} reaches {-contact.dist:.2f} m into {rock[0]}; want a place with "
                f"{radius} m round it, such as one of World.places_m({radius})"
            )
