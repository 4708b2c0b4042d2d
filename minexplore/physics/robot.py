"""A differential-drive robot: a disc on two driven wheels and two castors, in MJCF."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from minexplore.bundle import GeomGroup, is_floor, is_rock, is_roof, is_rough_floor
from minexplore.limits import Span, check_numbers
from minexplore.physics.robot_kind import LAMP_ABOVE_M, DrivenRobot, Robot
from minexplore.rotations import quaternion, rotate_inverse

ROCK_BODY = "rock"  # of a physics model; it holds what a chassis collides with
_HIDDEN_GROUP = GeomGroup.SMOOTH_SURFACE  # no viewer shows it unless asked
CASTOR_M = 0.05  # radius
_CASTOR_GAP_M = 0.001  # under a castor on a level floor: the wheels carry the robot, and it leans by at most 0.22 deg
# Of a castor on a floor with heights; the robot weighs 490 N. On a ramp of 12 % it bears 50 N and does not give. Where
# two facets meet at 8 deg both castors are 20 mm up and leave the wheels half of the weight. The damping bounds the
# lean when a robot brakes: with 100 N s/m it is 7.7 deg at most, with 4,000 it is 1.2. MuJoCo's contacts do not see the
# damping, which in a step of 5 ms is as heavy as 20 kg. Beside a castor of 1 kg they were too soft: a robot on a bend
# rocked at 7 Hz and crept by 2.5 mm/s. With 20 kg on the spring, which no floor bears, it rests.
_PRELOAD_N, _STIFFNESS_NPM, _DAMPING_NSPM, _TRAVEL_M = 100.0, 1000.0, 4000.0, 0.03
_ARMATURE_KG = 20.0
# MuJoCo's friction creeps by 5 mm/s on a ramp of 12 %; with these by 0.8 mm/s, of which 0.7 are the wheels' servos.
_IMPRATIO, _FIRM = 10.0, (0.99, 0.99, 0.001, 0.5, 2.0)
_SPANS = {
    "radius_m": Span(0.06, 5.0),  # more than a castor's
    "height_m": Span(0.01, 5.0),
    "ground_clearance_m": Span(0.0, 5.0),
    "mass_kg": Span(0.1, 100_000.0),
    "wheel_radius_m": Span(0.01, 5.0),
    "wheel_base_m": Span(0.01, 10.0),
    "wheel_width_m": Span(0.001, 5.0),
    "wheel_torque_nm": Span(0.001, 1_000_000.0),
    "wheel_gain_nms": Span(0.001, 1_000_000.0),
    "wheel_friction_nm": Span(0.0, 100_000.0),
    "sensor_height_m": Span(0.0, 20.0),
    "scanner_radius_m": Span(0.001, 5.0),
    "scanner_height_m": Span(0.001, 5.0),
}
ROCK_BIT, FLOOR_BIT, ROBOT_BIT = 1, 2, 4  # of contype and conaffinity
FASTEST_FALL_MPS = 3.0  # MuJoCo's contacts are soft: after 20 m of free fall a robot passes through a floor of 0.25 m


@dataclass(frozen=True)
class RobotParams(DrivenRobot):
    """The robot's measures, by default those of a Clearpath Husky A200 where the paper gives none.

    `radius_m` is the paper's authors' disc. `mass_kg` and the clearance are of the Husky A200 User Manual, the wheels'
    measures of its URDF, `wheel_base_m` of the dataset. `wheel_torque_nm` is what each side needs on the manual's
    steepest grade of 45 deg: m g sin(45 deg) r / 2. `wheel_friction_nm`, the drive train's dry friction, is assumed: it
    holds the robot on a slope of 5.6 deg by itself. The scanner's measures are taken as a VZ-400's, not verified.
    """

    radius_m: float = 0.35
    height_m: float = 0.24
    ground_clearance_m: float = 0.13
    mass_kg: float = 50.0
    wheel_radius_m: float = 0.1651
    wheel_base_m: float = 0.545
    wheel_width_m: float = 0.1143
    wheel_torque_nm: float = 30.0
    wheel_gain_nms: float = 200.0
    wheel_friction_nm: float = 4.0
    sensor_height_m: float = 0.5
    scanner_radius_m: float = 0.09
    scanner_height_m: float = 0.31

    def __post_init__(self) -> None:
        """Refuse measures that make no robot."""
        check_numbers("robot", self, _SPANS)
        top_m = self.ground_clearance_m + self.height_m
        if self.sensor_height_m + self.scanner_height_m / 2 <= top_m:
            raise ValueError(
                f"robot: sensor_height_m = {self.sensor_height_m}: the scanner ends below the chassis, whose top is "
                f"{top_m:g} m above the floor"
            )

    @property
    def lamp_height_m(self) -> float:
        """Return how high a headlamp is above the origin of the robot's body: on top of the scanner."""
        return self.sensor_height_m + self.scanner_height_m / 2 - self.wheel_radius_m + LAMP_ABOVE_M

    def wheel_speeds(self, forward_mps: np.ndarray, turn_radps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return left and right wheel speeds, rad/s, of twists."""
        half = turn_radps * self.wheel_base_m / 2
        return (forward_mps - half) / self.wheel_radius_m, (forward_mps + half) / self.wheel_radius_m

    def controls(self, forward_mps: np.ndarray, turn_radps: np.ndarray) -> np.ndarray:
        """Return the actuators' controls (k, actuators) of twists (k,); another robot overrides this and `attach`."""
        found = np.empty((len(forward_mps), 2))
        found[:, 0], found[:, 1] = self.wheel_speeds(forward_mps, turn_radps)
        return found

    def attach(self, spec: mujoco.MjSpec, name: str) -> None:
        """Add the robot to a world; see `attach_robot` for the names that the environment expects."""
        attach_robot(spec, name, self)


def attach_robot(spec: mujoco.MjSpec, name: str, params: RobotParams) -> None:
    """Add a robot to a world: body, free joint, two wheels with velocity servos, castors, and a sensor site.

    The chassis touches rock, a bumper other robots, wheels and castors the floor: the disc is wider than the wheels,
    and no pair is tested that cannot meet.
    """
    body = spec.worldbody.add_body(name=name)
    body.add_freejoint(name=f"{name}_free")
    middle = params.ground_clearance_m + params.height_m / 2 - params.wheel_radius_m
    body.add_geom(
        name=f"{name}_chassis",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[params.radius_m, params.height_m / 2, 0],
        pos=[0, 0, middle],
        mass=params.mass_kg * 0.8,
        group=GeomGroup.ROBOT,
        contype=0,
        conaffinity=ROCK_BIT,
        friction=[0.5, 0.005, 0.0001],
        rgba=[0.85, 0.65, 0.1, 1],
    )
    # Robots meet as spheres of the disc's radius: in MuJoCo 3.17 two upright cylinders side by side touch at one point,
    # and jump up with energy that they had not: findings/mujoco-upright-cylinders-throw-each-other.sh.
    body.add_geom(
        name=f"{name}_bumper",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[params.radius_m, 0, 0],
        pos=[0, 0, middle],
        mass=0,
        group=_HIDDEN_GROUP,
        contype=ROBOT_BIT,
        conaffinity=ROBOT_BIT,
        friction=[0.5, 0.005, 0.0001],
    )
    for side, y in (("left", params.wheel_base_m / 2), ("right", -params.wheel_base_m / 2)):
        wheel = body.add_body(name=f"{name}_{side}", pos=[0, y, 0])
        wheel.add_joint(
            name=f"{name}_{side}",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0, 1, 0],
            armature=0.05,
            frictionloss=params.wheel_friction_nm,
        )
        # The sphere touches the floor where a thin wheel would, by an analytic test. The cylinder is what is drawn.
        wheel.add_geom(
            name=f"{name}_{side}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[params.wheel_radius_m, 0, 0],
            mass=params.mass_kg * 0.1,
            group=_HIDDEN_GROUP,
            contype=0,
            conaffinity=FLOOR_BIT,
            friction=[1.0, 0.005, 0.0001],
        )
        wheel.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[params.wheel_radius_m, params.wheel_width_m / 2, 0],
            quat=[math.sqrt(0.5), math.sqrt(0.5), 0, 0],
            mass=0,
            group=GeomGroup.ROBOT,
            contype=0,
            conaffinity=0,
            rgba=[0.1, 0.1, 0.1, 1],
        )
        motor = spec.add_actuator(
            name=f"{name}_{side}",
            target=f"{name}_{side}",
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            forcerange=[-params.wheel_torque_nm, params.wheel_torque_nm],
            forcelimited=True,
        )
        motor.set_to_velocity(kv=params.wheel_gain_nms)
    castor = CASTOR_M
    # Frictionless by dimension: with friction near zero a castor on the border of two zones makes the solver diverge.
    for end, x in (("front", params.radius_m - castor), ("rear", castor - params.radius_m)):
        body.add_geom(
            name=f"{name}_{end}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[castor, 0, 0],
            pos=[x, 0, castor - params.wheel_radius_m + _CASTOR_GAP_M],
            mass=0.1,
            group=GeomGroup.ROBOT,
            contype=0,
            conaffinity=FLOOR_BIT,
            priority=2,
            condim=1,
            rgba=[0.1, 0.1, 0.1, 1],
        )
    # The scanner on its mast is what other robots' beams hit: they pass over the chassis.
    top = params.ground_clearance_m + params.height_m - params.wheel_radius_m
    reach = params.sensor_height_m - params.wheel_radius_m + params.scanner_height_m / 2
    body.add_geom(
        name=f"{name}_scanner",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[params.scanner_radius_m, (reach - top) / 2, 0],
        pos=[0, 0, (reach + top) / 2],
        mass=0,
        group=GeomGroup.ROBOT,
        contype=0,
        conaffinity=0,
        rgba=[0.2, 0.3, 0.4, 1],
    )
    body.add_site(name=f"{name}_lidar", pos=[0, 0, params.sensor_height_m - params.wheel_radius_m], group=_HIDDEN_GROUP)


def stand_on_facets(spec: mujoco.MjSpec, name: str) -> None:
    """Let a robot stand on a floor with heights: its wheels bear on every facet, and its friction holds.

    Facets meet at ridges and valleys. Rigid castors lift both wheels there, and as castors have no friction the robot
    slides, so that here they are sprung. A level floor has no facets, and robots on it keep the physics that results
    were measured with.
    """
    spec.option.impratio = _IMPRATIO
    for end in ("front", "rear"):
        castor = spec.geom(f"{name}_{end}")
        if castor is not None:  # another robot may have none
            _spring(spec, castor)
    for side in ("left", "right"):
        wheel = spec.joint(f"{name}_{side}")
        if wheel is not None:
            wheel.solimp_friction = _FIRM


def _spring(spec: mujoco.MjSpec, castor: mujoco.MjsGeom) -> None:
    """Put a castor on a preloaded spring: it gives way upwards only under more than the preload."""
    arm = castor.parent.add_body(name=castor.name, pos=castor.pos)
    arm.add_joint(
        name=castor.name,
        type=mujoco.mjtJoint.mjJNT_SLIDE,
        axis=[0, 0, 1],
        limited=True,
        range=[0, _TRAVEL_M],
        stiffness=[_STIFFNESS_NPM, 0, 0],
        springref=-_PRELOAD_N / _STIFFNESS_NPM,
        damping=[_DAMPING_NSPM, 0, 0],
        armature=_ARMATURE_KG,
    )
    sprung = {
        key: getattr(castor, key) for key in ("name", "type", "size", "mass", "group", "priority", "condim", "rgba")
    }
    contacts = {"contype": castor.contype, "conaffinity": castor.conaffinity}
    spec.delete(castor)
    arm.add_geom(**sprung, **contacts)


def separate_contacts(spec: mujoco.MjSpec) -> None:
    """Give floor and rock geoms the contact bits that robots expect."""
    for geom in spec.geoms:
        if is_floor(geom.name) or is_rough_floor(geom.name):
            geom.contype, geom.conaffinity = FLOOR_BIT, 0
        elif is_rock(geom.name) or is_roof(geom.name):
            geom.contype, geom.conaffinity = ROCK_BIT, 0


def free_joint_qpos(T_world_mine: np.ndarray, params: Robot, x_m: float, y_m: float, yaw_rad: float) -> np.ndarray:
    """Return the free joint's place (m) and quaternion (7,), world frame, of a robot at a pose of a level floor."""
    return pose_on(T_world_mine, params, np.array([x_m, y_m, 0.0]), np.eye(3), yaw_rad)


def pose_on(
    T_world_mine: np.ndarray, params: Robot, place_m: np.ndarray, axes: np.ndarray, yaw_rad: float
) -> np.ndarray:
    """Return the free joint's place (m) and quaternion (7,), world frame, of a robot on a floor.

    `place_m` (3,) m is on the floor, mine frame; `axes` (3, 3) are, as columns, ahead at no yaw, left, and the normal.
    """
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)  # NumPy's differ between processors in the last digit
    turn = rotate_inverse(axes, np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]]))
    stand = place_m + params.wheel_radius_m * axes[:, 2]
    place = rotate_inverse(stand[None], T_world_mine[:3, :3].T)[0] + T_world_mine[:3, 3]
    return np.concatenate([place, quaternion(rotate_inverse(T_world_mine[:3, :3], turn))])


def qpos_address(model: mujoco.MjModel, name: str, joints: tuple[str, ...] = RobotParams.JOINTS) -> np.ndarray:
    """Return where a robot's numbers stand in `qpos`: seven of its free joint, then one of each other joint."""
    free, *others = (int(model.joint(f"{name}_{joint}").qposadr[0]) for joint in joints)
    return np.array([*range(free, free + 7), *others])


def contact_sensor(spec: mujoco.MjSpec, name: str) -> None:
    """Add a sensor that counts contacts between a robot's chassis and the body that holds the rock."""
    spec.add_sensor(
        name=f"{name}_touches_rock",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_GEOM,
        objname=f"{name}_chassis",
        reftype=mujoco.mjtObj.mjOBJ_BODY,
        refname=ROCK_BODY,
        intprm=[1, 0, 1],
    )
