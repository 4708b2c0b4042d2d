"""A robot of any MJCF file: what it is without its own scenery, how large it is, and what makes it meet rock."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from minexplore.bundle import line_of

MENAGERIE = "menagerie:"  # before the name of one of MuJoCo Menagerie's robots
_LISTED = 3  # names of either kind that a message lists
_BITS = 31  # of contype and conaffinity
# What a robot's gains were chosen with. Gravity and contacts are the mine's.
_OPTIONS = (
    *("timestep", "integrator", "cone", "impratio", "jacobian", "solver", "iterations", "tolerance"),
    *("ls_iterations", "ls_tolerance", "noslip_iterations", "noslip_tolerance", "ccd_iterations", "ccd_tolerance"),
    *("density", "viscosity", "wind", "magnetic", "sdf_iterations", "sdf_initpoints", "disableactuator"),
)
_SIZES = [f"nuser_{kind}" for kind in ("actuator", "body", "cam", "geom", "jnt", "sensor", "site", "tendon")]
_PICTURES = ("global_", "headlight", "map", "quality", "rgba", "scale")  # how a model is drawn
_NAMED = {"integrator": mujoco.mjtIntegrator, "cone": mujoco.mjtCone, "solver": mujoco.mjtSolver}
_WORLDS_FLAGS = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_GRAVITY
_WORLDS_ENABLED = int(mujoco.mjtEnableBit.mjENBL_OVERRIDE)  # one friction, margin and softness for all contacts


@dataclass(frozen=True)
class RobotStance:
    """How a robot stands in its own file: a keyframe's or the initial configuration, and the box about what collides.

    `low_m` and `high_m` (3,) are the corners of the box, `origin_m` (2,) the place of its first body, all in the file's
    frame. `free` are the addresses in `qpos` of the free joints of bodies without a parent. `mocap_m` (n, 3) and
    `mocap_quat` (n, 4) are the poses of mocap bodies.
    """

    name: str
    qpos: np.ndarray
    ctrl: np.ndarray
    act: np.ndarray
    low_m: np.ndarray
    high_m: np.ndarray
    origin_m: np.ndarray
    free: list[int]
    mocap_m: np.ndarray
    mocap_quat: np.ndarray

    @property
    def radius_m(self) -> float:
        """Return the radius of the upright cylinder about the origin that holds the box."""
        aside = np.maximum(np.abs(self.low_m[:2] - self.origin_m), np.abs(self.high_m[:2] - self.origin_m))
        return float(np.hypot(*aside))


@dataclass
class RobotFile:
    """A robot's spec, and what was changed in it, a sentence's part each."""

    spec: mujoco.MjSpec
    name: str
    changes: list[str] = field(default_factory=list)
    paired: set[str] = field(default_factory=set)  # geoms that met the scenery by pairs

    def settle_masses(self) -> None:
        """Give each body its share of a file's `settotalmass`, which an attached spec has no more.

        MuJoCo refuses to discard visual geoms with `inertiafromgeom="true"`; `"auto"` without inertials of bodies is
        the same.
        """
        compiler, bodies = self.spec.compiler, self.spec.bodies[1:]
        if compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
            compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
            for body in bodies:
                body.explicitinertial, body.ipos = False, [np.nan] * 3  # so that MuJoCo infers it
        if compiler.settotalmass <= 0:
            return
        try:
            for body in bodies:
                if body.geoms and not body.explicitinertial:
                    self.spec.adopt_inertial(body)
        except ValueError as error:
            raise ValueError(f"robot: {self.name}: MuJoCo does not compile it: {line_of(error)}") from error
        scale = compiler.settotalmass / max(sum(body.mass for body in bodies), mujoco.mjMINVAL)
        compiler.settotalmass = -1.0
        for body in bodies:
            body.mass *= scale
            body.inertia = body.inertia * scale
            body.fullinertia = body.fullinertia * scale

    def stance(self, keyframe: str | None) -> RobotStance:
        """Measure the robot in a keyframe; in its first one by default, or where it has none at its `qpos0`.

        Raises
        ------
        ValueError
            If there is no such keyframe, MuJoCo does not compile the robot, or nothing of it can collide.
        """
        try:
            model = self.spec.compile()
        except ValueError as error:
            raise ValueError(f"robot: {self.name}: MuJoCo does not compile it: {line_of(error)}") from error
        names = [model.key(k).name for k in range(model.nkey)]
        if keyframe is not None and keyframe not in names:
            raise ValueError(f"keyframe = {keyframe!r}: {self.name} has {', '.join(map(repr, names)) or 'none'}")
        data = mujoco.MjData(model)
        if names:
            mujoco.mj_resetDataKeyframe(model, data, names.index(keyframe) if keyframe is not None else 0)
        mujoco.mj_forward(model, data)
        bits, names_of = model.geom_contype | model.geom_conaffinity, [model.geom(g).name for g in range(model.ngeom)]
        solid = [g for g in range(model.ngeom) if bits[g] or names_of[g] in self.paired]
        if not solid:
            raise ValueError(f"robot: {self.name}: none of its geoms collides (contype and conaffinity are 0)")
        high = np.array([max(_support(model, data, g, way) for g in solid) for way in np.eye(3)])
        low = np.array([-max(_support(model, data, g, -way) for g in solid) for way in np.eye(3)])
        roots = [b for b in range(1, model.nbody) if model.body_parentid[b] == 0]
        if not roots:
            raise ValueError(f"robot: {self.name}: it has no body beside the world's; want at least one")
        free = [
            int(model.jnt_qposadr[j])
            for j in range(model.njnt)
            if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE and model.jnt_bodyid[j] in roots
        ]
        named = (keyframe or names[0]) if names else "qpos0"
        state = (data.qpos.copy(), data.ctrl.copy(), data.act.copy())
        origin_m, mocap = data.xpos[roots[0], :2].copy(), (data.mocap_pos.copy(), data.mocap_quat.copy())
        return RobotStance(named, *state, low, high, origin_m, free, *mocap)

    def drop_scenery(self) -> None:
        """Leave out what a file has round its robot: geoms and lights of the world itself, and pairs with such geoms.

        The other geom of such a pair then meets rock and floor by its bits.
        """
        world = self.spec.worldbody
        scenery = {geom.name for geom in world.geoms if geom.name}
        for pair in list(self.spec.pairs):
            ends = (pair.geomname1, pair.geomname2)
            if scenery.intersection(ends):
                self.paired |= set(ends) - scenery
                self.spec.delete(pair)
        left_out = [f"geom {geom.name}" for geom in world.geoms if geom.name][:_LISTED]
        left_out += [f"light {light.name}" for light in world.lights if light.name][:_LISTED]
        others = len(world.geoms) + len(world.lights) - len(left_out)
        left_out += [f"{others} other geoms or lights" if left_out else f"{others} geoms or lights"] if others else []
        for element in [*world.geoms, *world.lights]:
            self.spec.delete(element)
        if left_out:
            self.changes.append(f"left out of its file: {', '.join(left_out)}")

    def meet(self, ground: Iterable[Any]) -> None:
        """Give ground geoms a bit of `contype` that no geom of the robot uses, and the robot's that `conaffinity`.

        So all that collides at all meets rock and floor, and no two parts of the robot meet that did not before.

        Raises
        ------
        ValueError
            If the robot's geoms use all bits.
        """
        solid = [geom for geom in self.spec.geoms if geom.contype or geom.conaffinity or geom.name in self.paired]
        used = 0
        for geom in solid:
            used |= geom.contype | geom.conaffinity
        free = [1 << k for k in range(_BITS) if not used & (1 << k)]
        if not free:
            raise ValueError(f"robot: {self.name}: its geoms use all {_BITS} bits of contype and conaffinity")
        for geom in solid:
            geom.conaffinity |= free[0]
        for geom in ground:
            geom.contype, geom.conaffinity = free[0], 0
        self.changes.append(f"conaffinity of {len(solid)} geoms has bit {free[0]} beside their own, to meet the rock")

    def prepare_to_join(self, spec: mujoco.MjSpec) -> None:
        """Leave out the keyframes, which hold places of the file's frame, and take a spec's sizes and settings.

        MuJoCo warns of each setting of an attached spec that is not the other's, and keeps the other's.
        """
        for key in list(self.spec.keys):
            self.spec.delete(key)
        self.spec.nkey = spec.nkey
        for name in _SIZES:
            setattr(spec, name, getattr(self.spec, name))
        _copy_fields(spec.option, self.spec.option)
        for name in _PICTURES:
            _copy_fields(getattr(spec.visual, name), getattr(self.spec.visual, name))

    def take_options(self, spec: mujoco.MjSpec) -> None:
        """Give a spec the options that the robot's file has, and note in what the mine's differ."""
        own, differ = self.spec.option, []
        for name in _OPTIONS:
            theirs, ours = getattr(own, name), getattr(spec.option, name)
            if not np.array_equal(theirs, ours):
                differ.append(f"{name} {_as_text(name, theirs)} (environments: {_as_text(name, ours)})")
            setattr(spec.option, name, theirs)
        if differ:
            self.changes.append(f"its own solver options hold: {', '.join(differ)}")
        minds_own = own.disableflags & _WORLDS_FLAGS or own.enableflags & _WORLDS_ENABLED
        spec.option.disableflags |= own.disableflags & ~_WORLDS_FLAGS
        spec.option.enableflags |= own.enableflags & ~_WORLDS_ENABLED
        if minds_own or not np.allclose(own.gravity, spec.option.gravity):
            self.changes.append("gravity and contacts are the mine's")


def read_robot(robot: str | Path | mujoco.MjSpec) -> RobotFile:
    """Return a robot given as a spec, an MJCF file, or `menagerie:NAME` of MuJoCo Menagerie.

    Raises
    ------
    ValueError
        If MuJoCo does not read the file, or Menagerie has no such robot.
    ImportError
        If the package `mujoco-menagerie` is not installed.
    FileNotFoundError
        If there is no such file.
    """
    if isinstance(robot, mujoco.MjSpec):
        return RobotFile(robot.copy(), robot.modelname or "robot")
    if not isinstance(robot, str | Path):
        raise ValueError(f"robot = {robot!r:.100}: want an MJCF file, an mujoco.MjSpec, or {MENAGERIE}NAME")
    path = _menagerie_file(str(robot)) if str(robot).startswith(MENAGERIE) else Path(robot)
    if not path.is_file():
        raise FileNotFoundError(f"robot = {str(robot)!r}: no such file")
    try:
        return RobotFile(mujoco.MjSpec.from_file(str(path)), path.stem)
    except ValueError as error:
        raise ValueError(f"robot = {str(path)!r}: MuJoCo does not read it: {line_of(error)}") from error


def _menagerie_file(name: str) -> Path:
    """Return the file of one of Menagerie's robots alone; `MENAGERIE_ROOT` names a checkout, see its package."""
    try:
        import mujoco_menagerie
    except ImportError as error:
        raise ImportError(f"robot = {name!r} needs mujoco-menagerie: pip install mujoco-menagerie") from error
    try:
        found = mujoco_menagerie.get(name.removeprefix(MENAGERIE))
        return Path(found.xml(found.default_model))
    except mujoco_menagerie.MenagerieError as error:
        raise ValueError(f"robot = {name!r}: {line_of(error)}") from error


def _copy_fields(source: Any, target: Any) -> None:
    for name in dir(source):
        if not name.startswith("_"):
            setattr(target, name, getattr(source, name))


def _as_text(name: str, value: Any) -> str:
    if name in _NAMED:
        return _NAMED[name](value).name.partition("_")[2]
    return f"{value:g} s" if name == "timestep" else " ".join(f"{number:g}" for number in np.atleast_1d(value))


def _support(model: mujoco.MjModel, data: mujoco.MjData, geom: int, way: np.ndarray) -> float:
    """Return how far (m) a geom reaches along a unit vector (3,) of the world frame, from its origin."""
    turn, size, kind = data.geom_xmat[geom].reshape(3, 3), model.geom_size[geom], mujoco.mjtGeom(model.geom_type[geom])
    along = way @ turn  # of the geom's axes
    across = np.sqrt(max(0.0, 1.0 - along[2] ** 2))
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        reach = size[0]
    elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        reach = size[0] + size[1] * abs(along[2])
    elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        reach = size[0] * across + size[1] * abs(along[2])
    elif kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        reach = np.linalg.norm(along * size)
    elif kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.mesh(int(model.geom_dataid[geom]))
        vertices = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]]
        reach = (vertices @ along).max()
    else:  # a box, or the box about anything else
        centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
        reach = along @ centre + np.abs(along) @ half
    return float(way @ data.geom_xpos[geom] + reach)
