#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check manifold3d==3.5.4 numpy==2.4.6
venv/bin/python - <<'PY'
import sys
from importlib.metadata import version

import manifold3d
import numpy as np

SIDE, TOLERANCE_M = 100, 0.002
x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 6, SIDE), np.linspace(0, 6, SIDE)))
top = np.column_stack([x, y, 4 + 0.3 * np.sin(x / 4) * np.cos(y / 4) + np.random.default_rng(0).normal(0, 1e-4, x.size)])
one = np.arange(x.size).reshape(SIDE, SIDE)[:-1, :-1].ravel()
cells = np.concatenate([[one, one + 1, one + SIDE + 1], [one, one + SIDE + 1, one + SIDE]], axis=1).T
edges = np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]])
inner = set(map(tuple, edges[:, ::-1].tolist()))
rim = np.array([edge for edge in edges.tolist() if tuple(edge) not in inner])
walls = [np.column_stack([rim[:, 1], rim[:, 0], rim[:, 0] + x.size]), np.column_stack([rim[:, 1], rim + x.size])]
faces = np.concatenate([cells, cells[:, ::-1] + x.size, *walls]).astype(np.uint64)
whole = manifold3d.Manifold(manifold3d.Mesh64(np.concatenate([top, top * [1, 1, 0]]), faces))
fewer = whole.simplify(TOLERANCE_M)
mesh = fewer.to_mesh64()
triangles = np.asarray(mesh.vert_properties)[:, :3][np.asarray(mesh.tri_verts).astype(int)]
normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
upward = normals[:, 2] > 1e-12
off_m = np.full(x.size, np.inf)  # of each corner of the top, plumb
for corners, normal in zip(triangles[upward], normals[upward]):
    ahead = np.roll(corners, -1, axis=0) - corners
    side = [step[0] * (y - corner[1]) - step[1] * (x - corner[0]) for step, corner in zip(ahead, corners)]
    within = np.min(side, axis=0) > -1e-9
    height = corners[0, 2] - ((x - corners[0, 0]) * normal[0] + (y - corners[0, 1]) * normal[1]) / normal[2]
    off_m[within] = np.minimum(off_m, np.abs(height - top[:, 2]))[within]
slope = (np.hypot(normals[upward, 0], normals[upward, 1]) / normals[upward, 2]).max()
least_mm = off_m.max() / np.hypot(1, slope) * 1000  # no point of a surface so flat is nearer
print(f"version: manifold3d {version('manifold3d')}")
print(
    "behaviour: simplify takes a surface with waves and a roughness of 0.1 mm farther from its corners than its tolerance; a "
    "good guess says, as its description does, that all surfaces move by less than the tolerance"
)
print(
    f"seen: tolerance {TOLERANCE_M * 1000:g} mm, {whole.num_tri()} triangles become {fewer.num_tri()}, and a corner is at least "
    f"{least_mm:.2f} mm from the new surface"
)
sys.exit(not (whole.status() == manifold3d.Error.NoError and np.isfinite(least_mm) and least_mm > 1.2 * TOLERANCE_M * 1000))
PY
