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

SIDE, FOCAL = 40, 50  # pixels
SENSOR = f'focalpixel="{FOCAL} {FOCAL}" sensorsize=".004 .004"'
CAMERAS = {
    "fovy": f'fovy="{2 * np.degrees(np.arctan(SIDE / 2 / FOCAL))}"',
    "sensorsize": SENSOR,
    "principalpixel 4 0": f'{SENSOR} principalpixel="4 0"',
}


def middles(camera):
    """Return the column where the axis of a camera is: in pictures, by camprojection, by the rays of a rangefinder."""
    model = mujoco.MjModel.from_xml_string(
        f'''<mujoco><worldbody><geom type="box" size="30 30 .1" pos="0 0 -5"/><site name="ahead" pos="0 0 -4"/>
        <body><camera name="eye" resolution="{SIDE} {SIDE}" {camera}/></body></worldbody><sensor>
        <camprojection camera="eye" site="ahead"/><rangefinder camera="eye" data="dir"/></sensor></mujoco>'''
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    scene, view = mujoco.MjvScene(model, 10), mujoco.MjvCamera()
    view.type, view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, 0
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, view, mujoco.mjtCatBit.mjCAT_ALL, scene)
    eye = scene.camera[0]
    half_width = (eye.frustum_top - eye.frustum_bottom) / 2  # pictures are square
    first = data.sensordata[2:5]  # of the ray through the middle of the first pixel, half a pixel from the side
    columns = SIDE / 2 * (1 - eye.frustum_center / half_width), data.sensordata[0], 0.5 + FOCAL * first[0] / first[2]
    return [round(float(column), 3) for column in columns]


found = {name: middles(camera) for name, camera in CAMERAS.items()}
print(f"version: MuJoCo {mujoco.__version__}")
print(
    "behaviour: the rays of a rangefinder of a camera with a sensorsize have its axis at the first pixel, as if principal "
    "counted from there, and camprojection leaves principal out; a good guess says that both fit the camera's picture"
)
print(f"seen: column of the axis in pictures {SIDE} wide, by camprojection, by rays: {found}")
sys.exit(found != {"fovy": [20, 20, 20], "sensorsize": [20, 20, 0], "principalpixel 4 0": [16, 20, 4]})
PY
