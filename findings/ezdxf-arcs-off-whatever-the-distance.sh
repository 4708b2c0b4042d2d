#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check ezdxf==1.4.5 numpy==2.4.6
venv/bin/python - <<'PY'
import math
import sys

import ezdxf
from ezdxf.path import make_path

RADIUS_M, DISTANCE_M = 200.0, 0.001  # of a haulage curve of a quarter turn, and the largest distance asked for

space = ezdxf.new("R2010").modelspace()
arc = space.add_arc((0, 0), RADIUS_M, 0, 90)
bulge = space.add_lwpolyline([(RADIUS_M, 0, 0, 0, math.tan(math.pi / 8)), (0, RADIUS_M, 0, 0, 0)])


def off_m(points):
    """Return the largest distance of points of a chain and of the middles of its chords from the circle, m."""
    points = list(points)
    middles = [one.lerp(other) for one, other in zip(points, points[1:])]
    return round(max(abs(point.magnitude - RADIUS_M) for point in points + middles), 4)


found = {
    "path of an arc": off_m(make_path(arc).flattening(DISTANCE_M)),
    "path of a bulge": off_m(make_path(bulge).flattening(DISTANCE_M)),
    "arc itself": off_m(arc.flattening(DISTANCE_M)),
}
print(f"version: ezdxf {ezdxf.__version__}")
print(
    "behaviour: a path is one Bezier curve for a quarter turn, so flattening() of an arc's or a bulge's path is off by up to "
    "0.027 % of the radius whatever distance is asked for; a good guess says that the distance holds, as it does for the arc"
)
print(f"seen: radius {RADIUS_M} m, {DISTANCE_M} m asked for; off by, in m: {found}")
paths = found["path of an arc"], found["path of a bulge"]
sys.exit(not (all(2e-4 < off / RADIUS_M < 3e-4 for off in paths) and found["arc itself"] <= 1.01 * DISTANCE_M))
PY
