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

SIDE_M, ASIDE_M = 10.0, 1.0
ring = shapely.LinearRing([(0, 0), (SIDE_M, 0), (SIDE_M, SIDE_M), (0, SIDE_M)])
found = {
    way: shapely.offset_curve(ring, distance, join_style="mitre")
    for way, distance in (("inwards", ASIDE_M), ("outwards", -ASIDE_M))
}
wanted = {"inwards": 4 * (SIDE_M - 2 * ASIDE_M), "outwards": 4 * (SIDE_M + 2 * ASIDE_M)}
seen = {way: (line.is_closed, line.length, wanted[way]) for way, line in found.items()}
print(f"version: shapely {shapely.__version__}, GEOS {shapely.geos_version_string}")
print(
    "behaviour: offset_curve of a ring is a closed line inwards and an open one outwards, without the corner where the ring "
    "begins; a good guess says that a ring gives a ring on both sides"
)
print(f"seen: closed, length and a ring's length in m: {seen}; outwards {found['outwards'].wkt}")
sys.exit(not (seen["inwards"][0] and not seen["outwards"][0] and seen["outwards"][1] < wanted["outwards"] - 1))
PY
