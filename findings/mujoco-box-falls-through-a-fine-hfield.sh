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

HALF_M = 0.5  # of the box; it lies on a level height field of 4 m by 4 m


def after_a_second(points):
    """Return the contacts of a box at rest, and its height over the field after 1 s, m; warnings are counted too."""
    model = mujoco.MjModel.from_xml_string(
        f'''<mujoco><asset><hfield name="floor" nrow="{points}" ncol="{points}" size="2 2 1 .1"/></asset><worldbody>
        <geom type="hfield" hfield="floor"/>
        <body pos="0 0 .05"><freejoint/><geom type="box" size="{HALF_M} {HALF_M} .05" mass="10"/></body>
        </worldbody></mujoco>'''
    )
    data = mujoco.MjData(model)
    while data.time < 1:
        mujoco.mj_step(model, data)
    return data.ncon, round(float(data.qpos[2]) - 0.05, 3), sum(int(warning.number) for warning in data.warning)


found = {round(4 / (points - 1), 3): after_a_second(points) for points in (11, 21, 41, 101, 201)}
print(f"version: MuJoCo {mujoco.__version__}")
print(
    "behaviour: a box that covers many cells of a level height field tips and sinks through it, with no warning counted, as "
    "the 50 contacts that a pair keeps are not spread under it; a good guess says that 50 contacts hold a box level"
)
print(f"seen: contacts, height after 1 s (m), warnings by size of a cell in m: {found}")
fine, coarse = [found[0.04], found[0.02]], [found[0.4], found[0.2], found[0.1]]
sys.exit(not (all(end[1] < -0.2 and end[2] == 0 for end in fine) and all(abs(end[1]) < 0.01 for end in coarse)))
PY
