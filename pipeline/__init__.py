"""From a mine survey to a validated MuJoCo world: the library behind the six stages."""

import os
import sys
from importlib.util import find_spec

__version__ = "0.1.0"

# MuJoCo chooses its OpenGL backend at the first import; the pipeline always renders off screen.
os.environ.setdefault("MUJOCO_GL", "osmesa")
# Matrices are small here: several threads of BLAS gain nothing, and where other programs run they wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

_missing = [name for name in ("cv2", "hydra", "mujoco", "open3d", "pydantic", "shapely") if find_spec(name) is None]
if _missing:
    sys.stderr.write(
        f"minexplore: {', '.join(_missing)} not installed for {sys.executable}; "
        "run `make setup` and use .venv/bin/python (or `. .venv/bin/activate`)\n"
    )
    raise SystemExit(2)
