#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check ezdxf==1.4.5
venv/bin/python - <<'PY'
import sys

import ezdxf
from ezdxf.render import MeshBuilder

document = ezdxf.new()
mesh = document.modelspace().add_polymesh((4, 2))
for column, (x, y) in enumerate([(1, 0), (0, 1), (-1, 0), (0, -1)]):
    for row in range(2):
        mesh.set_mesh_vertex((column, row), (x, y, row))
mesh.close(m_close=True)  # the fourth wall of a square shaft: from the last column to the first
document.saveas("shaft.dxf")
mesh = ezdxf.readfile("shaft.dxf").modelspace()[0]
built = len(MeshBuilder.from_polyface(mesh).faces)
exploded = len(list(mesh.virtual_entities()))
print(f"version: ezdxf {ezdxf.__version__}")
print(
    "behaviour: MeshBuilder.from_polyface() leaves out the faces that close a polygon mesh, though "
    "virtual_entities() gives them; a good guess says that the built mesh is closed"
)
print(f"seen: a square shaft with closed direction M ({mesh.is_m_closed}): {built} walls built, {exploded} exploded")
sys.exit(not (mesh.is_m_closed and built == 3 and exploded == 4))
PY
