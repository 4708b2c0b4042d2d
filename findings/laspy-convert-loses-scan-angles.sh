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

DEGREES = 30


def cloud(point_format, version, name, value):
    """Return a cloud with one point at a scan angle."""
    made = laspy.LasData(laspy.LasHeader(point_format=point_format, version=version))
    made.x = made.y = made.z = np.zeros(1)
    made[name] = np.array([value])
    return made


new = laspy.convert(cloud(1, "1.2", "scan_angle_rank", DEGREES), point_format_id=6)
old = laspy.convert(cloud(6, "1.4", "scan_angle", round(DEGREES / 0.006)), point_format_id=1)
found = {"1 to 6": float(new.scan_angle[0]) * 0.006, "6 to 1": float(old.scan_angle_rank[0])}
print(f"version: laspy {laspy.__version__}")
print(
    "behaviour: convert() between point formats up to 5 and from 6 on leaves scan angles at 0, as the field has another name "
    "and unit there; a good guess says that it converts degrees to steps of 0.006 degrees and back"
)
print(f"seen: {DEGREES} degrees become, in degrees, by point formats: {found}")
sys.exit(any(found.values()))
PY
