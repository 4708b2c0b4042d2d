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

import trimesh

GREYS = (0, 255, 256, 40_000, 65_535)
text = f"ply\nformat ascii 1.0\nelement vertex {len(GREYS)}\n"
text += "".join(f"property float {axis}\n" for axis in "xyz")
text += "".join(f"property ushort {colour}\n" for colour in ("red", "green", "blue"))
text += "end_header\n" + "".join(f"{row} 0 0 {grey} {grey} {grey}\n" for row, grey in enumerate(GREYS))
cloud = trimesh.load(BytesIO(text.encode()), file_type="ply")
found = dict(zip(GREYS, cloud.colors[:, 0].tolist(), strict=True))
print(f"version: trimesh {trimesh.__version__}")
print(
    "behaviour: trimesh keeps the low eight bits of a PLY file's 16-bit colours, so that black and a bright grey are one "
    "colour; a good guess says that they are divided by 257, as are those of LAS"
)
print(f"seen: red of the file and red as read: {found}")
sys.exit(found != {grey: grey % 256 for grey in GREYS})
PY
