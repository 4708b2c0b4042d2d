"""What robots that fly move in inside a volume: models by cubes, starts over a floor, and the cubes to see."""

from __future__ import annotations

import mujoco
import numpy as np

from minexplore.physics.flyer_models import CUBE_M, add_flyers
from minexplore.physics.local_models import MARGIN_M, with_little_memory
from minexplore.physics.quadrotor import START_M, QuadrotorParams, level_pose
from minexplore.physics.stepper import PhysicsStepper
from minexplore.sensing.cubes import CubeGrid
from minexplore.task import TaskParams
from minexplore.tiles import Tile, tiles_at
from minexplore.volume.air import air_spans, reached_from
from minexplore.volume.columns import FloorColumns
from minexplore.volume.rock import PartsOfRock
from minexplore.world import World

_LOOK_M = 0.3  # over a place: a floor there is at or under it


class AirModels:
    """Physics models of a volume, as `PhysicsStepper` takes them, one a cube of the mine frame, each with one robot."""

    def __init__(self, world: World, task: TaskParams, robot: QuadrotorParams, whole: bool = False) -> None:
        """Take a world's parts; with `whole` every model is that of all parts."""
        self.world, self.robot, self.whole, self.T_world_mine = world, robot, whole, world.T_world_mine
        self._rock = PartsOfRock(world, task)
        fastest_m = np.hypot(task.max_forward_mps, robot.climb_mps) * task.control_s
        self._margin_m = robot.radius_m + fastest_m + MARGIN_M

    def tiles_of(self, xyz: np.ndarray) -> np.ndarray:
        """Return each place's cube (n, 3); a whole world has one."""
        return np.zeros((len(xyz), 3), dtype=int) if self.whole else tiles_at(xyz, CUBE_M)

    def model(self, tile: Tile) -> mujoco.MjModel:
        """Compile the model of a cube: the parts that a robot in it can touch, and the robot.

        Raises
        ------
        BundleError
            If MuJoCo refuses a part; the message is MuJoCo's.
        """
        return self.world.compile(with_little_memory(self.spec(tile)))

    def spec(self, tile: Tile | None, robots: tuple[str, ...] = ("robot",)) -> mujoco.MjSpec:
        """Return a model's spec; without a tile it holds all parts."""
        low, high = np.full(3, -np.inf), np.full(3, np.inf)
        if tile is not None and not self.whole:
            low = np.array(tile) * CUBE_M - self._margin_m
            high = low + CUBE_M + 2 * self._margin_m
        spec = self._rock.spec(low, high)
        add_flyers(spec, self.robot, robots)
        return spec


class AirGround:
    """A volume as `FlyerBatch` needs it; see `minexplore.envs.ground.RobotGround`."""

    def __init__(self, world: World, task: TaskParams, robot: QuadrotorParams, count: int, whole: bool) -> None:
        """Index the floors and find the cubes that the robot reaches.

        Raises
        ------
        ValueError
            If the robot fits nowhere.
        """
        assert world.volume is not None
        self.world, self.robot, self._facets = world, robot, world.volume.facets
        self.models = AirModels(world, task, robot, whole)
        self.T_world_mine = self.models.T_world_mine
        anchor_m = np.array(world.record["spawn"]["anchor_m"])
        self.start_m = anchor_m + np.array([0.0, 0.0, START_M])
        try:
            self.air = reached_from(air_spans(world.volume.spans, robot.radius_m, robot.half_height_m), self.start_m)
        except ValueError as error:
            raise ValueError(f"{world.folder}: {error}") from error
        near = np.hypot(*(self.air.places_m - anchor_m[:2]).T) <= task.region_m
        self.grid = CubeGrid(self.air.within(near).middles(task.cell_m), task.cell_m)
        self._columns = FloorColumns(self._facets)

    def places(self, clearance_m: float) -> np.ndarray:
        """Return the places (n, 3) m over which the robot can be, on their floors."""
        return np.column_stack([self.air.places_m, self.air.floor_m - self.robot.half_height_m])

    def pose(self, place_m: np.ndarray, yaw_rad: float) -> np.ndarray:
        """Return the pose of a robot that is level over a place (2,) or (3,) m; see `VolumeGround.pose`."""
        x, y, *z = place_m.tolist()
        floors, roofs = self._columns.spans(self._columns.hits(np.array([[x, y]])), 1)
        under = np.flatnonzero(floors[0] <= (z[0] if z else np.inf) + _LOOK_M)
        if not len(under):
            raise ValueError(f"{self.world.folder}: no floor under {x:g} {y:g}")
        floor, roof = floors[0, under[-1]], roofs[0, under[-1]]
        return level_pose(self.T_world_mine, np.array([x, y, floor + min(START_M, (roof - floor) / 2)]), yaw_rad)

    def prepare(self, stepper: PhysicsStepper, robots: np.ndarray, places_m: np.ndarray) -> np.ndarray:
        """Return the places, by which models are chosen in three dimensions."""
        return places_m

    def info(self, robots: np.ndarray, places_m: np.ndarray) -> dict[str, np.ndarray]:
        """Return the leg whose floor is under robots (k,) at places (k, 3) m."""
        facet = np.maximum(self._columns.facets_under(places_m), 0)
        return {"leg": self._facets.leg[facet].astype(int)}
