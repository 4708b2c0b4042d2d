"""The environment's robot, driven to the cells of a volume that it reaches, and from their last places on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from minexplore.envs.robot_batch import RobotBatch
from minexplore.floors.volume_arrays import FloorSpans
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from minexplore.volume.cells import VolumeGrid
from minexplore.volume.standing import neighbours, standing_spans, wide_pairs
from minexplore.world import World

_STEEPEST, _STEP_M = 0.364, 0.05  # of floors that robots climb
_SPEED, _TURN = 0.5, 2.0  # of the largest speed, and by the angle off the course
_AHEAD_M = 0.2  # from a place: the robot heads for the next one
_BACK_M, _BEYOND_M = 10.0, 10.0  # of the way to a cell that is driven, and of ways on from the last places
_SLACK_S = 10.0  # beside twice the time that a way takes
_ROBOTS = 64  # at a time
_NEAR_ROCK_M = 0.3  # beyond the robot's radius, where ways keep away from rock


@dataclass(frozen=True)
class DrivenCells:
    """What robots did: cells that were driven to and arrived at, ways on, and how far these went, m, seen from above.

    `beyond_m` is the largest distance of a robot from all places that it should reach.
    """

    cells: int
    arrived: int
    ways_on: int
    beyond_m: float


class ReachDrives:
    """A world that is one volume, with what of its floors a robot reaches."""

    def __init__(self, world: World, robot: RobotParams | None = None) -> None:
        """Find the spans and the cells that the robot reaches."""
        assert world.volume is not None
        self.world, self.robot = world, robot or RobotParams()
        self.spans: FloorSpans = world.volume.spans
        self.anchor_m = np.array(world.record["spawn"]["anchor_m"])
        self.standing = standing_spans(self.spans, self.robot, self.anchor_m)
        self.grid = VolumeGrid(self.spans, self.standing, TaskParams().cell_m)

    def cells_at(self, places_m: np.ndarray) -> np.ndarray:
        """Return the cell (n, 4) of places (n, 3) m on floors: its number, or -1 and where a cell would be."""
        grid = self.grid
        at = np.floor((places_m[:, :2] - grid.origin_m) / grid.cell_m).astype(int)
        found = np.column_stack([np.full(len(at), -1), at, np.floor(places_m[:, 2] / grid.cell_m).astype(int)])
        square = np.where(((at >= 0) & (at < grid.shape[::-1])).all(axis=1), at[:, 1] * grid.shape[1] + at[:, 0], -1)
        for cell in range(grid.total):
            own = (
                (square == grid.square[cell])
                & (places_m[:, 2] > grid.low_m[cell])
                & (places_m[:, 2] < grid.high_m[cell])
            )
            found[own] = (cell, 0, 0, 0)
        return found

    def ways_to_cells(self) -> list[np.ndarray]:
        """Return the last 10 m (k, 3) m of a way from the spawn to a span of each cell."""
        pairs = wide_pairs(self.spans, _STEEPEST, _STEP_M, self.robot.top_m, self.robot.radius_m)
        pairs = pairs[self.standing[pairs].all(axis=1)]
        before = self._tree(pairs, int(np.linalg.norm(self._places - self.anchor_m, axis=1).argmin()), None)[1]
        return [self._way(before, number) for number in self._spans_of_cells()]

    def ways_on(self) -> list[np.ndarray]:
        """Return ways (k, 3) m of 10 m and less from places that are reached over floors that are not."""
        spans = self.spans
        usable = (spans.storey >= 0) & (spans.headroom_m >= self.robot.top_m)
        pairs = neighbours(spans, _STEEPEST, _STEP_M, self.robot.top_m)
        pairs = pairs[usable[pairs].all(axis=1) & ~self.standing[pairs].all(axis=1)]
        edge = np.unique(pairs[self.standing[pairs]])
        far, before = self._tree(pairs, edge, _BEYOND_M)
        ends = np.flatnonzero(np.isfinite(far) & ~self.standing)
        kept: list[int] = []
        for number in ends[np.argsort(-far[ends], kind="stable")].tolist():  # farthest first, a metre apart
            if all(np.linalg.norm(self._places[number] - self._places[other]) > 1.0 for other in kept):
                kept.append(number)
        return [self._way(before, number) for number in kept]

    @property
    def _places(self) -> np.ndarray:
        return self.spans.roomiest_m

    def _tree(self, pairs: np.ndarray, start: int | np.ndarray, most_m: float | None) -> tuple[np.ndarray, np.ndarray]:
        """Return how far (s,) m spans are from some, and the span before each (s,), by ways that keep off rock."""
        one, two = pairs.T
        run = np.linalg.norm(self._places[one] - self._places[two], axis=1) + 1e-3
        room = np.minimum(self.spans.clearance_m[one], self.spans.clearance_m[two]) - self.robot.radius_m
        cost = run * (1 + 3 * np.clip(1 - room / _NEAR_ROCK_M, 0, 1)) if most_m is None else run
        graph = csr_matrix((cost, (one, two)), shape=(len(self.standing),) * 2)
        found = dijkstra(
            graph,
            False,
            start,
            return_predecessors=True,
            limit=np.inf if most_m is None else most_m,
            min_only=most_m is not None,
        )
        return found[0], found[1]

    def _way(self, before: np.ndarray, end: int) -> np.ndarray:
        way, long_m = [end], 0.0
        while before[way[-1]] >= 0 and long_m < max(_BACK_M, _BEYOND_M):
            way.append(int(before[way[-1]]))
            long_m += float(np.linalg.norm(self._places[way[-1]] - self._places[way[-2]]))
        found: np.ndarray = self._places[way[::-1]]
        return found

    def _spans_of_cells(self) -> list[int]:
        """Return the roomiest span of each cell."""
        numbers = np.flatnonzero(self.standing)
        at = np.floor((self.spans.places_m[numbers, :2] - self.grid.origin_m) / self.grid.cell_m).astype(int)
        square, floor = at[:, 1] * self.grid.shape[1] + at[:, 0], self.spans.floor_m[numbers]
        found = []
        for cell in range(self.grid.total):
            low, high = self.grid.low_m[cell], self.grid.high_m[cell]
            own = numbers[(square == self.grid.square[cell]) & (floor > low) & (floor < high)]
            found.append(int(own[self.spans.clearance_m[own].argmax()]))
        return found

    def drive(self) -> DrivenCells:
        """Drive both kinds of ways."""
        to_cells, on = self.ways_to_cells(), self.ways_on()
        arrived = sum(int(self._follow(some)[0].sum()) for some in _some(to_cells))
        beyond = max((self._follow(some)[1] for some in _some(on)), default=0.0)
        return DrivenCells(len(to_cells), arrived, len(on), beyond)

    def _follow(self, ways: list[np.ndarray]) -> tuple[np.ndarray, float]:
        """Drive a robot along each way; return which arrive (n,), and how far one came from all places, m."""
        count = len(ways)
        task = TaskParams(terrain=False, stall_steps=10**6, max_steps=10**6)
        batch = RobotBatch(self.world, task, self.robot, count)
        rngs = [np.random.default_rng(k) for k in range(count)]
        batch.reset(np.arange(count), rngs)
        for k, way in enumerate(ways):
            ahead = way[min(1, len(way) - 1)] - way[0]
            x, y, z = way[0].tolist()
            batch.place(k, x, y, float(np.arctan2(ahead[1], ahead[0])), z)
        target, reached, beyond = np.ones(count, int), self._places[self.standing], 0.0
        longest = max(float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum()) for way in ways)
        last = np.array([len(way) for way in ways])
        steps = round((2 * longest / (_SPEED * task.max_forward_mps) + _SLACK_S) / task.control_s)
        for _ in range(steps):
            place = batch.qpos[:, :3] - self.world.T_world_mine[:3, 3]
            for k in range(count):
                while target[k] < last[k] and np.linalg.norm(ways[k][target[k], :2] - place[k, :2]) < _AHEAD_M:
                    target[k] += 1
            if (target == last).all():
                break
            away = np.array([ways[k][min(target[k], last[k] - 1), :2] for k in range(count)]) - place[:, :2]
            yaw = batch.poses(np.arange(count))[:, 2]
            off = (np.arctan2(away[:, 1], away[:, 0]) - yaw + np.pi) % (2 * np.pi) - np.pi
            going = target < last
            speed = np.where(going, _SPEED * np.maximum(np.cos(off), 0.0), 0.0)
            turn = np.where(going, np.clip(_TURN * off, -1, 1), 0.0)
            batch.drive(np.column_stack([speed, turn]), rngs, np.arange(count))
            for x, y, z in place.tolist():
                near = reached[np.abs(reached[:, 2] - z) < 1.0, :2]
                if len(near):
                    beyond = max(beyond, float(np.sqrt(np.square(near - (x, y)).sum(axis=1).min())))
        return target == last, beyond


def _some(ways: list[np.ndarray]) -> list[list[np.ndarray]]:
    return [ways[k : k + _ROBOTS] for k in range(0, len(ways), _ROBOTS)]
