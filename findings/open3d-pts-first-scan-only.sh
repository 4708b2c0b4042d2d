#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check open3d==0.20.0 numpy==2.4.6
venv/bin/python - <<'PY' 2>/dev/null
import sys
from pathlib import Path

import open3d

SCANS = (3, 2)
text = "".join(f"{size}\n" + "".join(f"{scan} {row} 0 100\n" for row in range(size)) for scan, size in enumerate(SCANS))
Path("two.pts").write_text(text)
found = {
    "open3d.io": len(open3d.io.read_point_cloud("two.pts").points),
    "open3d.t.io": len(open3d.t.io.read_point_cloud("two.pts").point.positions),
}
print(f"version: Open3D {open3d.__version__}")
print(
    "behaviour: Open3D reads the first scan of a PTS file of several, each below its own number of points, and states "
    "nothing about the others; a good guess says that all are read, or the file refused"
)
print(f"seen: points of a file with scans of {SCANS} points: {found}")
sys.exit(set(found.values()) != {SCANS[0]})
PY
