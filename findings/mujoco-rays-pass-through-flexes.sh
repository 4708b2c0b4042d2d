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

START_M, DOWN = np.array([0.1, 0.05, 2.0]), np.array([0.0, 0.0, -1.0])
MODEL = """<mujoco><worldbody><geom type="plane" size="5 5 .1" pos="0 0 -3"/>
<body name="frame"><flexcomp name="curtain" type="grid" dim="2" count="9 9 1" spacing=".25 .25 .25" rigid="true"/></body>
<body name="eye" pos=".1 .05 2"><joint/><geom size=".05"/><site name="eye" zaxis="0 0 -1"/></body>
<body pos="-.4 .1 .08"><freejoint/><geom name="stone" size=".1"/></body>
</worldbody><sensor><rangefinder site="eye"/></sensor></mujoco>"""
model = mujoco.MjModel.from_xml_string(MODEL)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
geom, vertex = np.zeros(1, np.int32), np.zeros(1, np.int32)
found = {
    "rangefinder": float(data.sensordata[0]),
    "mj_ray": mujoco.mj_ray(model, data, START_M, DOWN, None, 1, model.body("eye").id, geom, None),
    "mj_rayFlex": mujoco.mj_rayFlex(model, data, 0, False, False, True, False, 0, START_M, DOWN, vertex, None),
}
touches = any(0 in contact.flex for contact in data.contact)
print(f"version: MuJoCo {mujoco.__version__}")
print(
    "behaviour: a rangefinder and mj_ray see through a flex, which is drawn and stops a stone, to the floor behind it; only "
    "mj_rayFlex, one flex a call, finds it; a good guess says that a ray ends on what is drawn and collides"
)
print(f"seen: a curtain 2 m below, the floor 5 m below: {found} m; a stone touches the curtain: {touches}")
sys.exit(found != {"rangefinder": 5.0, "mj_ray": 5.0, "mj_rayFlex": 2.0} or not touches)
PY
