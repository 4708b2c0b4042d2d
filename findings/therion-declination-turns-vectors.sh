#!/bin/sh
set -eu
for program in therion cavern dump3d python3; do
  command -v "$program" > /dev/null || { echo "$program is not installed: apt-get install therion survex" >&2; exit 1; }
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
cat > a.th <<'TH'
survey s
centreline
 fix a 0 0 0
 declination 10 degrees
 data cartesian from to easting northing altitude
 a b 0 10 0
 data normal from to length compass clino
 a c 10 0 0
endcentreline
endsurvey
TH
printf 'source a.th\nexport model -fmt survex -o therion.3d\n' > thconfig
therion thconfig > log.txt 2>&1
cat > survex.svx <<'SVX'
*begin s
*fix a 0 0 0
*declination 10 degrees
*data cartesian from to easting northing altitude
a b 0 10 0
*data normal from to tape compass clino
a c 10 0 0
*end s
SVX
cavern --quiet survex.svx > /dev/null
for name in therion survex; do dump3d "$name.3d" > "$name.txt"; done
python3 - "$(therion --version | head -1)" "$(cavern --version)" <<'PY'
import sys


def stations(name):
    """Return east and north of stations, m."""
    rows = [line.split() for line in open(f"{name}.txt") if line.startswith("NODE")]
    return {row[4][-2]: (float(row[1]), float(row[2])) for row in rows}


found = {name: stations(name) for name in ("therion", "survex")}
print(f"version: {sys.argv[1]}, {sys.argv[2]} (the installed programs)")
print(
    "behaviour: Therion turns the vectors of `data cartesian` by the declination like bearings; a good guess says, as the manual "
    "of Survex, from which the style is, that vectors are relative to true north"
)
print(f"seen: b by a vector of 10 m north, c by a bearing of 0, declination 10 degrees: {found}")
turned, plain = (1.74, 9.85), (0.0, 10.0)
sys.exit(not (found["therion"]["b"] == turned and found["survex"]["b"] == plain and found["survex"]["c"] == turned))
PY
