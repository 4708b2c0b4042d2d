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
<unit name="metre" meter="1"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="p">
<float_array id="a" count="9">351234.30 6301118.30 400 351238.30 6301118.30 400 351234.30 6301122.10 400</float_array>
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

import collada
import trimesh

north = collada.Collada("a.dae").geometries[0].primitives[0].vertex[:, 1]
seen = [float(value) for value in north]
by_trimesh = trimesh.load_scene("a.dae").bounds[:, 1].tolist()
print("version: pycollada 0.9.3, trimesh 5.2.0")
print(
    "behaviour: coordinates are read as 32 bit numbers, so a side of 3.8 m at a northing of 6,301,118 m is 3.5 m long; "
    "a good guess says that the file's decimals are kept"
)
print(f"seen: northings 6301118.30 and 6301122.10 are read as {seen[0]} and {seen[2]}; by trimesh {by_trimesh}")
sys.exit(not (abs(seen[0] - 6301118.30) > 0.1 or abs(seen[2] - 6301122.10) > 0.05))
PY
