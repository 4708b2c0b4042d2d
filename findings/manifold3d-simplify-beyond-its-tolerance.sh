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

SIDES, RINGS, RADIUS_M, LONG_M, TOLERANCE_M = 200, 20, 2.0, 40.0, 0.002


def tube():
    """Return a round bar with rings of corners along it, and its ends closed."""
    turn, along = np.meshgrid(np.arange(SIDES) * 2 * np.pi / SIDES, np.linspace(0, LONG_M, RINGS))
    wall = np.stack([RADIUS_M * np.cos(turn), RADIUS_M * np.sin(turn), along], axis=-1).reshape(-1, 3)
    one = np.arange(SIDES * (RINGS - 1))
    next_one = one // SIDES * SIDES + (one + 1) % SIDES
    sides = [[one, next_one, next_one + SIDES], [one, next_one + SIDES, one + SIDES]]
    low, high = np.arange(SIDES), np.arange(SIDES) + SIDES * (RINGS - 1)
    ends = [[np.full(SIDES, len(wall)), np.roll(low, -1), low], [np.full(SIDES, len(wall) + 1), high, np.roll(high, -1)]]
    faces = np.concatenate([np.column_stack(part) for part in sides + ends])
    points = np.concatenate([wall, [[0, 0, 0], [0, 0, LONG_M]]])
    return manifold3d.Manifold(manifold3d.Mesh64(points, faces.astype(np.uint64)))


whole = tube()
fewer = whole.simplify(TOLERANCE_M)
mesh = fewer.to_mesh64()
corners = np.asarray(mesh.vert_properties)[np.asarray(mesh.tri_verts).astype(int)]
start, end = corners.reshape(-1, 3), np.roll(corners, -1, axis=1).reshape(-1, 3)
on_wall = start[:, 2] != end[:, 2]  # edges along the bar: the middle of one is how far inside
off_m = RADIUS_M * np.cos(np.pi / SIDES) - np.linalg.norm((start + end)[on_wall, :2] / 2, axis=1).min()
print(f"version: manifold3d {version('manifold3d')}")
print(
    "behaviour: simplify moves the wall of a round bar by ten times its tolerance; a good guess says, as its description "
    "does, that all surfaces move by less than the tolerance"
)
print(
    f"seen: tolerance {TOLERANCE_M * 1000:g} mm, {whole.num_tri()} triangles become {fewer.num_tri()}, and the wall is "
    f"{off_m * 1000:.1f} mm inside the bar's (valid: {whole.status() == manifold3d.Error.NoError})"
)
sys.exit(not (whole.status() == manifold3d.Error.NoError and off_m > 5 * TOLERANCE_M))
PY
