#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
cat >push.py <<'PY'
import math
import sys

import mujoco

FORCE_N, STEPS, HELD_M, GONE_M = 200, 1500, 0.02, 0.5


def depth_m(angle_deg, several):
    """Return how deep an upright cylinder (radius 0.4 m) is pressed onto the plumb edge of a fixed prism, m."""
    half = math.tan(math.radians(angle_deg / 2))
    corners = " ".join(f"{x} {y} {z}" for z in (-0.5, 0.5) for x, y in ((0, 0), (-1, half), (-1, -half)))
    model = mujoco.MjModel.from_xml_string(
        f'''<mujoco><option gravity="0 0 0"><flag multiccd="{"enable" if several else "disable"}"/></option>
        <asset><mesh name="prism" vertex="{corners}"/></asset><worldbody><geom type="mesh" mesh="prism"/>
        <body pos=".45 0 0"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
        <geom type="cylinder" size=".4 .1" mass="40"/></body></worldbody></mujoco>'''
    )
    data, deepest = mujoco.MjData(model), 0.0
    for _ in range(STEPS):
        data.qfrc_applied[0] = -FORCE_N
        mujoco.mj_step(model, data)
        deepest = max(deepest, -0.05 - data.qpos[0])
    return round(float(deepest), 3)


default = mujoco.MjModel.from_xml_string("<mujoco/>").opt.disableflags & mujoco.mjtDisableBit.mjDSBL_MULTICCD == 0
found = {angle: (depth_m(angle, False), depth_m(angle, True)) for angle in (20, 60)}
print(f"version: MuJoCo {mujoco.__version__}")
print(
    "behaviour: with several contacts a pair of geoms (multiccd, which is the default) a cylinder that is pushed onto a "
    "sharp plumb edge of a mesh passes through the mesh, and with one contact it stops at the edge; a good guess says that "
    "more contacts hold it at least as well"
)
print(f"seen: multiccd is the default: {default}; deepest of one and of several contacts, m, by the edge's angle: {found}")
sys.exit(not default or any(one > HELD_M or several < GONE_M for one, several in found.values()))
PY
for version in 3.17.0 4.0.0; do
    python3 -m venv "$version"
    "$version/bin/pip" install --quiet --disable-pip-version-check "mujoco==$version" numpy==2.4.6
    "$version/bin/python" push.py
done
