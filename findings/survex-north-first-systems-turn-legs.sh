#!/bin/sh
set -eu
for program in cavern dump3d python3; do
  command -v "$program" > /dev/null || { echo "$program is not installed: apt-get install survex" >&2; exit 1; }
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
for system in 32632 2193 31467; do
  case $system in 2193) place='1600000 5400000 100' ;; 31467) place='3500000 5400000 100' ;; *) place='500000 5400000 100' ;; esac
  cat > "$system.svx" <<SVX
*begin s
*cs out EPSG:$system
*cs EPSG:$system
*declination auto $place
*date 2020.01.01
*fix a $place
a b 10 0 0
*end s
SVX
  cavern --quiet "$system.svx" > /dev/null
  dump3d "$system.3d" > "$system.txt"
done
python3 - "$(cavern --version)" <<'PY'
import math
import sys


def bearing_deg(system):
    """Return the grid bearing of a leg with the magnetic bearing 0, deg."""
    rows = [line.split() for line in open(f"{system}.txt") if line.startswith(("MOVE", "LINE"))]
    (x, y), (far_x, far_y) = ((float(row[1]), float(row[2])) for row in rows)
    return round(math.degrees(math.atan2(far_x - x, far_y - y)), 1)


found = {f"EPSG:{system}": bearing_deg(system) for system in (32632, 2193, 31467)}
print(f"version: {sys.argv[1]} (the installed program)")
print(
    "behaviour: with `*declination auto` legs are turned by about a right angle in a coordinate system whose first axis is "
    "north, with the convergence stated as 95 degrees; a good guess says that the order of axes turns nothing, as for *fix"
)
print(f"seen: grid bearing in deg of a leg that has magnetic bearing 0, near the central meridian: {found}")
wrong = found["EPSG:2193"], found["EPSG:31467"]
sys.exit(not (abs(found["EPSG:32632"]) < 10 and all(60 < abs(bearing) < 120 for bearing in wrong)))
PY
