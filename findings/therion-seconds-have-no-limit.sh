#!/bin/sh
set -eu
for program in therion dump3d python3; do
  command -v "$program" > /dev/null || { echo "$program is not installed: apt-get install therion survex" >&2; exit 1; }
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
for degrees in 43:16:30 43:51:36 43:16:2136; do
  cat > a.th <<TH
survey s
centreline
 cs lat-long
 fix a 43:37:24.99 $degrees 1168
 data normal from to length compass clino
 a b 10 90 0
endcentreline
endsurvey
TH
  printf 'source a.th\ncs UTM38\nexport model -fmt survex -o a.3d\n' > thconfig
  therion thconfig > log.txt 2>&1 || { cat log.txt; exit 1; }
  echo "$degrees $(dump3d a.3d | grep "^NODE" | grep "a\]" | head -1)" >> seen.txt
done
python3 - "$(therion --version | head -1)" <<'PY'
import sys

east = {line.split()[0]: float(line.split()[2]) for line in open("seen.txt")}
print(f"version: {sys.argv[1]} (the installed program)")
print(
    "behaviour: `43:16:2136`, a typing error for 43:16:21.36, is read as 43 degrees, 16 minutes and 2136 seconds, half a "
    "degree further east, without a word; a good guess says that it is refused, as seconds end at 60"
)
print(f"seen: eastings of the station in UTM 38 by its longitude, m: {east}")
sys.exit(abs(east["43:16:2136"] - east["43:51:36"]) > 1 or abs(east["43:16:2136"] - east["43:16:30"]) < 1000)
PY
