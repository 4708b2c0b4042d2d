#!/bin/sh
set -eu
for program in cavern dump3d python3; do
  command -v "$program" > /dev/null || { echo "$program is not installed: apt-get install survex" >&2; exit 1; }
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
number=0
for leg in '-10 0 0' '10 0 100' '10 364 0'; do
  number=$((number + 1))
  printf '*begin s\n*fix a 0 0 0\na b %s\n*end s\n' "$leg" > "$number.svx"
  cavern "$number.svx" > "$number.log" && echo 0 > "$number.rc" || echo $? > "$number.rc"
  dump3d "$number.3d" > "$number.txt"
done
python3 - "$(cavern --version)" <<'PY'
import sys


def solved(number):
    """Return cavern's exit status, the number of its warnings, and the place of the leg's far end, m."""
    warnings = sum(": warning: " in line for line in open(f"{number}.log"))
    end = next(line.split()[1:4] for line in open(f"{number}.txt") if line.startswith("LINE"))
    return int(open(f"{number}.rc").read()), warnings, tuple(map(float, end))


found = {name: solved(k) for k, name in enumerate(("tape -10", "clino 100", "compass 364"), 1)}
print(f"version: {sys.argv[1]} (the installed program)")
print(
    "behaviour: readings that no instrument shows are solved with a warning and exit status 0, and a leg then points the other "
    "way; a good guess says that a negative length or a clino reading over 90 degrees is an error"
)
print(f"seen: exit status, warnings and where a leg of 10 m to the north ends: {found}")
holds = all(status == 0 and warnings > 0 for status, warnings, _ in found.values())
sys.exit(not (holds and found["tape -10"][2] == (0.0, -10.0, 0.0) and found["clino 100"][2] == (0.0, -1.74, 9.85)))
PY
