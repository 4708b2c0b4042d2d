"""Point navigation: drive to a goal along the drifts, as in Anderson et al. 2018 (arXiv:1807.06757) and BARN."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from minexplore.limits import Span, check_numbers
from minexplore.rotations import rotate_inverse
from minexplore.task import coerce_params
from minexplore.tasks.exploration import STARTS, Exploration
from minexplore.tasks.ways import WayField, ways_in

if TYPE_CHECKING:
    from minexplore.tasks.starts import EpisodeStart

SUCCESS, SLACK, COLLISION = 10.0, 0.01, 1.0  # of the reward
GOAL = "goal"  # the option of a reset
_FARTHEST_M = 1000.0  # that an observation holds
_DRAWS = 100  # goals that are tried for a start at a distance
_ROOM_M = 0.1  # beside the robot at a start or a goal that is drawn; nearer to rock it may begin in contact
_STRAY_M = 1.0  # a start that is farther from all places that the robot reaches is none
_DISTANCE = Span(0.0, 100_000.0)


@dataclass(frozen=True)
class GoalParams:
    """Where goals are, and how near is there.

    `distance_m` are the least and the largest distance from start to goal, along the drifts; `radius_m` is the distance
    at which the goal is reached, also along the drifts.
    """

    distance_m: tuple[float, float] = (10.0, 100.0)
    radius_m: float = 1.0

    def __post_init__(self) -> None:
        """Refuse values that make no goals."""
        check_numbers(GOAL, self, {"radius_m": Span(0.05, 100.0)})
        pair = isinstance(self.distance_m, tuple) and len(self.distance_m) == 2
        if not pair or not all(map(_DISTANCE.accepts, self.distance_m)) or not self.distance_m[0] <= self.distance_m[1]:
            raise ValueError(f"{GOAL}: distance_m = {self.distance_m!r:.100}: want near <= far, m, from {_DISTANCE}")
        if self.distance_m[0] <= self.radius_m:
            raise ValueError(f"{GOAL}: distance_m = {self.distance_m!r}: want more than radius_m = {self.radius_m:g}")


class GoTo(Exploration):
    """Drive to a goal that may be out of sight, the shorter the way the better, without touching rock.

    The robot, the mine, the actions and the physics are those of exploration.

    ## Observation
    That of exploration, and behind it the goal in the robot's frame, by its true pose:

    | world | observation | Min | Max |
    |-------|-------------|-----|-----|
    | level | straight distance, m, at most 1,000 | 0 | 1000 |
    | | bearing, counter-clockwise from ahead, rad | -pi | pi |
    | with heights | ahead, to the left and up, m | -1000 | 1000 |

    ## Reward
    `before - now - 0.01 + [success] * 10 - [collision] * 1`, where `before` and `now` are the ways left, m, and a
    collision is a step in which the chassis touches rock.

    ## Start and goal
    By the episode's seed: a place that the robot reaches, drawn with equal chance, is the goal, and one that is 10 to
    100 m from it along the drifts is the start; yaw uniform in [-pi, pi). Both lie within the task's `region_m`, with
    0.1 m of room beside the robot.
    `reset(options=...)` takes what exploration takes for the start, and `goal`: the name of a station of
    `topology.json`, or x, y, in a volume also z (m, mine frame). It is then the nearest place that the robot reaches,
    which must be within `radius_m`; in a volume, of the floor under it. Where options give the start, the goal is drawn
    at the same distances. Random numbers: `integers(n)` for the goal, again where no start is at these distances,
    `integers(m)` for the start, then the yaw and the rest as in exploration.

    ## Episode End
    `terminated` when the way left is at most `radius_m`. `truncated` as in exploration, after 3,000 steps.

    ## Info
    All that exploration has, and

    | key | shape | meaning |
    |-----|-------|---------|
    | `goal_m` | (3,) | the goal, mine frame; 0 up in a mine that is drawn in plan |
    | `way_left_m` | () | the shortest way to the goal |
    | `shortest_m` | () | the shortest way from the start to where the goal counts as reached |
    | `driven_m` | () | how far the robot has come on its way |
    | `success` | () bool | whether the goal is reached |
    | `spl` | () | success weighted by path length: `shortest_m` / max(`shortest_m`, `driven_m`), 0 before success |
    | `time_s` | () | since the start |

    Habitat's shortest path ends at the goal itself; here it is shorter by `radius_m`, so that no way can be shorter.

    ## Distances
    The shortest ways lead over the cells (0.25 m in the default world) in which the robot has room, in 32 directions;
    they are at most 1.4 % longer than straight ones. In a volume they lead over its floors, and count rise and fall.

    ## Arguments
    Those of exploration, and `goal`: `GoalParams(...)` or a dict of its fields `distance_m` (10, 100) and `radius_m`
    (1.0).
    """

    OPTIONS = (*STARTS, GOAL)
    CHANGES = ("goal", "goal_m", "last_m", "left_m", "shortest_m", "driven_m")

    def __init__(self, batch: Any, goal: GoalParams | Mapping[str, Any]) -> None:
        """Find the ways of the robots' mine.

        Raises
        ------
        ValueError
            If the parameters are none, or the robot flies in a volume, whose air has no ways here.
        """
        super().__init__(batch)
        self.params: GoalParams = coerce_params(GoalParams, goal)
        world, robot, task = batch.world, batch.robot, batch.task
        if robot.FLIES and world.volume is not None:
            raise ValueError(f"{GOAL}: {world.folder}: ways of a volume lead over floors; want a robot with wheels")
        self.ways = ways_in(world, robot)
        from_anchor = self.ways.places_m[:, :2] - world.record["spawn"]["anchor_m"][:2]
        self._inside = np.hypot(*from_anchor.T) <= task.region_m
        self._inside &= self.ways.clearance_m >= robot.radius_m + _ROOM_M
        if not self._inside.any():
            raise ValueError(f"{GOAL}: {world.folder}: no place with {robot.radius_m + _ROOM_M:g} m to rock; want one")
        self._fields: list[WayField | None] = [None] * batch.count
        self.goal = np.zeros(batch.count, dtype=int)
        self.goal_m, self.last_m = np.zeros((batch.count, 3)), np.zeros((batch.count, 3))
        self.left_m, self.shortest_m, self.driven_m = (np.zeros(batch.count) for _ in range(3))

    def start_of(self, options: Mapping[str, Any] | None) -> EpisodeStart | None:
        """Return what options fix of an episode; a `ValueError` refuses what is impossible or cannot be reached."""
        start = super().start_of(options)
        if start is not None and start.place_m is not None:
            apart_m = self.ways.nearest(self._on_floor(start.place_m))[1]
            if apart_m > _STRAY_M:
                raise ValueError(f"options: {start.place_m}: {apart_m:.1f} m from all places that the robot reaches")
        if not options or options.get(GOAL) is None:
            return start
        from minexplore.tasks.starts import EpisodeStart, goal_of

        number, apart_m = self.ways.nearest(self._on_floor(goal_of(self.batch.world, options[GOAL])))
        if apart_m > self.params.radius_m:
            raise ValueError(
                f"options: {GOAL} = {options[GOAL]!r:.80}: {apart_m:.2f} m from all places that the robot reaches; "
                f"want at most radius_m = {self.params.radius_m:g}"
            )
        return replace(start or EpisodeStart(), goal=number)

    def _on_floor(self, place_m: tuple[float, ...]) -> np.ndarray:
        """Return a place (3,) m of the mine frame on the floor under a place (2,) or (3,) m; 0 up in a plan."""
        batch = self.batch
        if batch.world.volume is None:
            return np.array([*place_m[:2], 0.0])
        pose = batch.ground.pose(np.array(place_m), 0.0)
        found: np.ndarray = rotate_inverse(pose[None, :3] - batch._t, batch._R)[0]
        return found - [0.0, 0.0, batch.robot.wheel_radius_m]

    def place(self, robot: int, rng: np.random.Generator, start: EpisodeStart | None) -> list[float] | None:
        """Draw start and goal, where options do not fix them; return the start (2,) or (3,) m, mine frame."""
        fixed = None if start is None else start.place_m
        goal = None if start is None else start.goal
        if fixed is not None:
            if goal is None:
                begins = self.ways.nearest(self._on_floor(fixed))[0]
                goal = self._drawn(rng, WayField(self.ways, begins), f"{GOAL}s from the start at {fixed}")
            self._fields[robot] = WayField(self.ways, goal)
            self._set_goal(robot, goal)
            return list(fixed)
        inside = np.flatnonzero(self._inside)
        for _ in range(_DRAWS):
            ends = int(inside[rng.integers(len(inside))]) if goal is None else goal
            field = WayField(self.ways, ends)
            found = field.between(*self.params.distance_m)
            if self._inside[found].any() or goal is not None:
                break
        begins = self._drawn(rng, field, "starts")
        self._fields[robot] = field
        self._set_goal(robot, ends)
        place: list[float] = self.ways.places_m[begins, : 3 if self.batch.world.has_heights else 2].tolist()
        return place

    def _drawn(self, rng: np.random.Generator, field: WayField, sought: str) -> int:
        """Return a place at the task's distances from where a field begins."""
        found = field.between(*self.params.distance_m)
        found = found[self._inside[found]]
        if not len(found):
            near, far = self.params.distance_m
            raise ValueError(f"{self.batch.world.folder}: no {sought} at distance_m = {near:g} to {far:g}; want others")
        return int(found[rng.integers(len(found))])

    def _set_goal(self, robot: int, goal: int) -> None:
        self.goal[robot], self.goal_m[robot] = goal, self.ways.places_m[goal]

    def begin(self, robots: np.ndarray) -> None:
        """Begin the episodes of robots (k,)."""
        self.last_m[robots] = self._places(robots)
        self.left_m[robots] = self._lefts(robots)
        self.shortest_m[robots] = np.maximum(self.left_m[robots] - self.params.radius_m, 0.0)
        self.driven_m[robots] = 0.0

    def _places(self, robots: np.ndarray) -> np.ndarray:
        """Return where robots (k,) are, (k, 3) m, on the floor; 0 up in a mine that is drawn in plan."""
        places = self.batch._mine_places(robots).copy()
        places[:, 2] = self.batch.heights(robots) if self.batch.world.has_heights else 0.0
        return places

    def _lefts(self, robots: np.ndarray) -> np.ndarray:
        """Return the ways left (k,) m of robots at their last places; beside all places, that of the step before."""
        found = np.array([self.field(i).left_m(self.last_m[i]) for i in robots.tolist()])
        return np.where(np.isfinite(found), found, self.left_m[robots])

    def field(self, robot: int) -> WayField:
        """Return how far places are from a robot's goal."""
        field, goal = self._fields[robot], int(self.goal[robot])
        if field is None or field.place != goal:  # of a copy
            field = self._fields[robot] = WayField(self.ways, goal)
        return field

    def judge(self, robots: np.ndarray, new: np.ndarray, collision: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return rewards (k,) and whether the goal is reached (k,) after a step; what is new to see does not count."""
        before, last = self.left_m[robots], self.last_m[robots]
        self.last_m[robots] = self._places(robots)
        self.driven_m[robots] += np.linalg.norm(self.last_m[robots] - last, axis=1)
        self.left_m[robots] = self._lefts(robots)
        done = self.left_m[robots] <= self.params.radius_m
        return before - self.left_m[robots] - SLACK + SUCCESS * done - COLLISION * collision, done

    def towards(self, robots: np.ndarray) -> np.ndarray:
        """Return where the goals of robots (k,) are in their own frames, (k, 3) m: ahead, to the left and up."""
        away = self.goal_m[robots] - self._places(robots)
        found: np.ndarray = np.einsum("kij,kj->ki", self.batch._stances(robots).axes, away)
        return found

    def observed(self, own: np.ndarray, robots: np.ndarray) -> np.ndarray:
        """Return observations (k, features) with the goal in each robot's frame behind its own."""
        seen = self.towards(robots)
        if not self.batch.world.has_heights:
            away = self.goal_m[robots] - self._places(robots)
            bearings = [math.atan2(y, x) for x, y in seen[:, :2].tolist()]
            seen = np.column_stack([np.hypot(away[:, 0], away[:, 1]), bearings])
        return np.hstack([own, np.clip(seen, -_FARTHEST_M, _FARTHEST_M)]).astype(np.float32)

    def info(self, robots: np.ndarray) -> dict[str, np.ndarray]:
        """Return where the goals of robots (k,) are, how far, and how well the way was driven."""
        shortest, driven = self.shortest_m[robots], self.driven_m[robots]
        success = self.left_m[robots] <= self.params.radius_m
        longer = np.maximum(shortest, driven)
        share = np.where(longer > 0, shortest / np.where(longer > 0, longer, 1.0), 1.0)
        return {
            "goal_m": self.goal_m[robots].copy(),
            "way_left_m": self.left_m[robots].copy(),
            "shortest_m": shortest.copy(),
            "driven_m": driven.copy(),
            "success": success,
            "spl": np.where(success, share, 0.0),
            "time_s": self.batch.steps[robots] * self.batch.task.control_s,
        }


def goal_space(own: gymnasium.spaces.Box, has_heights: bool) -> gymnasium.spaces.Box:
    """Return the space of an observation that holds a goal behind a robot's own."""
    low = [-_FARTHEST_M] * 3 if has_heights else [0.0, -math.pi]
    high = [_FARTHEST_M] * 3 if has_heights else [_FARTHEST_M, math.pi]
    return gymnasium.spaces.Box(
        np.append(own.low, low).astype(np.float32), np.append(own.high, high).astype(np.float32), dtype=np.float32
    )
