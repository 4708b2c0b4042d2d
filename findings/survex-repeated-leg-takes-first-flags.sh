#!/bin/sh
set -eu
for program in cavern dump3d python3; do
  command -v "$program" > /dev/null || { echo "$program is not installed: apt-get install survex" >&2; exit 1; }
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
for second in 'a b 10.1 0 0' 'b a 10.1 180 0'; do
  name=$(echo "$second" | cut -c1)
  cat > "$name.svx" <<SVX
*begin s
*fix a 0 0 0
*flags duplicate
a b 10 0 0
*flags not duplicate
$second
*end s
SVX
  cavern --quiet "$name.svx" > /dev/null
  dump3d "$name.3d" > "$name.txt"
done
python3 - "$(cavern --version)" <<'PY'
import sys


def legs(name):
    return [" ".join(line.split()[5:]) for line in open(name) if line.startswith("LINE")]


same, other = legs("a.txt"), legs("b.txt")
print(f"version: {sys.argv[1]} (the installed program)")
print(
    "behaviour: two readings of a leg in a row become one leg with the flags of the first, but two legs if the second "
    "reading is from the other end; a good guess says that each reading keeps its own flags, or that both cases are "
    "alike"
)
print(f"seen: first reading duplicate, second not: legs from the same end {same}; from the other end {other}")
sys.exit(not (same == ["STYLE=NORMAL DUPLICATE"] and other == ["STYLE=NORMAL DUPLICATE", "STYLE=NORMAL"]))
PY
