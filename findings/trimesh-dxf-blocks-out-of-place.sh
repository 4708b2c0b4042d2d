#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check trimesh==5.2.0 ezdxf==1.4.5 numpy==2.4.6 networkx==3.6.1 scipy==1.17.1
venv/bin/python - <<'PY'
import sys

import ezdxf
import trimesh

PLACE = (10.0, 10.0)
HOW = {
    "as it is": {},
    "twice as large": {"xscale": 2, "yscale": 2, "zscale": 2},
    "turned by 90 degrees": {"rotation": 90},
    "base point": {},
}


def ends(how):
    """Return the ends of a block's line where a reference puts it, by ezdxf and by trimesh, m."""
    drawing = ezdxf.new("R2010")
    block = drawing.blocks.new("B", base_point=(1, 0) if how == "base point" else (0, 0))
    block.add_line((0, 0), (1, 0))
    placed = drawing.modelspace().add_blockref("B", PLACE, dxfattribs=HOW[how])
    drawing.saveas("a.dxf")
    line = next(iter(placed.virtual_entities())).dxf
    found = trimesh.load("a.dxf")
    by_trimesh = found.vertices[found.entities[0].points].round(6).tolist()
    return [[round(end.x, 6), round(end.y, 6)] for end in (line.start, line.end)], by_trimesh


found = {how: ends(how) for how in HOW}
print(f"version: trimesh {trimesh.__version__}, ezdxf {ezdxf.__version__}")
print(
    "behaviour: trimesh scales the place of a block in a DXF drawing with the block, turns it clockwise and leaves out its "
    "base point; a good guess says that blocks are where ezdxf and CAD put them, or that they are left out"
)
print(f"seen: ends of a line from 0 to 1 in a block placed at {PLACE}, by ezdxf and by trimesh: {found}")
sys.exit(any((one == other) != (how == "as it is") for how, (one, other) in found.items()))
PY
