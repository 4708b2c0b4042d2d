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

RADIUS_M, HALF_M, SPEED_MPS, APART_M, WAY = 0.35, 0.12, 0.3, 0.002, 0.7
SHAPES = {"cylinder": (f'type="cylinder" size="{RADIUS_M} {HALF_M}"', HALF_M), "sphere": (f'size="{RADIUS_M}"', RADIUS_M)}
EAST, NORTH = math.cos(WAY), math.sin(WAY)


def meet(shape, step_s):
    """Return how far one of two equal bodies that meet on a level floor rises in 3 s, mm, and their most contacts."""
    geom, z = SHAPES[shape]
    far = 2 * RADIUS_M + APART_M
    model = mujoco.MjModel.from_xml_string(
        f'''<mujoco><option timestep="{step_s}"/><worldbody><geom type="plane" size="5 5 .1" friction=".1"/>
        <body pos="0 0 {z}"><freejoint/><geom {geom} mass="40"/></body>
        <body pos="{far * EAST} {far * NORTH} {z}"><freejoint/><geom {geom} mass="40"/></body></worldbody></mujoco>'''
    )
    data = mujoco.MjData(model)
    data.qvel[:2], data.qvel[6:8] = (SPEED_MPS * EAST, SPEED_MPS * NORTH), (-SPEED_MPS * EAST, -SPEED_MPS * NORTH)
    rise, most = 0.0, 0
    while data.time < 3:
        mujoco.mj_step(model, data)
        rise = max(rise, float(max(data.qpos[2], data.qpos[9])) - z)
        most = max(most, sum(int(min(contact.geom) > 0) for contact in data.contact))
    return round(rise * 1000, 1), most


found = {(shape, step): meet(shape, step) for shape in SHAPES for step in (0.002, 0.005)}
bound_mm = SPEED_MPS**2 / 9.81 * 1000  # that the energy of both bodies can lift one
print(f"version: MuJoCo {mujoco.__version__}")
print(
    "behaviour: two upright cylinders that meet side by side touch at one point, at an end of the line that they share, and jump "
    "up with more energy than they had; a good guess says that they touch along the line and stay on the floor, as spheres do"
)
print(f"seen: rise in mm and most contacts, by shape and step in s: {found}; their energy lifts one by {bound_mm:.1f} mm")
jumps = found["cylinder", 0.005][0] > 2 * bound_mm and found["cylinder", 0.005][1] == 1
sys.exit(not (jumps and found["sphere", 0.005][0] < 0.1))
PY
