#!/bin/sh
set -eu
for program in therion dump3d python3; do
  command -v "$program" > /dev/null || { echo "$program is not installed: apt-get install therion survex" >&2; exit 1; }
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
cat > a.th <<'TH'
survey s
centreline
 fix a 0 0 0
 units compass mils
 data normal from to length compass clino
 a b 10 100 0
endcentreline
endsurvey
TH
printf 'source a.th\nexport model -fmt survex -o a.3d\n' > thconfig
therion thconfig > log.txt 2>&1
dump3d a.3d > a.txt
python3 - "$(therion --version | head -1)" <<'PY'
import math
import sys

leg = next(line.split() for line in open("a.txt") if line.startswith("LINE"))
bearing = math.degrees(math.atan2(float(leg[1]), float(leg[2])))
print(f"version: {sys.argv[1]} (the installed program)")
print(
    "behaviour: the angle unit `mils` is the grad, 400 to a circle; a good guess says 6400 to a circle, as on "
    "compasses with mils"
)
print(f"seen: a leg with a bearing of 100 mils points to {bearing:.3f} degrees; 6400 to a circle would be 5.625")
sys.exit(abs(bearing - 90) > 0.1)
PY
