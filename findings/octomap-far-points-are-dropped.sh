#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check pyoctomap==1.2.2 numpy==2.4.6
venv/bin/python - <<'PY'
import sys

import pyoctomap

tree = pyoctomap.OcTree(0.05)
tree.updateNode([351234.3, 10.0, 0.0], True)
far = tree.getNumLeafNodes()
tree.updateNode([1.0, 10.0, 0.0], True)
near = tree.getNumLeafNodes()
print("version: pyoctomap 1.2.2")
print(
    "behaviour: a place more than 32,768 voxels from the origin, 1.6 km at 5 cm, is not stored and nothing is raised or "
    "returned that says so; a good guess says that an octree grows or refuses it"
)
print(f"seen: {far} voxels after a place at 351,234 m, {near} after one at 1 m")
sys.exit((far, near) != (0, 1))
PY
