#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check mujoco==3.17.0 numpy==2.4.6
venv/bin/python - <<'PY'
import ctypes
import gc
import sys

import mujoco
import numpy as np

POINTS = 500  # along each side of a mesh


def resident_mb():
    """Return the resident memory of this process, MB, after free memory was handed back."""
    gc.collect()
    ctypes.CDLL("libc.so.6").malloc_trim(0)
    status = dict(line.split(":", 1) for line in open("/proc/self/status"))
    return round(int(status["VmRSS"].split()[0]) / 1000)


x, y = np.meshgrid(np.arange(POINTS), np.arange(POINTS))
places = np.column_stack([x.ravel(), y.ravel(), np.random.default_rng(0).random(x.size) * 0.1]).astype(np.float32)
one = np.arange(x.size).reshape(x.shape)[:-1, :-1].ravel()
faces = np.concatenate([[one, one + 1, one + POINTS + 1], [one, one + POINTS + 1, one + POINTS]], axis=1).T.astype(np.int32)
mesh = np.array([len(places), 0, 0, len(faces)], np.int32).tobytes() + places.tobytes() + faces.tobytes()
xml = """<mujoco><asset><mesh name="m" file="m.msh" inertia="shell"/></asset>
<worldbody><geom type="mesh" mesh="m" contype="0" conaffinity="0"/></worldbody></mujoco>"""
before = resident_mb()
model = mujoco.MjModel.from_xml_string(xml, assets={"m.msh": mesh})
own = model.nbuffer / 1e6
loaded = resident_mb()
del model
deleted = resident_mb()
del mesh
mujoco.MjModel.from_xml_string("<mujoco/>")
replaced = resident_mb()
print(f"version: MuJoCo {mujoco.__version__}")
print(
    "behaviour: what a model was compiled from stays in memory after the model is deleted, until another model is loaded; a good "
    "guess says that memory is free when nothing refers to the model"
)
print(
    f"seen: a model of {own:.0f} MB takes {loaded - before} MB; once it is deleted {deleted - before} MB are in use, and after "
    f"an empty model was loaded {replaced - before} MB"
)
sys.exit(not (deleted - before > 2 * own and deleted - replaced > own))
PY
