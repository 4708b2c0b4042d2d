#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --no-compile --disable-pip-version-check mujoco==3.17.0 mujoco-mjx==3.17.0 jax==0.10.2 jaxlib==0.10.2 numpy==2.4.6
venv/bin/python - <<'PY'
import sys

import jax
import mujoco
import numpy as np
from mujoco import mjx

SHAPES = {
    "box": 'type="box" size=".5 .5 .5"',
    "capsule": 'type="capsule" size=".3 .2"',
    "cylinder": 'type="cylinder" size=".5 .5"',
    "hfield": 'type="hfield" hfield="floor"',
}
START_M, DOWN = np.array([0.01, 0.02, 3.0]), np.array([0.0, 0.0, -1.0])


def ranges(shape):
    """Return the range of a ray from above, by mj_ray and by mjx.ray, m; -1 is a miss."""
    model = mujoco.MjModel.from_xml_string(
        f'''<mujoco><asset><material name="rock"/>
        <hfield name="floor" nrow="3" ncol="3" size="1 1 .5 .1" elevation="0 0 0 0 1 0 0 0 0"/></asset>
        <worldbody><geom {SHAPES[shape]} material="rock"/></worldbody></mujoco>'''
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    other, placed = mjx.put_model(model), mjx.put_data(model, data)
    by_mjx = jax.jit(lambda start, way: mjx.ray(other, placed, start, way)[0])(START_M, DOWN)
    by_c = mujoco.mj_ray(model, data, START_M, DOWN, None, 1, -1, np.zeros(1, np.int32), None)
    return round(by_c, 2), round(float(by_mjx), 2)


found = {shape: ranges(shape) for shape in SHAPES}
print(f"version: MJX and MuJoCo {mujoco.__version__}, JAX {jax.__version__}")
print(
    "behaviour: mjx.ray passes through cylinders and height fields without a word, and returns a miss; a good guess says that "
    "it finds what mj_ray finds, or that it refuses a model with such a geom"
)
print(f"seen: range in m by mj_ray and by mjx.ray: {found}")
misses = all(found[shape][0] > 0 and found[shape][1] == -1 for shape in ("cylinder", "hfield"))
sys.exit(not (misses and all(abs(one - other) < 0.02 for one, other in (found["box"], found["capsule"]))))
PY
