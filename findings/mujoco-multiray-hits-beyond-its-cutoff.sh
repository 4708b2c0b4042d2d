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
import numpy as np

CUTOFF_M = 3.0
MODEL = """<mujoco><worldbody>
<geom name="drift wall" type="box" size="20 .1 2" pos="19 1.1 0"/>
<geom name="pillar" type="box" size=".5 .5 2" pos="6.5 0 0"/>
</worldbody></mujoco>"""
model = mujoco.MjModel.from_xml_string(MODEL)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
ways = np.array([[0, 1, 0], [1, 0.1, 0], [1, 0, 0]], float)  # to the wall beside, to the wall far ahead, to the pillar
ways /= np.linalg.norm(ways, axis=1)[:, None]


def ranges(cutoff_m):
    """Return the ranges of the three rays from the origin, m."""
    geoms, found = np.zeros(3, np.int32), np.zeros(3)
    mujoco.mj_multiRay(model, data, np.zeros(3), ways.ravel(), None, 1, -1, geoms, found, None, 3, cutoff_m)
    return found.round(3).tolist()


far, near = ranges(mujoco.mjMAXVAL), ranges(CUTOFF_M)
print(f"version: MuJoCo {mujoco.__version__}")
print(
    "behaviour: mj_multiRay's cutoff leaves out geoms that lie wholly beyond it; a hit beyond it on a long geom that begins "
    "nearer is returned as it is; a good guess says that no range above the cutoff comes back"
)
print(f"seen: wall beside, wall ahead, pillar: {far} m without a cutoff, {near} m with a cutoff of {CUTOFF_M} m")
sys.exit(not (near == [far[0], far[1], -1.0] and near[1] > 3 * CUTOFF_M and far[2] > CUTOFF_M))
PY
