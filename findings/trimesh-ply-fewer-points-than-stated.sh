#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check trimesh==5.2.0 numpy==2.4.6
venv/bin/python - <<'PY'
import sys
from io import BytesIO

import numpy as np
import trimesh

ROWS = 5


def read(stated, kind):
    """Return how many points trimesh reads of a cloud of five whose header states another number, or the error's name."""
    header = f"ply\nformat {kind} 1.0\nelement vertex {stated}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    points = np.arange(3 * ROWS, dtype="<f4").reshape(-1, 3)
    data = points.tobytes() if kind != "ascii" else "".join(f"{x:g} {y:g} {z:g}\n" for x, y, z in points).encode()
    try:
        return len(trimesh.load(BytesIO(header.encode() + data), file_type="ply").vertices)
    except Exception as error:
        return type(error).__name__


found = {kind: {stated: read(stated, kind) for stated in (3, 8)} for kind in ("ascii", "binary_little_endian")}
print(f"version: trimesh {trimesh.__version__}")
print(
    "behaviour: trimesh reads a text PLY that ends before its stated number of points without an error, so half a cloud "
    "looks whole; a good guess says that it refuses it"
)
print(f"seen: points read of five, by the format and the number that the header states: {found}")
sys.exit(found["ascii"] != {3: 3, 8: ROWS})
PY
