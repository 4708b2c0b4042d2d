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


def metres(code):
    transformer = pyproj.Transformer.from_crs("EPSG:4326", code, always_xy=True)
    return [round(value) for value in transformer.transform(14.4, 50.08)]


krovak, east_north = metres("EPSG:5513"), metres("EPSG:5514")
print(f"version: pyproj {pyproj.__version__} with PROJ {pyproj.proj_version_str}")
print(
    "behaviour: always_xy=True leaves a system whose axes point south and west (EPSG:5513, Krovak) in its own order, "
    "southing first; a good guess says that the east-west axis comes first, as the option does for systems with "
    "north and east"
)
print(f"seen: one point of Prague is {krovak} in EPSG:5513 and {east_north} in EPSG:5514, where east comes first")
sys.exit(not (krovak == [-east_north[1], -east_north[0]] and krovak[0] > krovak[1] > 0))
PY
