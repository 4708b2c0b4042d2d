#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check laspy==2.7.0 numpy==2.4.6
venv/bin/python - <<'PY'
import sys

import laspy
import numpy as np

X_M = 101.5


def cloud(x_m, scale_m, offset_m):
    """Return a cloud with points on a diagonal."""
    header = laspy.LasHeader(point_format=0, version="1.2")
    header.scales, header.offsets = [scale_m] * 3, [offset_m] * 3
    made = laspy.LasData(header)
    made.x = made.y = made.z = np.array(x_m)
    return made


first, second = cloud([1.0, 2.0], 0.01, 0.0), cloud([X_M], 0.001, 100.0)
first.write("a.las")
with laspy.open("a.las", mode="a") as file:
    file.append_points(second.points)
with laspy.open("w.las", mode="w", header=first.header) as file:
    file.write_points(second.points)
appended, written = (float(laspy.read(name).x[-1]) for name in ("a.las", "w.las"))
print(f"version: laspy {laspy.__version__}")
print(
    "behaviour: append_points takes the integers of points with another scale and offset as they are, so the points move, "
    "while write_points converts them; a good guess says that both convert, or refuse"
)
print(f"seen: a point at {X_M} m is at {appended} m once appended, and at {written} m once written")
sys.exit(not (abs(appended - 15.0) < 1e-9 and abs(written - X_M) < 1e-9))
PY
