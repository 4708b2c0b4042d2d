#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check trimesh==5.2.0 numpy==2.4.6
venv/bin/python - <<'PY'
import base64
import io
import json
import sys

import numpy as np
import trimesh

corners = np.array([[0, 0, 0, 0], [32767, 0, 0, 0], [0, 32767, 0, 0], [0, 0, 32767, 0]], np.int16)
faces = np.array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], np.uint16)
uri = "data:application/octet-stream;base64," + base64.b64encode(corners.tobytes() + faces.tobytes()).decode()
views = [{"buffer": 0, "byteOffset": 0, "byteLength": 32, "byteStride": 8, "target": 34962}]
views += [{"buffer": 0, "byteOffset": 32, "byteLength": 24, "target": 34963}]
shares = {"bufferView": 0, "componentType": 5122, "normalized": True, "count": 4, "type": "VEC3"}
file = {
    "asset": {"version": "2.0"},
    "extensionsUsed": ["KHR_mesh_quantization"],
    "extensionsRequired": ["KHR_mesh_quantization"],
    "scene": 0,
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0, "scale": [50, 50, 50]}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "buffers": [{"byteLength": 56, "uri": uri}],
    "bufferViews": views,
    "accessors": [shares | {"min": [0, 0, 0], "max": [32767, 32767, 32767]},
                  {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}],
}
side = trimesh.load_scene(io.BytesIO(json.dumps(file).encode()), file_type="gltf").extents[0]
print(f"version: trimesh {trimesh.__version__}")
print(
    "behaviour: corners of KHR_mesh_quantization that are shares of 32767 are read as whole metres although the file requires "
    "that extension; a good guess says 50 m, or that the file is refused"
)
print(f"seen: a side of 50 m is {side:.0f} m long")
sys.exit(not side > 1e6)
PY
