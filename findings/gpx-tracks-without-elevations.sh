#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check pyogrio==0.13.0 shapely==2.2.0 numpy==2.4.6
cat > a.gpx <<'XML'
<?xml version="1.0"?><gpx version="1.1" creator="t" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>
<trkpt lat="-33.1" lon="-70.1"><ele>2400</ele></trkpt><trkpt lat="-33.099" lon="-70.1"/>
</trkseg></trk></gpx>
XML
venv/bin/python - <<'PY'
import sys

import pyogrio
import shapely


def heights(**options):
    line = shapely.from_wkb(pyogrio.raw.read("a.gpx", layer="tracks", **options)[2][0])
    return line.has_z, [str(value) for value in shapely.get_coordinates(line, include_z=True)[:, 2]]


plain, asked = heights(), heights(ELE_AS_25D="YES")
print(f"version: GDAL {'.'.join(map(str, pyogrio.__gdal_version__))}, pyogrio {pyogrio.__version__}")
print(
    "behaviour: a track is read without its elevations; with ELE_AS_25D=YES a point that states none is at 0 m; a good "
    "guess says that elevations are there, and that a missing one is NaN"
)
print(f"seen: elevations 2400 and none: by default {plain[1]}, with the option {asked[1]}")
sys.exit(not (plain[0] is False and asked == (True, ["2400.0", "0.0"])))
PY
