"""A ball that rolls from rest down a world's tilted floor: in MuJoCo from the bundle, in Newton from its USD.

As a program it rolls the ball in Newton and prints its places. Newton has an environment of its own, without this
project: it brings MuJoCo Warp, which the project uses wherever it is installed.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

if TYPE_CHECKING:
    from pipeline.mjcf.bundle import WorldRecord

NEWTON = Path(__file__).parents[2] / ".venv/witness/bin/python"
RADIUS_M, DENSITY, FRICTION = 0.2, 1000.0, 1.0
STEP_S, ROLL_S, RECORDED_STEPS = 0.002, 5.0, 50


def start_of(record: WorldRecord) -> np.ndarray:
    """Return the ball's middle (3,) m in the world frame: on the floor at the start of robots."""
    T = np.array(record.T_world_mine)
    place: np.ndarray = T[:3, :3] @ [*record.spawn.anchor_m, RADIUS_M] + T[:3, 3]
    return place


def roll_in_mujoco(model_file: Path, record: WorldRecord) -> np.ndarray:
    """Return places (n, 3) m of the ball every tenth of a second."""
    spec = mujoco.MjSpec.from_file(str(model_file))
    body = spec.worldbody.add_body(name="ball", pos=start_of(record))
    body.add_freejoint()
    sphere = mujoco.mjtGeom.mjGEOM_SPHERE
    body.add_geom(type=sphere, size=[RADIUS_M, 0, 0], density=DENSITY, friction=[FRICTION, 0.005, 0.0001])
    spec.option.timestep = STEP_S
    model = spec.compile()
    data = mujoco.MjData(model)
    places = []
    for step in range(round(ROLL_S / STEP_S)):
        mujoco.mj_step(model, data)
        if (step + 1) % RECORDED_STEPS == 0:
            places.append(data.qpos[:3].copy())  # `xpos` is that of the step before
    return np.array(places)


def roll_in_newton(stage: Path, record: WorldRecord) -> np.ndarray:
    """Return the same by Newton."""
    command = [NEWTON, __file__, stage, *map(str, start_of(record))]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return np.array(json.loads(done.stdout.splitlines()[-1]))  # Warp prints lines above


def _roll_here(stage: str, start: list[float]) -> list[list[float]]:
    """Return places of the ball, m, by Newton's MuJoCo solver on the CPU."""
    import newton
    import warp

    builder = newton.ModelBuilder(up_axis=newton.Axis.Z)
    builder.add_usd(stage, load_visual_shapes=False)
    ball = builder.add_body(xform=warp.transform(warp.vec3(*start), warp.quat_identity()))
    config = newton.ModelBuilder.ShapeConfig(density=DENSITY, mu=FRICTION)
    builder.add_shape_sphere(ball, radius=RADIUS_M, cfg=config)
    model = builder.finalize(device="cpu")
    solver = newton.solvers.SolverMuJoCo(model, use_mujoco_cpu=True)
    now, later, control = model.state(), model.state(), model.control()
    places: list[Any] = []
    for step in range(round(ROLL_S / STEP_S)):
        now.clear_forces()
        solver.step(now, later, control, None, STEP_S)
        now, later = later, now
        if (step + 1) % RECORDED_STEPS == 0:
            places.append(now.body_q.numpy()[ball, :3].tolist())
    return places


if __name__ == "__main__":
    print(json.dumps(_roll_here(sys.argv[1], [float(word) for word in sys.argv[2:]])))
