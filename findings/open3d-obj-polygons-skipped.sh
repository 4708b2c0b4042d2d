#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check open3d==0.20.0 numpy==2.4.6
cat > a.obj <<'OBJ'
v 0 0 0
v 4 0 0
v 4 4 0
v 0 4 0
v 0 0 3
f 1 2 3 4
f 1 2 5
OBJ
printf 'OFF\n5 2 0\n0 0 0\n4 0 0\n4 4 0\n0 4 0\n0 0 3\n4 0 1 2 3\n3 0 1 4\n' > a.off
venv/bin/python - <<'PY'
import sys

import open3d

area = {name: open3d.io.read_triangle_mesh(name).get_surface_area() for name in ("a.obj", "a.off")}
tensor = len(open3d.t.io.read_triangle_mesh("a.obj").triangle.indices)
print(f"version: Open3D {open3d.__version__}")
print(
    "behaviour: read_triangle_mesh() leaves out each face of an OBJ file that has more than three corners, but divides "
    "the same face of an OFF file into triangles, as t.io.read_triangle_mesh() does for OBJ; a good guess says that "
    "quads are divided in both"
)
print(f"seen: a quad of 16 m2 and a triangle of 6 m2 have the areas {area}; t.io reads {tensor} triangles from the OBJ")
sys.exit(not (area == {"a.obj": 6.0, "a.off": 22.0} and tensor == 3))
PY
