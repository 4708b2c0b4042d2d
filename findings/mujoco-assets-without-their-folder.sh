#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check mujoco==3.17.0
venv/bin/python - <<'PY'
import sys
import tempfile
from pathlib import Path

import mujoco

tetrahedron = "v 0 0 0\nv {0} 0 0\nv 0 {0} 0\nv 0 0 {0}\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
files = {"near/rock.obj": tetrahedron.format(1).encode(), "far/rock.obj": tetrahedron.format(5).encode()}
xml = """<mujoco><asset><mesh name="a" file="near/rock.obj"/><mesh name="b" file="far/rock.obj"/></asset>
<worldbody><geom type="mesh" mesh="a"/><geom type="mesh" mesh="b"/></worldbody></mujoco>"""
with tempfile.TemporaryDirectory() as folder:
    for name, data in files.items():
        (Path(folder) / name).parent.mkdir()
        (Path(folder) / name).write_bytes(data)
    (Path(folder) / "m.xml").write_text(xml)
    by_path = mujoco.MjModel.from_xml_path(f"{folder}/m.xml").nmesh
try:
    mujoco.MjModel.from_xml_string(xml, assets=files)
    error = ""
except ValueError as raised:
    error = str(raised)
print(f"version: mujoco {mujoco.__version__}")
print(
    "behaviour: files given in `assets` are told apart by their last name alone, so a model that loads from its folder is "
    "refused; a good guess says that they have the names by which the model calls them"
)
print(f"seen: {by_path} meshes from the folder; from `assets`: {error!r}")
sys.exit(not (by_path == 2 and "Repeated file name" in error))
PY
