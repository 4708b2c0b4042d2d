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

TWINNED_M = np.array(
    [
        [-0.258637475, -0.251204174, 0.160947478],
        [-0.118070178, -0.288869068, 0.160947478],
        [0.048859643, 0.000261864, -0.419052522],
        [0.048859643, 0.000261865, -0.419052522],  # 1 nm beside the one before
        [-0.026771189, -0.130782379, 0.460960422],
        [-0.026624264, -0.130527905, 0.460524544],
        [0.086772949, 0.300574155, -0.341287525],
        [0.148775471, 0.283998132, -0.341278131],
        [0.203585527, 0.268207149, -0.339333332],
        [0.203933029, 0.269219753, -0.341213613],
    ]
)


def contacts_mm(corners):
    """Return the depths of the contacts of a ball of 3 cm that reaches 24 mm into a convex mesh."""
    spec = mujoco.MjSpec()
    spec.add_mesh(name="rock", uservert=corners.ravel().tolist(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="rock")
    ball = spec.worldbody.add_body(pos=[-0.14283885, -0.26837086, 0.12485113])
    ball.add_freejoint()
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.03, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return [round(float(contact.dist) * -1000, 1) for contact in data.contact]


twins, single = contacts_mm(TWINNED_M), contacts_mm(np.delete(TWINNED_M, 3, axis=0))
print(f"version: MuJoCo {mujoco.__version__}")
print(
    "behaviour: a convex mesh that has a corner twice, 1 nm apart, has no contact with a ball that reaches into it by 24 mm; a "
    "good guess says that a second corner at the place of the first changes nothing"
)
print(f"seen: depths of contacts in mm with both corners {twins}, with one of them {single}")
sys.exit(not (twins == [] and len(single) == 1 and 23 < single[0] < 25))
PY
