"""How hard the mines are: classical explorers, an upper bound on coverage, PPO, and the protocol that compares them."""

import sys
from importlib.util import find_spec

_missing = [
    name
    for name in ("gymnasium", "mujoco", "pydantic", "safetensors", "scipy", "shapely", "skimage", "tqdm")
    if find_spec(name) is None
]
if _missing:
    sys.stderr.write(
        f"minexplore: {', '.join(_missing)} not installed for {sys.executable}; "
        "run `make setup` and use .venv/bin/python (or `. .venv/bin/activate`)\n"
    )
    raise SystemExit(2)
