"""All robots on one device: their state, and the order of the kernels that drive, look, reward and restart them."""

from typing import Any

import numpy as np
import warp as wp

from minexplore.extra.warp.graph import Replayed
from minexplore.extra.warp.kernels.coverage import mark_cells
from minexplore.extra.warp.kernels.drive import command_wheels
from minexplore.extra.warp.kernels.frames import MineFrame
from minexplore.extra.warp.kernels.observe import describe_robots, find_failures, observe_beams
from minexplore.extra.warp.kernels.rays import RockScenes, cast_beams
from minexplore.extra.warp.kernels.reset import count_first_look, forget_cells, restart_robots, start_places
from minexplore.extra.warp.kernels.reward import milestone_arrays, score_steps
from minexplore.extra.warp.physics import WarpPhysics
from minexplore.physics.local_models import LocalModels
from minexplore.physics.robot import RobotParams
from minexplore.rotations import quaternion
from minexplore.sensing.coverage import CoverageGrid
from minexplore.sensing.observation import COMMANDS
from minexplore.task import TaskParams
from minexplore.world import World

_WORD = 32  # bits


class WarpBatch:
    """The state of n robots on a device, by name in `arrays`, a row a robot; `RobotBatch` is the reference.

    `step` drives the robots of `drives` by `action`, and `restart` begins new episodes of those of `restarts`; both
    only queue work.
    """

    def __init__(self, world: World, task: TaskParams, robot: RobotParams, count: int, device: Any) -> None:
        """Bring the mine onto the device."""
        self.world, self.task, self.robot, self.count, self.device = world, task, robot, count, device
        self.models = LocalModels(world, task, robot)
        anchor_m = np.array(world.record["spawn"]["anchor_m"])
        self.grid = CoverageGrid(world, task.cell_m, robot.radius_m, anchor_m, task.region_m)
        self._gains = _linear_controls(robot)
        with wp.ScopedDevice(device):
            self._take_mine()
            self.arrays = self._make_arrays()
        self.step = Replayed(device, self._step)
        self.restart = Replayed(device, self._restart)

    def _take_mine(self) -> None:
        """Make what is the same for all robots."""
        world, task, robot, T_world_mine = self.world, self.task, self.robot, self.models.T_world_mine
        self.frame = MineFrame()
        self.frame.rotation = wp.mat33d(*T_world_mine[:3, :3].ravel())
        self.frame.origin = wp.vec3d(*T_world_mine[:3, 3])
        w, x, y, z = quaternion(T_world_mine[:3, :3])
        self._turn = wp.quatd(x, y, z, w)
        self.physics = WarpPhysics(self.models, self.count, self.frame)
        self.rock = RockScenes(world, task.range_m[1])
        angles = 2 * np.pi * np.arange(task.beams) / task.beams
        self._beams = wp.array(np.column_stack([np.cos(angles), np.sin(angles)]), dtype=wp.vec2d)
        zones = world.active_zones(task.terrain)
        self._edges = wp.array([zone.east_m for zone in zones[:-1]], dtype=wp.float64)
        self._scale = wp.array([zone.command_scale for zone in zones], dtype=wp.float64)
        self._noise = wp.array([zone.speed_noise_mps for zone in zones], dtype=wp.float64)
        self._fastest = wp.vec2d(task.max_forward_mps, task.max_turn_radps)
        self._wheels = wp.array(self._gains, dtype=wp.float64)
        self._places = wp.array(start_places(world, robot), dtype=wp.vec2d)
        self._milestones = milestone_arrays(self.grid.total)
        number = np.where(
            self.grid.reachable, np.cumsum(self.grid.reachable).reshape(self.grid.reachable.shape) - 1, -1
        )
        self._number = wp.array(number, dtype=int)
        self._lines = int(np.ceil(task.range_m[1] / task.cell_m)) + 1

    def _make_arrays(self) -> dict[str, wp.array]:
        """Return the robots' arrays."""
        n, beams = self.count, self.task.beams
        whole = ("gained", "cells_seen", "steps", "stalled", "collisions", "zone", "fault")
        flags = ("drives", "restarts", "touched", "terminated", "truncated")
        return {
            **{name: wp.zeros(n, dtype=int) for name in whole},
            **{name: wp.zeros(n, dtype=bool) for name in flags},
            "keys": wp.zeros((n, 2), dtype=wp.uint32),
            "draws": wp.zeros(n, dtype=wp.uint32),
            "action": wp.zeros((n, 2), dtype=float),
            "previous": wp.zeros((n, 2), dtype=float),
            "origins": wp.zeros(n, dtype=wp.vec2d),
            "ends": wp.zeros((n, beams), dtype=wp.vec2d),
            "ranges": wp.zeros((n, beams), dtype=float),
            "seen": wp.zeros((n, -(-self.grid.total // _WORD)), dtype=wp.uint32),
            "observation": wp.zeros((n, beams + COMMANDS), dtype=float),
            "reward": wp.zeros(n, dtype=float),
            "pose": wp.zeros((n, 3), dtype=float),
            **{name: wp.zeros(n, dtype=float) for name in ("height", "pitch", "roll", "coverage")},
        }

    def forget(self) -> None:
        """Drop the recorded graphs: they hold this batch, and with it the device's memory."""
        del self.step, self.restart

    def _step(self) -> None:
        self.drive()
        self.look("drives")
        self.score()
        self.observe("drives")
        self.describe()

    def _restart(self) -> None:
        a, data = self.arrays, self.physics.data
        wp.launch(
            restart_robots,
            self.count,
            [
                self.frame,
                self._turn,
                self.robot.wheel_radius_m,
                self._places,
                self.physics.qpos0,
                a["keys"],
                a["restarts"],
            ]
            + [a["draws"], data.qpos, data.qvel, data.qacc_warmstart, a["previous"], a["steps"], a["stalled"]]
            + [a["collisions"], a["touched"]],
        )
        wp.launch(forget_cells, a["seen"].shape, [a["restarts"], a["seen"]])
        self.look("restarts")
        wp.launch(count_first_look, self.count, [a["restarts"], a["gained"], a["cells_seen"]])
        self.observe("restarts")
        self.describe()

    def drive(self) -> None:
        """Queue one control step of physics; robots that do not drive are given zero speed."""
        a, data = self.arrays, self.physics.data
        wp.launch(
            command_wheels,
            self.count,
            [self.frame, self._edges, self._scale, self._noise, self._fastest, self._wheels, a["keys"], a["drives"]]
            + [data.qpos, a["action"], a["draws"], a["previous"], a["touched"], a["fault"], data.ctrl],
        )
        self.physics.fill_slots(a["fault"])
        self.physics.advance(self.task.substeps, a["touched"])
        wp.launch(find_failures, self.count, [data.qpos, a["fault"]])

    def look(self, asked: str) -> None:
        """Queue the beams of the robots of a mask, and mark what they see."""
        self.cast(asked)
        self.mark(asked)

    def cast(self, asked: str) -> None:
        """Queue the beams of the robots of a mask."""
        a, rock = self.arrays, self.rock
        lift_m = self.robot.sensor_height_m - self.robot.wheel_radius_m
        wp.launch(
            cast_beams,
            a["ranges"].shape,
            [rock.first, rock.number, rock.ids, rock.middles, rock.roof_m, self.frame, lift_m, self.task.range_m[1]]
            + [self._beams, a[asked], self.physics.data.qpos, a["origins"], a["ends"], a["ranges"]],
        )

    def mark(self, asked: str) -> None:
        """Queue the marks of the cells that the beams of a mask's robots passed through."""
        a, grid = self.arrays, self.grid
        a["gained"].zero_()
        wp.launch(
            mark_cells,
            a["ranges"].shape,
            [wp.vec2d(*grid.origin_m), grid.cell_m, self._lines, self._number]
            + [a[asked], a["origins"], a["ends"], a["seen"], a["gained"]],
        )

    def score(self) -> None:
        """Queue rewards and the ends of episodes."""
        a, task = self.arrays, self.task
        wp.launch(
            score_steps,
            self.count,
            [self.frame, self.grid.total, *self._milestones, task.max_steps, task.stall_steps, task.stall_speed_mps]
            + [task.max_forward_mps, a["drives"], self.physics.data.qvel, a["previous"], a["gained"], a["touched"]]
            + [a["fault"], a["cells_seen"], a["steps"], a["stalled"], a["collisions"], a["reward"], a["truncated"]],
        )

    def observe(self, asked: str) -> None:
        """Queue the observations of the robots of a mask."""
        a, task = self.arrays, self.task
        wp.launch(
            observe_beams,
            a["ranges"].shape,
            [*task.range_m, task.range_noise_m, a["keys"], a["draws"], a[asked], a["ranges"], a["previous"]]
            + [a["observation"]],
        )

    def describe(self) -> None:
        """Queue the robots' poses, heights, floor zones and coverage."""
        a = self.arrays
        wp.launch(
            describe_robots,
            self.count,
            [self.frame, self._edges, self.robot.wheel_radius_m, self.grid.total, self.physics.data.qpos]
            + [a["cells_seen"], a["pose"], a["height"], a["pitch"], a["roll"], a["zone"], a["coverage"]],
        )


def _linear_controls(robot: RobotParams) -> np.ndarray:
    """Return the controls (controls, 2) of a unit forward speed and a unit turn rate.

    Raises
    ------
    ValueError
        If the robot's controls are no linear function of the twist.
    """
    twists = np.array([[1.0, 0.0], [0.0, 1.0], [0.3, -0.7], [0.0, 0.0]])
    controls = np.asarray(robot.controls(twists[:, 0], twists[:, 1]))
    gains = controls[:2].T
    if not np.allclose(controls, twists @ gains.T):
        raise ValueError(f"{type(robot).__name__}: on Warp its controls must be linear in forward speed and turn rate")
    return gains
