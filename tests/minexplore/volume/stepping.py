"""A volume and its shell as a world, without files, and robots that are thrown in it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from minexplore.floors.floor_zones import FloorZone
from minexplore.floors.volume_arrays import WAYS, FloorSpans, Parts, VolumeArrays, VolumeFacets
from minexplore.physics.robot import RobotParams
from minexplore.physics.robot_kind import DrivenRobot
from minexplore.physics.stepper import PhysicsStepper
from minexplore.rotations import rotation_matrices
from minexplore.task import TaskParams
from minexplore.volume.choice import PlaneChooser, StepChoice
from minexplore.volume.columns import FloorColumns
from minexplore.volume.creases import Creases
from minexplore.volume.models import EXACT_TILE_M, FEET, VolumeModels, code_of
from minexplore.volume.planes import TOLERANCE_M, FloorPlanes
from minexplore.world import World
from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Volume
from pipeline.volume.world.proof.physics import places_for_robots, stand

ROBOTS = 32
_THROWN_STEPS = 8
_LOOK_M = 0.15  # over a foot: a floor under it begins below
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION

_DRY = FloorZone("dry", -np.inf, np.inf, 1.0, 1.0, 0.0)
_NO_SPANS = FloorSpans(
    *(np.zeros(0, np.int32),) * 2,
    *(np.zeros(0),) * 3,
    np.zeros(0, np.int32),
    np.zeros((0, 3), np.float32),
    np.zeros((0, len(WAYS)), np.float32),
    np.zeros(2),
    0.25,
)


def world_of(volume: Volume, parts: list[ShellPart]) -> World:
    """Return a world of one dry zone in the volume's own frame; it has no cells."""
    first = np.cumsum([0, *(len(part.corners) for part in parts)]).astype(np.int32)
    size = np.linalg.norm(volume.normals, axis=1)
    label = volume.label[[max(part.facets, key=lambda k: float(size[k])) for part in parts]]
    rock = Parts(np.concatenate([part.corners for part in parts]), first, label.astype(np.int32))
    faces = volume.faces.astype(np.int32)
    facets = VolumeFacets(volume.vertices, faces, volume.label.astype(np.int32), np.zeros(len(faces), np.int32))
    arrays = VolumeArrays(facets, rock, _NO_SPANS)
    record = {"rock_friction": 1.0}
    return World(Path(), record, np.eye(4), np.zeros((1, 1)), np.zeros(2), 0.25, [_DRY], volume=arrays)


class VolumeStepping:
    """The local models of a volume, and what chooses one for a control step."""

    def __init__(
        self,
        volume: Volume,
        parts: list[ShellPart],
        task: TaskParams | None = None,
        tolerance_m: float = TOLERANCE_M,
        exact_tile_m: tuple[float, float] = EXACT_TILE_M,
    ) -> None:
        """Index the floors; `tolerance_m` is how far they may be from the planes that stand for them."""
        world = world_of(volume, parts)
        assert world.volume is not None
        self.models = VolumeModels(world, task or TaskParams(), RobotParams(), exact_tile_m=exact_tile_m)
        self.columns = FloorColumns(world.volume.facets)
        self.planes = FloorPlanes(self.columns, Creases(world.volume.facets))
        self.chooser = PlaneChooser(self.models, self.planes, tolerance_m)

    def floors_under(self, places_m: np.ndarray) -> np.ndarray:
        """Return the height (n,) m of the first floor at or under places (n, 3) m, NaN where there is none."""
        return self.columns.heights_on(self.columns.facets_under(places_m), places_m[:, :2])


@dataclass(frozen=True)
class Thrown:
    """Robots thrown, control steps in which their chassis touched rock, and how many are outside in the end.

    `floor_error_m` is the largest distance in height of a plane from the floor under its foot.
    """

    throws: int
    touches: int
    escapes: int
    floor_error_m: float


class VolumeDrive:
    """Robots that drive in a volume, each alone, stepped by the environment's `PhysicsStepper`."""

    def __init__(self, volume: Volume, local: VolumeStepping, rng: np.random.Generator) -> None:
        """Choose places on the floors, by their area."""
        places, normals = places_for_robots(volume)
        area = _areas_at(volume, places)
        chosen = rng.choice(len(places), ROBOTS, p=area / area.sum())
        self._volume = volume
        self._local, self.models, self.chooser = local, local.models, local.chooser
        self._zones = np.zeros((ROBOTS, 2), int)
        number, code = (
            self.models.numbers_of(places[chosen[:1]], np.zeros(1, bool)),
            code_of(np.zeros(1, int), self._zones[:1]),
        )
        self.stepper = PhysicsStepper(self.models, ROBOTS, 1, np.append(number, code))  # type: ignore[arg-type]
        model = self.models.model((int(number[0]), int(code[0])))
        self._where, self._how = _mocap_addresses(model)
        data = mujoco.MjData(model)
        self._starts = np.zeros((ROBOTS, 7))
        for k, number in enumerate(chosen):
            at = stand(data, model, "robot", places[number], normals[number], rng.uniform(-np.pi, np.pi))
            self._starts[k] = data.qpos[at : at + 7]

    def reset(self) -> None:
        """Put all robots back to their starts."""
        for k in range(ROBOTS):
            self.stepper.restart(k)
        self.stepper.qpos[:, :7] = self._starts

    def step(self, action: np.ndarray) -> np.ndarray:
        """Step all robots; return which touched rock."""
        choice = self._last = self._chosen(action)
        return self.stepper.advance(np.arange(ROBOTS), choice.tiles, self.models.task.substeps)

    def _chosen(self, action: np.ndarray) -> StepChoice:
        """Choose the models and planes of all robots, and enter these and the controls in their states."""
        task, robot, stepper = self.models.task, self.models.robot, self.stepper
        assert isinstance(robot, DrivenRobot)
        stepper.ctrl[:] = robot.controls(action[:, 0] * task.max_forward_mps, action[:, 1] * task.max_turn_radps)
        qpos = stepper.qpos
        choice = self.chooser.choose(qpos[:, :3], rotation_matrices(qpos[:, 3:7]), stepper.qvel[:, :6], self._zones)
        stepper.state[:, self._where] = choice.places.reshape(ROBOTS, -1)
        stepper.state[:, self._how] = choice.quaternions.reshape(ROBOTS, -1)
        return choice

    def throw(self, rounds: int, rng: np.random.Generator) -> Thrown:
        """Throw all robots in all directions again and again, and drive them on at full throttle."""
        inside, robots, touches, escapes, errors = self._volume.inside, self.stepper, 0, 0, [0.0]
        for _ in range(rounds):
            self.reset()
            yaw, speed = rng.uniform(-np.pi, np.pi, ROBOTS), rng.uniform(0, self.models.task.max_forward_mps, ROBOTS)
            robots.qvel[:, :2] = speed[:, None] * np.column_stack([np.cos(yaw), np.sin(yaw)])
            action = np.column_stack([np.ones(ROBOTS), rng.uniform(-1, 1, ROBOTS)])
            for _step in range(_THROWN_STEPS):
                touches += int(self.step(action).sum())
                errors.append(self._floor_error_m())
            escapes += int((inside.distance_m(robots.qpos[:, :3]) < 0).sum())
        return Thrown(rounds * ROBOTS, touches, escapes, max(errors))

    def _floor_error_m(self) -> float:
        """Return how far in height the planes of the last step are from the floor under the feet that it ended with."""
        qpos, on_plane = self.stepper.qpos, self._last.on_plane
        feet = self.chooser.feet_of(qpos[:, :3], rotation_matrices(qpos[:, 3:7]))
        floor = self._local.floors_under(feet[on_plane] + np.array([0, 0, _LOOK_M]))
        off = np.abs(self._last.under.heights(feet[..., :2])[on_plane] - floor)
        return float(np.nanmax(off, initial=0.0))


def _areas_at(volume: Volume, places: np.ndarray) -> np.ndarray:
    """Return the area (n,) m2 of the facet that each place is the middle of."""
    middles = {
        tuple(m): a
        for m, a in zip(
            volume.vertices[volume.faces].mean(axis=1), np.linalg.norm(volume.normals, axis=1) / 2, strict=True
        )
    }
    return np.array([middles[tuple(place)] for place in places])


def _mocap_addresses(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """Return where the places and the quaternions of the planes' bodies stand in the integration state."""
    data, state = mujoco.MjData(model), np.zeros(mujoco.mj_stateSize(model, _STATE))
    data.mocap_pos[:], data.mocap_quat[:] = np.pi, np.e
    mujoco.mj_getState(model, data, state, _STATE)
    where, how = np.flatnonzero(state == np.pi), np.flatnonzero(state == np.e)
    assert (len(where), len(how)) == (3 * len(FEET), 4 * len(FEET))
    return where, how
