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

SIDE = 0.5
tree = pyoctomap.OcTree(SIDE)
tree.updateNode([0.1, 0.1, 0.1], True)  # in the voxel from 0 to 0.5 along each axis
tree.updateInnerOccupancy()
leaf = next(iter(tree.begin_leafs()))
middle = [float(value) for value in leaf.getCoordinate()]
point = [float(value) for value in tree.extractPointCloud()[0][0]]
print("version: pyoctomap 1.2.2")
print("behaviour: extractPointCloud() returns the voxel's upper corner; a good guess says its middle, as the leaf does")
print(f"seen: one voxel from 0 to {SIDE} m: the leaf is at {middle}, the point of the cloud at {point}")
sys.exit(not (middle == [SIDE / 2] * 3 and point == [SIDE] * 3))
PY
