#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check mujoco==3.17.0
venv/bin/python - <<'PY'
import sys

import mujoco

tetrahedron = "v {0} 0 0\nv {1} 0 0\nv {0} 1 0\nv {0} 0 1\nf -4 -2 -3\nf -4 -3 -1\nf -4 -1 -2\nf -3 -2 -1\n"
obj = "o entrance\n" + tetrahedron.format(0, 1) + "o shaft\n" + tetrahedron.format(5, 6)
model = mujoco.MjModel.from_xml_string(
    """<mujoco><asset><mesh name="m" file="m.obj"/></asset>
<worldbody><geom type="mesh" mesh="m"/></worldbody></mujoco>""",
    assets={"m.obj": obj.encode()},
)
print(f"version: mujoco {mujoco.__version__}")
print(
    "behaviour: of an OBJ file with two objects a mesh has the corners of both and the faces of the first, without a word; "
    "a good guess says that it has all faces, or that the file is refused"
)
print(f"seen: 8 corners and 8 faces in the file, {model.mesh_vertnum[0]} and {model.mesh_facenum[0]} in the model")
sys.exit((int(model.mesh_vertnum[0]), int(model.mesh_facenum[0])) != (8, 4))
PY
