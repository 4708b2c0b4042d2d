#!/bin/sh
set -eu
for program in cavern dump3d python3; do
  command -v "$program" > /dev/null || { echo "$program is not installed: apt-get install survex" >&2; exit 1; }
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
cat > a.svx <<'SVX'
*begin s
*fix a 0 0 100 1 1 1
*fix c 0 30 100 1 1 1
a b 10 0 0
b c 10 0 0
*end s
SVX
cavern --quiet a.svx > /dev/null
dump3d a.3d > a.txt
python3 - "$(cavern --version)" <<'PY'
import sys

rows = [line.split() for line in open("a.txt")]
stations = {tuple(map(float, row[1:4])): row[4] for row in rows if row[0] == "NODE"}
ends = [tuple(map(float, row[1:4])) for row in rows if row[0] in ("MOVE", "LINE")]
loose = [end for end in ends if end not in stations]
print(f"version: {sys.argv[1]} (the installed program)")
print(
    "behaviour: a leg at a point fixed with standard deviations ends in the .3d file at the stated place, where no "
    "station is; a good guess says that the legs of a .3d file join the adjusted stations"
)
print(f"seen: stations {stations}; ends of legs at no station: {loose}")
sys.exit(not (loose and set(loose) <= {(0.0, 0.0, 100.0), (0.0, 30.0, 100.0)} and len(stations) == 3))
PY
