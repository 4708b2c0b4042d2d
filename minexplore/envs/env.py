"""The exploration environment: one robot, sixteen beams, a mine it does not know."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from minexplore.envs.batches import commands_of, make_batch, observations_of
from minexplore.envs.call_checks import check_camera, check_mode, check_options, check_pose, numbers_of, one_seed
from minexplore.envs.horizon import Timed
from minexplore.limits import has_display
from minexplore.physics.robots import RobotChoice, find_robot
from minexplore.sensing.lidar import Backend
from minexplore.sensing.params import SensorParams, sensor_params
from minexplore.sensors.suite import SensorSuite
from minexplore.sensors.table import check_sensors, observed_space
from minexplore.task import TaskParams, coerce_params
from minexplore.tasks.exploration import StepOutcome, info_of_robot
from minexplore.world import find_world, load_world

if TYPE_CHECKING:
    from minexplore.pictures.render import Renderer
    from minexplore.tasks.goto import GoalParams


class MineEnv(Timed, gymnasium.Env, gymnasium.utils.EzPickle):
    """Explore a mine: see as many of the reachable 2 m cells as possible, without touching rock.

    ## Description
    A differential-drive robot stands near the entrance of a mine that was compiled from a survey. It senses sixteen
    ranges and its own last command, and drives by forward speed and turn rate. The mine dips 5 deg eastwards; its floor
    is dry, then mud, then water, which slow the robot and disturb its speed, beside giving its wheels less grip.

    ## Action Space
    `Box(-1, 1, (2,), float32)`; values beyond are clipped, values that are not finite are refused.

    | Num | Action | Control range | Unit at 1 |
    |-----|--------|---------------|-----------|
    | 0 | forward speed | -1 to 1 | 1.5 m/s |
    | 1 | turn rate, counter-clockwise | -1 to 1 | 1.5 rad/s |

    A floor zone multiplies both by its `command_scale` and adds normal noise of `speed_noise_mps` to the speed, drawn once
    a control step: in the default world 1 and 0 m/s on dry ground, 0.7 and 0.04 m/s in mud, 0.4 and 0.10 m/s in water.
    The noise is the paper's and does not depend on the command: a robot that is commanded to stand moves in mud and water,
    in the default's water by 0.5 m in 10 s.

    ## Observation Space
    `Box((19,), float32)`

    | Num | Observation | Min | Max |
    |-----|-------------|-----|-----|
    | 0-15 | range of beam i at i * 22.5 deg counter-clockwise from ahead, clipped to 0.12-10.0 m, with noise of 0.01 m s.d., scaled | 0 | 1 |
    | 16 | previous forward command | -1 | 1 |
    | 17 | always 0 | 0 | 0 |
    | 18 | previous turn command | -1 | 1 |

    Beams start 0.5 m above the floor and lie in the robot's own plane; they hit the visible rock and the floor.

    ## Rewards
    `new * 10 / total - [new = 0] * 0.002 + milestones - [collision] * 15`: `new` cells seen for the first time of
    `total` reachable ones, 15, 30 and 45 once at 25, 50 and 75 % of them, and a collision when the chassis touches
    rock in the step. An episode returns at most 100.

    A cell is seen when a beam passes through it on the way to its return. Reachable are the cells in which the robot can
    stand, connected to the entrance. In a world that is one volume, floors over each other are different cells: a beam
    marks the one whose floor is the next under it, and the robot reaches what its width, its height, slopes of 20 deg
    and steps of 5 cm let it. It falls at 3 m/s at most.

    ## Starting State
    The anchor near the entrance, or a random free place of the entrance region where the anchor is too narrow; yaw
    uniform in [-pi, pi). What the first look sees is seen, but earns nothing. `reset(options=...)` takes one of `pose`
    (x, y, yaw, in a volume also z; m and rad, mine frame), `cell` (row and column of `World.clearance_m`) and `station`
    (of `topology.json`), and `noise_seed`: the noise is then that of this seed, in a vector `noise_seed + i`.

    ## Episode End
    `terminated` is always False. `truncated` after 6,000 steps (10 minutes), which `max_episode_steps` of `gymnasium.make`
    and `make_vec` changes (a task's `max_steps` without them), or after 100 steps in a row in which the
    robot moved, or was commanded to move, forward slower than 0.01 m/s. The noise of mud and water does not keep a parked
    robot's episode going.

    ## Info
    Arrays of numbers, those of one number without dimensions; vectors and teams have the same keys, dtypes and shapes.
    `cells_seen`, `cells_reachable`, `coverage`, `collision` (in this step), `collisions` (so far), `pose_m_rad` (x, y, yaw
    in the mine frame), `height_m` (of the floor under the robot, mine frame), `pitch_rad`, `roll_rad` (against the level),
    `zone`, a number into `World.zone_names`: in the default world 0 dry, 1 mud, 2 water. In a world that is one volume also
    `floor`, the storey's number, the largest 0, and `leg`, into `minexplore.volume.legs.leg_names(world)`.

    ## Copies
    `copy.deepcopy` and pickle give an environment in the same state, random numbers included, without windows. It also
    steps in a fork of its process; if anything was drawn before, it draws only in processes started by `"spawn"`.

    ## Arguments

    | Parameter | Default | Description |
    |-----------|---------|-------------|
    | `world` | the id's | path of a world bundle, or the name of one that ships with the package; refused if its hashes do not hold |
    | `task` | `TaskParams()` | or a dict of its fields: beams, ranges, speeds, steps, control and physics step, `region_m` round the entrance, `terrain`, `tilt` |
    | `robot` | `RobotParams()` | or a dict of its fields: radius, mass, wheels, torques, sensor height; or `"husky"` or `"quadrotor"`, see [robots](robots.md) |
    | `render_mode` | None | `"rgb_array"` (without a display by EGL or OSMesa, or as `MUJOCO_GL` says), `"human"` (MuJoCo's viewer) |
    | `camera` | `"chase"` | `"chase"` from behind, `"front"` from the robot, or `"top"`: the plan with the coverage painted on it |
    | `lidar` | `"auto"` | `"embree"` or `"open3d"`; they agree within 1 mm, and `"auto"` takes the first that is installed |
    | `whole` | False | step the robot in the model of all rock instead of that of the rock round it |
    | `pose` | `"true"` | or `"odometry"`: `pose_m_rad` is then counted from the wheels, and `true_pose_m_rad` the true one |
    | `sensors` | `()` | further [sensors](#sensors); the observation is then a `Dict`: `robot` and one entry each, in vectors in batches |
    | `conditions` | `"ideal"` | of all sensors, the beams too: `"typical"`, `"dusty"`, `"wet"`, `SensorParams(...)` or a dict of its fields |
    | `goal` | None | explore; `GoalParams(...)` or a dict of its fields makes it [the task with a goal](#a-goal), as in the ids `GoTo-...` |

    ## Version History
    * v0: the paper's task.
    """

    metadata = {"render_modes": ["rgb_array", "human"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        world: str | Path | None = None,
        task: TaskParams | dict[str, Any] | None = None,
        robot: RobotChoice = None,
        render_mode: str | None = None,
        camera: str = "chase",
        lidar: Backend = "auto",
        whole: bool = False,
        pose: str = "true",
        sensors: Sequence[str] = (),
        conditions: SensorParams | Mapping[str, Any] | str | None = None,
        goal: GoalParams | Mapping[str, Any] | None = None,
    ) -> None:
        """Load the world and put the robot into it."""
        given: dict[str, Any] = dict(task=task, robot=robot, render_mode=render_mode, camera=camera, lidar=lidar)
        given |= {"whole": whole, "pose": pose, "sensors": sensors, "conditions": conditions, "goal": goal}
        gymnasium.utils.EzPickle.__init__(self, world, **given)
        check_mode(render_mode)
        check_camera(camera)
        check_pose(pose)
        if not has_display():  # what goes through all modes, as Gymnasium's checker does, finds those that work
            self.metadata = {**self.metadata, "render_modes": ["rgb_array"]}
        if render_mode is not None:
            from minexplore.pictures.opengl import prepare_opengl

            prepare_opengl(render_mode)
        self.task, self.robot = coerce_params(TaskParams, task), find_robot(robot)
        self.render_mode, self.camera = render_mode, camera
        self.world = load_world(find_world(world))
        conditions = sensor_params(conditions)
        self.robots = make_batch(self.world, self.task, self.robot, 1, 1, lidar, whole, pose, conditions, goal)
        self.grid = self.robots.grid
        self.sensors = check_sensors(sensors)
        self.suite = SensorSuite(self.robots, self._drawing, conditions, lidar)
        own = observations_of(self.task, self.robot, goal, self.world.has_heights)
        self.observation_space = observed_space(own, self.sensors)
        self.action_space = commands_of(self.robot)
        self._renderer: Renderer | None = None
        self._viewer: Any = None
        self._begun = self._closed = False
        self.on_key: Callable[[int], None] = lambda code: None  # gets the viewer's key presses

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Place the robot near the entrance with a random yaw, or as options say, and cast the beams once."""
        self._require_open()
        check_options(options, self.robots.rules.OPTIONS)
        start = self.robots.rules.start_of(options)
        super().reset(seed=one_seed(seed))
        self._begun, outcome = True, self.robots.reset(np.arange(1), [self.np_random], start)
        self.suite.begin((options or {}).get("noise_seed", seed))
        self._show()
        return self._observed(outcome), info_of_robot(outcome.info, 0)

    def step(self, action: np.ndarray) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Drive for one control step and cast the beams.

        Raises
        ------
        ValueError
            If the action is not as many finite numbers as drive the robot.
        gymnasium.error.ResetNeeded, gymnasium.error.ClosedEnvironmentError
            Before the first reset, and after `close`.
        """
        self._require_begun("step")
        command = numbers_of(action)
        if command.shape != self.action_space.shape:
            raise ValueError(f"action of shape {command.shape}: want {self.action_space.shape}")
        outcome: StepOutcome = self.robots.step(command[None], [self.np_random])
        self.suite.advance()
        self._show()
        ends, info = (bool(outcome.terminated[0]), bool(outcome.truncated[0])), info_of_robot(outcome.info, 0)
        return self._observed(outcome), float(outcome.reward[0]), *ends, info

    def capture(self, sensor: str) -> Any:
        """Return what a sensor reads now, whether or not the observation holds it; see `minexplore.sensors.kind`.

        Raises
        ------
        ValueError
            If there is no such sensor; the message lists those that there are.
        """
        self._require_begun("capture")
        return self.suite.capture(check_sensors([sensor])[0])

    def _observed(self, outcome: StepOutcome) -> Any:
        """Return the observation of a step: the robot's own, or with sensors a dict."""
        own = outcome.observation[0]
        return {"robot": own, **{name: self.suite.observe(name) for name in self.sensors}} if self.sensors else own

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """Return a picture (480, 640, 3) uint8 in mode `rgb_array`, else None."""
        self._require_begun("render")
        if self.render_mode != "rgb_array":
            return None
        return self._drawing().draw(self.camera, self.robots.qpos, self.robots.seen[0], self.robots.poses())

    def _drawing(self) -> Renderer:
        if self._renderer is None:
            from minexplore.pictures.render import Renderer

            self._renderer = Renderer(self.world, self.robots.T_world_mine, self.grid, self.robot, 1)
        return self._renderer

    def _show(self) -> None:
        """Bring MuJoCo's viewer up to date in mode `human`."""
        if self.render_mode != "human":
            return
        from minexplore.pictures.viewer import show

        self._viewer = show(self._viewer, self._drawing().place(self.robots.qpos), self)

    def close(self) -> None:
        """Free renderer, viewer and threads; the environment cannot be used afterwards."""
        self._closed = True
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None
        self.suite.close()
        self.robots.close()

    def _require_open(self) -> None:
        if self._closed:
            raise gymnasium.error.ClosedEnvironmentError("the environment is closed: make another one")

    def _require_begun(self, call: str) -> None:
        self._require_open()
        if not self._begun:
            raise gymnasium.error.ResetNeeded(f"call reset before {call}")

    def __getstate__(self) -> dict[str, Any]:
        """Return the arguments and all that has changed since; a copy goes on as this environment does."""
        names = ("_begun", "_closed", "_np_random", "_np_random_seed", "_spec", "task")
        changed = {name: getattr(self, name) for name in names}
        return {
            **super().__getstate__(),
            "changed": changed,
            "robots": self.robots.copy_state(),
            "suite": self.suite.copy_state(),
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the environment from its arguments and bring it into its state; windows are not copied."""
        super().__setstate__(state)
        self.robots.restore_state(state["robots"])
        self.suite.restore_state(state["suite"])
        if state["changed"]["_closed"]:
            self.close()
        self.__dict__.update(state["changed"])
        self._set_task(self.task)

    def _set_task(self, task: TaskParams) -> None:
        self.task = self.robots.task = task
