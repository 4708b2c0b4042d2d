#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check pyogrio==0.13.0 shapely==2.2.0 numpy==2.4.6
venv/bin/python - <<'PY'
import sqlite3
import sys
import warnings

import numpy as np
import pyogrio
import shapely

shape = np.array([shapely.to_wkb(shapely.box(0, 0, 10, 5))], object)
with warnings.catch_warnings(action="ignore"):  # that no system is stated
    pyogrio.raw.write("a.gpkg", shape, [], [], geometry_type="Polygon", crs=None, driver="GPKG", layer="a")
made = pyogrio.read_info("a.gpkg")["crs"]
with sqlite3.connect("a.gpkg") as file:
    for table in ("gpkg_contents", "gpkg_geometry_columns"):
        file.execute(f"UPDATE {table} SET srs_id = -1")
    stated = file.execute("SELECT definition FROM gpkg_spatial_ref_sys WHERE srs_id = -1").fetchone()[0]
file.close()
found = pyogrio.read_info("a.gpkg")["crs"]
print(f"version: GDAL {'.'.join(map(str, pyogrio.__gdal_version__))}, pyogrio {pyogrio.__version__}")
print(
    "behaviour: a layer of a GeoPackage in the undefined cartesian system, srs_id -1, is read with a system in metres; a good "
    "guess says that it has no system and no unit, as the standard has it and as a file that GDAL writes without one"
)
print(f"seen: the file's definition is {stated!r}; GDAL gives {found}; of its own file without a system {made}")
sys.exit(not (stated == "undefined" and made is None and 'UNIT["Meter",1' in str(found)))
PY
