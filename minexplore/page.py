"""The environment's page as Markdown: its docstring, its ids, and the physics read from a compiled model."""

from __future__ import annotations

import inspect
import re
from typing import Any

import mujoco

from minexplore import ROBOT_TASKS, WORLDS
from minexplore.envs.env import MineEnv
from minexplore.physics.local_models import ALONE, physics_spec
from minexplore.physics.robot import FLOOR_BIT, ROCK_BIT, RobotParams, attach_robot
from minexplore.sensors.page import sensors_section
from minexplore.task import TaskParams
from minexplore.tasks.goto import GoTo

_ROBOT = "robot"
_PHYSICS = """## Physics

Written from a compiled model. Everything that is not named is MuJoCo's default. A control step of {control_s:g} s is
{substeps} physics steps. The wheel speeds of a command are set once before them: (v - w b / 2) / r left and
(v + w b / 2) / r right, where b is the wheel base of {wheel_base_m:g} m and r the wheel radius of {wheel_radius_m:g} m.
A robot starts at rest and level with the floor, with its wheels' centres r above it.

| option | value |
|---|---|
{options}

### Contacts

Two geoms touch where a bit of one's `contype` is in the other's `conaffinity`. Floor zones have the contype {floor},
rock and roof {rock}, each with the conaffinity 0. A floor zone is a box with priority 1 and the friction (the
zone's, 0.005, 0.0001), which holds whatever the wheel's is. Rock is convex meshes; its sliding friction is
`rock_friction` of `world.json`. A collision is a contact of the chassis with rock or roof in any physics step of a
control step.

| geom of the robot | shape | size, m | place, m | contype | conaffinity | condim | priority | friction |
|---|---|---|---|---|---|---|---|---|
{geoms}

In a world that is one volume, each wheel has the friction of the zone that it is in when a control step begins. Each
foot stands on a box whose top is the plane of the floor under it, set at the beginning of a control step, where that
plane is within 5 mm of the floor as far as the foot reaches. Where it is not, as at edges and steps, the foot touches
the parts of the floor themselves; so do all feet of a team, of another robot and with `whole`. Of the walls there is
what the chassis can reach.

Places are in the robot's frame: origin midway between the wheels' centres, x ahead, z up. The bumper touches
other robots.

| body | mass, kg | centre of mass, m | principal inertia, kg m2 |
|---|---|---|---|
{bodies}

{servos}

### Models and data

There is no one `model` and `data` as in Gymnasium's own MuJoCo environments: each robot is stepped in the model of the
rock round it ([ADR 6](../adr/0006-robots-are-stepped-in-local-models.md)). What there is instead:

| attribute of `env.unwrapped` | what it is |
|---|---|
| `robots.qpos`, `robots.qvel` | (n, numbers): each robot's joints, world frame; views of its state |
| `robots.local_models.model(tile)` | the model of a tile with one robot; `tiles_of` finds a place's |
| `world.spec()` | the whole world as `MjSpec`, without a robot; [`minexplore.place`](robots.md) attaches one |
| `robots.T_world_mine` | (4, 4): from the mine frame to the world frame, in which MuJoCo computes |

`MineParallelEnv` has all robots and all rock in one: `team.model` and `team.data`, which every step advances.

### Random numbers

Each robot draws from a generator of its own, `gymnasium.utils.seeding.np_random(seed)`, which is
`numpy.random.Generator(numpy.random.PCG64(seed))`; robot i of a vector or a team has the seed `seed + i`.

- `reset` draws, in this order: where the anchor is too narrow, `integers(n)` over the n free cells of the entrance
  region, row by row, in a volume in the order of `cells.npz`; the yaw, `uniform(-pi, pi)`; the beams' noise,
  `standard_normal(beams)`.
- `step` draws, in this order: in a zone with noise, `normal(0, speed_noise_mps)` for the forward speed; the beams'
  noise, `standard_normal(beams)`.
"""

_FAMILY = """## Unseen mines

`MineXplore/Family-v0` draws a mine at every reset, by the episode's seed, from a split of the [generated
family](../how-to/families.md). The mines must be built: `python -m benchmarks worlds --count 1000` makes those of
`train`. They are light worlds without visible rock, so beams end on the collision walls.

```python
env = gymnasium.make("MineXplore/Family-v0", split="test")
observation, info = env.reset(seed=7)  # info["mine"] is its number in the split, env.unwrapped.mine its name
observation, info = env.reset(options={"mine": "test-0007"})
```

| Parameter | Default | Description |
|-----------|---------|-------------|
| `split` | `"train"` | `"train"` (1,000 mines), `"validation"` (50) or `"test"` (200) |
| `mines` | None | draw among these names, or the first so many mines of the split |
| `families` | None | folder of the worlds; `artifacts/families` of a source checkout |

All other arguments are those of the environment above, without `world`. `gymnasium.make_vec` gives each robot a mine of
its own. Which mine a seed draws does not depend on which mines are built; a drawn mine that is missing is an error.
Training refuses the mines of `validation` and `test`, and variants of the embedded mine.
"""

_GOAL = """## A goal

`MineXplore/GoTo-v0` (any world), `GoTo-ChileanMine-v0` and so on for every id above and every mine of your own, is the
same environment with another task.

{body}

```python
env = gymnasium.make("MineXplore/GoTo-ChileanMine-v0", goal={{"radius_m": 0.5}})
observation, info = env.reset(seed=0, options={{"station": "J00", "goal": "J01"}})
```

[Baselines](../evidence/learning.md#to-a-goal) are a planner on the map and a driver without one:
`python -m minexplore record GoTo-ChileanMine --policy planner --out drive.mcap`, or `map-free`.
"""

_VECTOR = """## Many robots

`gymnasium.make_vec` steps many robots in one call, each alone in its own copy of the mine, with the trajectories of
single ones. `np_random_seed` has a seed a robot.

| `autoreset_mode` | when an episode has ended |
|---|---|
| `"NEXT_STEP"` | the next step resets the robot and ignores its action |
| `"SAME_STEP"` | the step resets it; `final_obs` and `final_info` hold its last ones |
| `"DISABLED"` | `reset(options={"reset_mask": ...})` resets it; a step before that is refused |

Gymnasium's vector wrappers of observations, such as `NormalizeObservation` and `FlattenObservation`, refuse
`SAME_STEP`, in version 1.2.2 by a bare `AssertionError`: take `NEXT_STEP` with them. Other arguments are those above,
with `threads`. In `gymnasium.make_vec` the horizon is `max_episode_steps`; `max_steps` of a task beside it is refused.
"""

_TEAM = """## A team

`MineParallelEnv` has several robots in one mine that see and touch each other, as a `ParallelEnv` of PettingZoo:

```python
from minexplore.envs.multi_agent import MineParallelEnv

team = MineParallelEnv(robots=4, world="chilean_mine")
observations, infos = team.reset(seed=0)
```

`reward` is `"shared"` or `"individual"`; `world`, `task`, `robot`, `render_mode`, `camera`, `lidar`, `pose`, `sensors`,
`conditions` and `goal` are as above, and so are the options of `reset`. Robots of any kind touch each other. Beams and
clouds end on other robots, and images show them; the reading `map` is the team's. With a goal each robot has its own,
and leaves the team when it is there. Where one robot stands already, the next begins at the nearest free place.
"""

_WARP = """## Many robots on a GPU

`sh requirements/setup.sh gpu` installs MuJoCo Warp and torch. The same task then runs on a CUDA device, all robots at
once:

```text
env = gymnasium.make_vec("MineXplore/ChileanMine-v0", num_envs=65536, vectorization_mode="vector_entry_point",
                         backend="warp", device="cuda:0")
```

| Parameter | Default | Description |
|-----------|---------|-------------|
| `backend` | `"mujoco"` | `"mujoco"` steps robots on the CPU, `"warp"` on `device` |
| `device` | `"cuda:0"` | a device of Warp; `"cpu"` works without a GPU and is slow |
| `numpy` | False | return copies as arrays, and look for faults in every step |
| `autoreset_mode` | `"NEXT_STEP"` | `"SAME_STEP"`: `final_obs`, `final_info` have rows by robot, masked; `"DISABLED"` |

`world`, `task` and `robot` are as above; there are no pictures, and no copies of the environment. Observations,
rewards, flags and the info are torch tensors on the device. They are views of the environment's own arrays: the next
call overwrites them. `step` waits for nothing, so `check` reports faults:
actions or states that are not finite, robots outside of the mine, and limits of MuJoCo Warp that were too small.

Floors are level here: a mine with heights, a volume included, or with a rough floor is refused at once.

The CPU's environment is the reference; [the page of speeds](../evidence/speed.md) says how closely the two agree.
Physics has 32 bits and random numbers are those of Philox, with the seed as key, so whole episodes can agree in
distribution only.
"""


def page() -> str:
    """Return the environment's page."""
    text = inspect.cleandoc(MineEnv.__doc__ or "")
    title, _, rest = text.partition("\n")
    rows = "\n".join(
        f"| `{env_id}` | {kwargs or 'any world'} |" for env_id, kwargs in {**WORLDS, **ROBOT_TASKS}.items()
    )
    rows += "\n| `MineXplore/Family-v0` | a mine an episode, see [below](#unseen-mines) |"
    rows += "\n| `MineXplore/Family-test-0007-v0` | one mine of a split, once it is built |"
    ids = f"## Environments\n\n| id | arguments |\n|---|---|\n{rows}\n"
    use = '```python\nimport gymnasium, minexplore\n\nenv = gymnasium.make("MineXplore/ChileanMine-v0")\n```\n'
    body, versions, history = rest.partition("## Version History")
    goal = re.sub("^## ", "### ", inspect.cleandoc(GoTo.__doc__ or ""), flags=re.MULTILINE)
    more = f"{_GOAL.format(body=goal)}\n{sensors_section()}\n{_VECTOR}\n{_FAMILY}\n{_TEAM}\n{_WARP}\n{physics()}"
    return f"# Explore a mine\n\n{title}\n\n{use}\n{ids}{body}{more}\n{versions}{history}\n"


def physics() -> str:
    """Return the section on physics: options, contacts, the robot, and the order of random numbers."""
    task, robot = TaskParams(), RobotParams()
    spec = physics_spec(task)
    attach_robot(spec, _ROBOT, robot)
    model = spec.compile()
    return _PHYSICS.format(
        control_s=task.control_s,
        substeps=task.substeps,
        wheel_base_m=robot.wheel_base_m,
        wheel_radius_m=robot.wheel_radius_m,
        options="\n".join(f"| {name} | {value} |" for name, value in option_values(model).items()),
        floor=FLOOR_BIT,
        rock=ROCK_BIT,
        geoms=_geoms(model),
        bodies=_bodies(model),
        servos=_servos(model),
    )


def option_values(model: mujoco.MjModel) -> dict[str, str]:
    """Return the options that decide how a model moves, as the page prints them."""
    opt = model.opt
    return {
        "timestep": f"{opt.timestep:g} s",
        "integrator": mujoco.mjtIntegrator(opt.integrator).name,
        "solver": mujoco.mjtSolver(opt.solver).name,
        "iterations, tolerance": f"{opt.iterations}, {opt.tolerance:g}",
        "line search: iterations, tolerance": f"{opt.ls_iterations}, {opt.ls_tolerance:g}",
        "friction cone": mujoco.mjtCone(opt.cone).name,
        "impratio": f"{opt.impratio:g}",
        "Jacobian": mujoco.mjtJacobian(opt.jacobian).name,
        "disabled": _flags(opt.disableflags & ~ALONE, mujoco.mjtDisableBit),
        "enabled": _flags(opt.enableflags, mujoco.mjtEnableBit),
        "gravity": f"({', '.join(f'{g:g}' for g in opt.gravity)}) m/s2",
    }


def _flags(value: int, kind: Any) -> str:
    names = [name for name, bit in kind.__members__.items() if not name.startswith("mjN") and value & int(bit)]
    return ", ".join(names) or "nothing"


def _geoms(model: mujoco.MjModel) -> str:
    """Return a table row for each of the robot's geoms that can touch something."""
    rows = []
    for geom in (model.geom(g) for g in range(model.ngeom)):
        if not (geom.contype[0] or geom.conaffinity[0]):
            continue
        body = model.body(int(geom.bodyid[0]))
        place = geom.pos + (body.pos if body.name != _ROBOT else 0.0)
        shape = mujoco.mjtGeom(geom.type[0]).name.removeprefix("mjGEOM_").lower()
        size = " x ".join(f"{s:g}" for s in geom.size if s)
        kind = geom.name.removeprefix(f"{_ROBOT}_")
        friction = ", ".join(f"{f:g}" for f in geom.friction)
        rows.append(
            f"| {kind} | {shape} | {size} | {', '.join(f'{p:.4g}' for p in place)} | {geom.contype[0]} | "
            f"{geom.conaffinity[0]} | {geom.condim[0]} | {geom.priority[0]} | {friction} |"
        )
    return "\n".join(rows)


def _bodies(model: mujoco.MjModel) -> str:
    """Return a table row for each of the robot's bodies."""
    rows = []
    for body in (model.body(name) for name in (_ROBOT, f"{_ROBOT}_left", f"{_ROBOT}_right")):
        centre = body.ipos + (body.pos if body.name != _ROBOT else 0.0)
        numbers = (", ".join(f"{value:.4g}" for value in values) for values in (centre, body.inertia))
        rows.append(f"| {body.name.removeprefix(f'{_ROBOT}_')} | {body.mass[0]:.4g} | {' | '.join(numbers)} |")
    return "\n".join(rows)


def _servos(model: mujoco.MjModel) -> str:
    """Return a sentence on the wheels' joints and motors."""
    motor, joint = model.actuator(f"{_ROBOT}_left"), model.joint(f"{_ROBOT}_left")
    low, high = motor.forcerange
    gain, friction, armature, damping = (
        f"{value:g}" for value in (motor.gainprm[0], joint.frictionloss[0], joint.armature[0], joint.damping[0])
    )
    return (
        f"A velocity servo turns each wheel about the robot's y axis: its torque is {gain} N m s times the wanted\n"
        f"less the present wheel speed, clipped to {low:g} and {high:g} N m. The joints have dry friction\n"
        f"{friction} N m, armature {armature} kg m2 and damping {damping} N m s."
    )
