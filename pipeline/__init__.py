"""From a mine survey to a validated MuJoCo world: the library behind the six stages."""

import ctypes
import gc
import os
import signal
import sys
from importlib.util import find_spec
from itertools import pairwise

# Until `run_command` handles it, Ctrl-C ends a command at once, without the traceback of half an import.
_commands = [word.partition(".")[0] for option, word in pairwise(sys.orig_argv) if option == "-m"]
if _commands[:1] in (["pipeline"], ["stages"]) and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)

# MuJoCo chooses its OpenGL backend at the first import; the pipeline always renders off screen.
os.environ.setdefault("MUJOCO_GL", "osmesa")
# Matrices are small here: several threads of BLAS gain nothing, and where other programs run they wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Python searches for circles of objects after 700 new ones, a tenth of the time of a small mine and of the imports.
gc.set_threshold(50_000)

# glibc reserves 64 MB of addresses for each thread, and keeps blocks of up to 32 MB that are free. Two arenas serve the
# pipeline's threads as fast, and `certify` then runs within 4 GB (`ulimit -v`).
_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8
_mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
if _mallopt is not None:
    _mallopt(_M_ARENA_MAX, 2)
    _mallopt(_M_MMAP_THRESHOLD, 16 << 20)

_missing = [
    name for name in ("cv2", "gymnasium", "hydra", "mujoco", "open3d", "pydantic", "shapely") if find_spec(name) is None
]
if _missing:
    sys.stderr.write(
        f"minexplore: {', '.join(_missing)} not installed for {sys.executable}; "
        "run `make setup` and use .venv/bin/python (or `. .venv/bin/activate`)\n"
    )
    raise SystemExit(2)
