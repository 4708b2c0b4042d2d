#!/bin/sh
set -eu
for program in cavern dump3d python3; do
  command -v "$program" > /dev/null || { echo "$program is not installed: apt-get install survex" >&2; exit 1; }
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
# A square of four legs whose last station is the first one. The equate that closes it is right, or names no station.
for last in 5 50 t.50; do
  printf '*fix 1 0 0 0\n1 2 10 0 0\n2 3 10 90 0\n3 4 10 180 0\n4 5 10 270 0\n*begin t\n1 2 1 0 0\n*end t\n' > "$last.svx"
  printf '*equate t.1 2\n*equate 1 %s\n' "$last" >> "$last.svx"
  cavern "$last.svx" > "$last.log" && echo 0 > "$last.rc" || echo $? > "$last.rc"
  dump3d "$last.3d" > "$last.txt"
done
python3 - "$(cavern --version)" <<'PY'
import re
import sys


def solved(name):
    """Return cavern's exit status, its warnings, its loops, and the flags of the station of the last equate."""
    log, nodes = open(f"{name}.log").read(), open(f"{name}.txt").read()
    loops = int(re.search(r"(\d+) loops?\.", log)[1])
    flags = re.search(rf"\[{re.escape(name)}\](.*)", nodes)[1].split()
    return int(open(f"{name}.rc").read()), log.count(": warning: "), loops, flags


found = {name: solved(name) for name in ("5", "50", "t.50")}
print(f"version: {sys.argv[1]} (the installed program)")
print(
    "behaviour: an equate to a station that no leg has is solved without a word if it is in the equate's own survey, so that a "
    "loop stays open; the .3d has the station without any flag; a good guess says that it warns of each such name, as it does "
    "where the survey is named"
)
print(f"seen: exit status, warnings, loops and flags of the station, by its name in the equate: {found}")
holds = found["5"] == (0, 0, 1, ["UNDERGROUND"]) and found["50"] == (0, 0, 0, []) and found["t.50"][:3] == (0, 1, 0)
sys.exit(not holds)
PY
