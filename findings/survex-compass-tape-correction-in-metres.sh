#!/bin/sh
set -eu
for program in cavern dump3d python3; do
  command -v "$program" > /dev/null || { echo "$program is not installed: apt-get install survex" >&2; exit 1; }
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
for feet in 0.00 2.00; do
  printf '%s\r\n' 'CAVE' 'SURVEY NAME: A' 'SURVEY DATE: 1 1 2020  COMMENT:x' 'SURVEY TEAM:' 'x' \
    "DECLINATION:    0.00  FORMAT: DMMDLRUDLADNF  CORRECTIONS:  0.00 0.00 $feet" '' \
    'FROM TO LENGTH BEARING INC LEFT UP DOWN RIGHT FLAGS COMMENTS' '' ' A1 A2 100.00 0.00 0.00 0 0 0 0' > "$feet.dat"
  printf '\f\r\n' >> "$feet.dat"
  cavern --quiet "$feet.dat" > /dev/null
  dump3d "$feet.3d" > "$feet.txt"
done
python3 - "$(cavern --version)" <<'PY'
import sys


def long_m(feet):
    return next(float(line.split()[2]) for line in open(f"{feet}.txt") if line.startswith("LINE"))


plain, corrected = long_m("0.00"), long_m("2.00")
print(f"version: {sys.argv[1]} (the installed program)")
print(
    "behaviour: the tape correction of a Compass file, which is in feet like all its lengths, is added as metres; a good guess "
    "says that a shot of 100 ft with a correction of 2 ft has 102 ft, 31.09 m"
)
print(f"seen: 100 ft without a correction are {plain} m, with one of 2 ft {corrected} m")
sys.exit(not (plain == 30.48 and corrected == 32.48))
PY
