#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check pyogrio==0.13.0 shapely==2.2.0 numpy==2.4.6
venv/bin/python - <<'PY'
import sys
import zipfile

import numpy as np
import pyogrio
import shapely

shape = np.array([shapely.to_wkb(shapely.box(-70.1, -33.1, -70.0, -33.0))], object)
pyogrio.raw.write(
    "a.kmz", shape, [], [], geometry_type="Polygon", crs="EPSG:4326", driver="LIBKML", layer="drifts"
)
with zipfile.ZipFile("a.kmz") as archive:
    names = archive.namelist()
    main = archive.read("doc.kml").decode()
print(f"version: GDAL {'.'.join(map(str, pyogrio.__gdal_version__))}, pyogrio {pyogrio.__version__}")
print(
    "behaviour: doc.kml holds only a NetworkLink to a second KML file in the archive, which holds the shapes; a good "
    "guess says that they are in doc.kml, the one file that KMZ readers have to open"
)
print(f"seen: files {names}; doc.kml has {main.count('<Placemark')} placemarks and {main.count('<NetworkLink')} links")
sys.exit(not (len(names) > 1 and "<Placemark" not in main and "<NetworkLink" in main))
PY
