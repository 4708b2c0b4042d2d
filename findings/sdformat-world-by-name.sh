#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
package=$(pkg-config --list-package-names | grep -E '^sdformat[0-9]+$' | sort -V | tail -n 1)
cat >load.cc <<'CC'
#include <iostream>
#include <sdf/sdf.hh>

int main(int, char **names) {
  sdf::Root root;
  const auto errors = root.Load(names[1]);
  std::cout << errors.size() << " errors, " << root.WorldCount() << " worlds";
}
CC
# shellcheck disable=SC2046
g++ -std=c++17 load.cc $(pkg-config --cflags --libs "$package") -o load
echo '<sdf version="1.9"><world name="w"><model name="m"><link name="l"/></model></world></sdf>' >world.sdf
cp world.sdf mine.sdf
by_name=$(./load world.sdf 2>/dev/null)
by_path=$(./load "$work/world.sdf" 2>/dev/null)
other=$(./load mine.sdf 2>/dev/null)
echo "version: libsdformat $(pkg-config --modversion "$package")"
echo "behaviour: sdf::Root::Load(\"world.sdf\") reads no world from a valid file of that name in the working folder, as" \
    "the library looks first among its own descriptions of elements, one of which is world.sdf; a good guess says that a" \
    "name without a folder is a file of the working folder"
echo "seen: world.sdf by its name: $by_name; by its whole path: $by_path; the same file as mine.sdf: $other"
[ "$by_name" = "1 errors, 0 worlds" ] && [ "$by_path" = "0 errors, 1 worlds" ] && [ "$other" = "$by_path" ]
