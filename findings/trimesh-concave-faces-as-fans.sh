#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check trimesh==5.2.0 numpy==2.4.6 scipy==1.17.1
venv/bin/python - <<'PY'
import io
import sys

import trimesh

outline = [(0, 0), (10, 0), (10, 10), (8, 10), (8, 2), (2, 2), (2, 10), (0, 10)]  # a U, 3 m high
n = len(outline)
faces = [list(range(n))[::-1], list(range(n, 2 * n))] + [[i, (i + 1) % n, (i + 1) % n + n, i + n] for i in range(n)]
obj = "".join(f"v {x} {y} {z}\n" for z in (0, 3) for x, y in outline)
obj += "".join("f " + " ".join(str(i + 1) for i in face) + "\n" for face in faces)
mesh = trimesh.load_mesh(io.BytesIO(obj.encode()), file_type="obj")
print(f"version: trimesh {trimesh.__version__}")
print(
    "behaviour: a face with a bay becomes a fan of triangles that cover the bay twice, and the mesh is called watertight with "
    "the right volume; a good guess says that its triangles are inside the face"
)
print(f"seen: area {mesh.area:.1f} m2 of 272, volume {mesh.volume:.1f} m3 of 156, watertight {mesh.is_watertight}")
sys.exit(not (mesh.area > 400 and abs(mesh.volume - 156) < 1e-6 and mesh.is_watertight))
PY
