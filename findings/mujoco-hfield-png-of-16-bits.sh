#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check mujoco==3.17.0 numpy==2.4.6 pillow==11.3.0
venv/bin/python - <<'PY'
import io
import sys

import mujoco
import numpy as np
from PIL import Image

heights = (np.arange(64 * 64).reshape(64, 64) * 16).astype(np.uint16)
png = io.BytesIO()
Image.fromarray(heights).save(png, "PNG")
xml = """<mujoco><asset><hfield name="h" file="h.png" size="10 10 65.535 1"/></asset>
<worldbody><geom type="hfield" hfield="h"/></worldbody></mujoco>"""
model = mujoco.MjModel.from_xml_string(xml, assets={"h.png": png.getvalue()})
levels = len(np.unique(model.hfield_data))
print(f"version: mujoco {mujoco.__version__}")
print(
    "behaviour: a height field of a PNG with 16 bits a pixel keeps 8 of them, steps of 0.26 m over 65 m, without a word; "
    "a good guess says that a file of millimetres gives millimetres"
)
print(f"seen: {len(np.unique(heights))} different heights in the file, {levels} in the model")
sys.exit(levels != 256)
PY
