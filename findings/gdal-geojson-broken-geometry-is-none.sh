#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check pyogrio==0.13.0 shapely==2.2.0 numpy==2.4.6
venv/bin/python - <<'PY'
import json
import sys
import warnings

import pyogrio
import shapely

WHOLE = {"type": "Polygon", "coordinates": [[[0, 0], [10, 0], [10, 5], [0, 0]]]}
BROKEN = {
    "a text for a number": {"type": "Polygon", "coordinates": [[[0, 0], ["x", 0], [10, 5], [0, 5], [0, 0]]]},
    "null for a number": {"type": "LineString", "coordinates": [[0, 0], [None, 1], [2, 2]]},
    "no coordinates": {"type": "Polygon"},
}


def read(geometry):
    """Return the kinds of shapes in a file of a whole polygon and another shape, and the number of warnings."""
    features = [{"type": "Feature", "properties": {}, "geometry": shape} for shape in (WHOLE, geometry)]
    with open("a.geojson", "w") as file:
        json.dump({"type": "FeatureCollection", "features": features}, file)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        shapes = pyogrio.raw.read("a.geojson")[2]
    return [shape and shapely.from_wkb(shape).geom_type for shape in shapes], len(caught)


found = {name: read(geometry) for name, geometry in BROKEN.items()}
print(f"version: GDAL {'.'.join(map(str, pyogrio.__gdal_version__))}, pyogrio {pyogrio.__version__}")
print(
    "behaviour: a feature of GeoJSON whose coordinates are broken is read as one without a geometry, which the format allows, "
    "without an error or a warning; a good guess says that such a file is refused"
)
print(f"seen: shapes and number of warnings of a polygon and of a shape with {found}")
sys.exit(not all(result == (["Polygon", None], 0) for result in found.values()))
PY
