#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check shapely==2.2.0 numpy==2.4.6
venv/bin/python - <<'PY'
import sys

import shapely

room = shapely.set_precision(shapely.box(0, 0, 10, 10), 0.1)  # m; its corners are on the grid already
drift = shapely.box(2.04, 3.04, 5.04, 6.04)
one, other = shapely.intersection(room, drift), shapely.intersection(drift, room)
left, none = shapely.difference(room, drift), shapely.difference(drift, room)
print(f"version: shapely {shapely.__version__}, GEOS {shapely.geos_version_string}")
print(
    "behaviour: the intersection of a shape that has a grid with one that has none is rounded to that grid, and in the other "
    "order it is not; a good guess says that an intersection is the same in both orders, with the finer of both precisions"
)
print(f"seen: with the grid first {one.bounds}, last {other.bounds}; the rest of the room has {left.area:.4f} m2")
rounded = all(abs(value - stated) < 1e-9 for value, stated in zip(one.bounds, (2.0, 3.0, 5.0, 6.0)))
sys.exit(not (rounded and other.bounds == drift.bounds and none.is_empty))
PY
