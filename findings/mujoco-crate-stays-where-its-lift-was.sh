#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check mujoco==3.17.0 numpy==2.4.6
venv/bin/python - <<'PY'
import sys

import mujoco

MODEL = """<mujoco><option><flag sleep="enable"/></option><worldbody>
<body name="lift" mocap="true" pos="0 0 -.1"><geom type="box" size="1 1 .1"/></body>
<body name="crate" pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1"/></body>
</worldbody></mujoco>"""
SPEED_MPS, DOWN_M = 0.5, 1.0
model = mujoco.MjModel.from_xml_string(MODEL)


def gap_m(steps):
    """Return how far a crate is over its lift, which has gone down, having left after a number of steps."""
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, steps)
    for _ in range(round(DOWN_M / SPEED_MPS / model.opt.timestep)):
        data.mocap_pos[0, 2] -= SPEED_MPS * model.opt.timestep
        mujoco.mj_step(model, data)
    return round(float(data.body("crate").xpos[2] - data.body("lift").xpos[2]) - 0.2, 2)


found = {steps: gap_m(steps) for steps in range(500, 530)}
left = [steps for steps, gap in found.items() if gap > 0.9 * DOWN_M]
print(f"version: MuJoCo {mujoco.__version__}")
print(
    "behaviour: with sleep a crate on a mocap lift falls asleep and is woken again every ten steps; if the lift leaves in two "
    "of these, the crate stays in the air; a good guess says that what moves away wakes what lay on it"
)
print(f"seen: lift down by {DOWN_M} m, crate in the air by step of departure: {left} of 500 to 529; other gaps "
      f"{sorted({gap for steps, gap in found.items() if steps not in left})} m")
sys.exit(not (0 < len(left) < 15 and max(abs(gap) for steps, gap in found.items() if steps not in left) < 0.01))
PY
