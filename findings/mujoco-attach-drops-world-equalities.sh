#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check mujoco==3.17.0 numpy==2.4.6
venv/bin/python - <<'PY'
import sys

import mujoco

BODIES = "".join(
    f'<body name="{name}" pos="{x} 0 1"><freejoint/><geom size=".1"/></body>' for x, name in enumerate("ab")
)
EQUALITIES = {
    "weld, world by omission": '<weld body1="a"/>',
    "connect, world by omission": '<connect body1="a" anchor="0 0 0"/>',
    "weld, world by name": '<weld body1="a" body2="world"/>',
    "connect, world by name": '<connect body1="a" body2="world" anchor="0 0 0"/>',
    "two bodies": '<weld body1="a" body2="b"/>',
}


def attached(equality):
    """Return how many equalities a robot has alone, and once it is attached to a site of another model."""
    robot = f"<mujoco><worldbody>{BODIES}</worldbody><equality>{equality}</equality></mujoco>"
    alone = mujoco.MjModel.from_xml_string(robot).neq
    scene = mujoco.MjSpec()
    site = scene.worldbody.add_site(name="here")
    scene.attach(mujoco.MjSpec.from_string(robot), site=site, prefix="robot-")
    return alone, scene.compile().neq


found = {name: attached(equality) for name, equality in EQUALITIES.items()}
print(f"version: MuJoCo {mujoco.__version__}")
print(
    "behaviour: MjSpec.attach() leaves out a connect or weld that names the world as its second body, without an error, "
    "and keeps one that omits this body, which means the same; a good guess says that both are kept, or refused"
)
print(f"seen: equalities alone and once attached: {found}")
sys.exit(any(found[name] != (1, 0 if name.endswith("by name") else 1) for name in found))
PY
