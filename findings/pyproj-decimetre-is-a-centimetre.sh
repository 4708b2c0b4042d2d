#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check pyproj==3.7.2
venv/bin/python - <<'PY'
import sys

import pyproj
from pyproj.database import get_units_map

listed = get_units_map(category="linear")["decimeter"].conv_factor
plain = pyproj.Proj("+proj=utm +zone=19 +south")(-70, -33)[0]
converted = plain / pyproj.Proj("+proj=utm +zone=19 +south +units=dm")(-70, -33)[0]
print(f"version: pyproj {pyproj.__version__} with PROJ {pyproj.proj_version_str}")
print(
    "behaviour: get_units_map() states 0.01 m for the decimetre, though a projection with +units=dm uses 0.1 m; "
    "a good guess says 0.1 m in both"
)
print(f"seen: the table says {listed} m; coordinates of a projection in dm are in units of {converted:.6g} m")
sys.exit(not (listed == 0.01 and abs(converted - 0.1) < 1e-9))
PY
