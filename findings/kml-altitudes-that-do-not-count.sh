#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check pyogrio==0.13.0 numpy==2.4.6 shapely==2.2.0
venv/bin/python - <<'PY'
import sys

import pyogrio
import shapely

text = """<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><LineString>
<altitudeMode>clampToGround</altitudeMode><coordinates>7,50,400 7.001,50,410</coordinates>
</LineString></Placemark></Document></kml>"""
with open("a.kml", "w") as file:
    file.write(text)
line = shapely.from_wkb(pyogrio.raw.read("a.kml")[2][0])
print(f"version: pyogrio {pyogrio.__version__}, GDAL {'.'.join(map(str, pyogrio.__gdal_version__))}")
print(
    "behaviour: a KML shape whose altitudeMode is clampToGround, as it is by default, has its heights as third coordinates "
    "although the format says to ignore them; a good guess says that such a shape has none"
)
print(f"seen: clampToGround gives {line.wkt}")
sys.exit(not line.has_z)
PY
