#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
cat >write.py <<'PY'
import sys

import mujoco

PLACE_M = (1234.567890123, 12345.678901234, 1 / 3)


def off_m(as_compiled):
    """Return how far a body lies from its stated place once its model was written as text and read, m."""
    spec = mujoco.MjSpec()
    spec.compiler.savecompiled = as_compiled
    spec.worldbody.add_body(pos=PLACE_M).add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0])
    assert spec.compile().body_pos[1].tolist() == list(PLACE_M)
    read = mujoco.MjModel.from_xml_string(spec.to_xml())
    return round(float(abs(read.body_pos[1] - PLACE_M).max()), 4)


usual = bool(mujoco.MjSpec().compiler.savecompiled)
found = {as_compiled: off_m(as_compiled) for as_compiled in (True, False)}
print(f"version: MuJoCo {mujoco.__version__}")
print(
    "behaviour: MjSpec.to_xml() writes six significant digits unless compiler.savecompiled is off, so that a body 12 km "
    "from the origin moves by centimetres; a good guess says that the text gives the model that was compiled"
)
print(f"seen: largest distance in m by savecompiled, whose default is {usual}: {found}")
sys.exit((usual, found) != (True, {True: 0.0211, False: 0.0}))
PY
for version in 3.17.0 4.0.0; do
    python3 -m venv "$version"
    "$version/bin/pip" install --quiet --disable-pip-version-check "mujoco==$version" numpy==2.4.6
    "$version/bin/python" write.py
done
