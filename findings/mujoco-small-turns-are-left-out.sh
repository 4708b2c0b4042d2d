#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check mujoco==3.17.0 numpy==2.4.6
venv/bin/python - <<'PY'
import math
import sys

import mujoco

HALF_M = 250.0  # of a long straight wall


def end_off_mm(turn_rad):
    """Return how far the end of a wall is from where the text places it, mm."""
    turned = f"{math.cos(turn_rad / 2):.17g} 0 0 {math.sin(turn_rad / 2):.17g}"
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><geom type="box" size="{HALF_M} .5 1" quat="{turned}"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return round(float(abs(data.geom_xmat[0][3] - math.sin(turn_rad)) * HALF_M * 1000), 4)


found = {turn: end_off_mm(turn) for turn in (1e-6, 1.9e-6, 2.1e-6, 1e-5)}
print(f"version: MuJoCo {mujoco.__version__}")
print(
    "behaviour: a geom turned by less than 2e-6 rad from the axes of its body, or from its axes of inertia, is placed as if it "
    "were not, so the end of a long wall moves; a good guess says that a turn in 64 bits counts however small it is"
)
print(f"seen: by turn in rad, mm that the end of a wall of {2 * HALF_M:g} m is off: {found}")
sys.exit(not (0.2 < found[1e-6] < 0.3 and 0.4 < found[1.9e-6] < 0.5 and found[2.1e-6] == found[1e-5] == 0))
PY
