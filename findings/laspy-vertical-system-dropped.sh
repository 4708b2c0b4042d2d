#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check laspy==2.7.0 pyproj==3.7.2 numpy==2.4.6
venv/bin/python - <<'PY'
import struct
import sys

import laspy
import pyproj
from laspy.vlrs.known import GeoKeyDirectoryVlr

keys = [(1024, 0, 1, 1), (3072, 0, 1, 25832), (4096, 0, 1, 6360), (4099, 0, 1, 9003)]  # heights in US survey feet
record = GeoKeyDirectoryVlr()
record.parse_record_data(b"".join(struct.pack("<4H", *key) for key in [(1, 1, 0, len(keys)), *keys]))
header = laspy.LasHeader(point_format=0, version="1.2")
header.vlrs.append(record)
found = header.parse_crs()
print(f"version: laspy {laspy.__version__}, pyproj {pyproj.__version__}")
print(
    "behaviour: the coordinate system that laspy makes of GeoTIFF keys leaves out their vertical system, so heights in feet "
    "look like metres; a good guess says a compound system"
)
print(f"seen: keys of EPSG:25832 and EPSG:6360 give {found.to_string()} with axes in {[a.unit_name for a in found.axis_info]}")
sys.exit(found.is_compound or len(found.axis_info) != 2)
PY
