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

CORNERS_M = np.array([[x, y, z] for x in (0, 4) for y in (0, 0.5) for z in (0, 0.5)])
PLACES_M = {"the origin": [0, 0, 0], "300 m": [300, 300, 0], "map coordinates": [351234, 6301118, 400]}


def hull(place_m):
    """Return the corners and the volume, m3, of the hull of a box of 1 m3 at a place."""
    solid = manifold3d.Manifold.hull_points(CORNERS_M + place_m)
    return solid.num_vert(), round(solid.volume(), 4)


found = {name: hull(place) for name, place in PLACES_M.items()}
print(f"version: manifold3d {version('manifold3d')}")
print(
    "behaviour: hull_points takes corners for one plane by a share of their distance from the origin, so at map coordinates "
    "a box loses four of eight corners; a good guess says that coordinates of 64 bits keep each corner within 1 nm"
)
print(f"seen: corners and m3 of the hull of a box of 4 x 0.5 x 0.5 m, 1 m3: {found}")
sys.exit(not (found["the origin"] == (8, 1.0) and found["map coordinates"][0] == 4 and found["map coordinates"][1] < 0.5))
PY
