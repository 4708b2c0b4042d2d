#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check pycollada==0.9.3 trimesh==5.2.0 numpy==2.4.6
cat > a.dae <<XML
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2026-01-01T00:00:00</created><modified>2026-01-01T00:00:00</modified>
<unit name="inch" meter="0.0254"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="p">
<float_array id="a" count="9">0 0 0 100 0 0 0 0 50</float_array>
<technique_common><accessor source="#a" count="3" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>
XML
venv/bin/python - <<'PY'
import sys

import trimesh

scene = trimesh.load_scene("a.dae")
size = scene.extents.tolist()
other = trimesh.load_scene("a.dae").to_mesh().bounds[1].tolist()
print("version: trimesh 5.2.0 with pycollada 0.9.3")
print(
    "behaviour: a scene in inches keeps its numbers, and its unit is only the text '0.0254 * meters' in `units`; the "
    "axis that points up is dropped; a good guess says metres, as the loader of a format with a unit gives"
)
print(f"seen: 100 in along x and 50 in along z are loaded as {size} with units {scene.units!r}; corner {other}")
sys.exit(not (size == [100.0, 0.0, 50.0] and scene.units == "0.0254 * meters" and "up" not in str(scene.metadata)))
PY
