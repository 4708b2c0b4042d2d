"""From a mine survey to a validated MuJoCo world: the library behind the six stages."""

import os
import signal
import sys
from itertools import pairwise


def _end_at_once(kind: int, frame: object) -> None:
    """End a command that still loads its libraries; `minexplore.ends` takes over, whose package takes long to load."""
    os.write(2, b"interrupted\n")
    os._exit(130)


_command = next((word for option, word in pairwise(sys.orig_argv) if option == "-m"), "")
if _command.partition(".")[0] in ("pipeline", "stages"):
    for _kind in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(_kind) != signal.SIG_IGN:
            signal.signal(_kind, _end_at_once)

import ctypes  # noqa: E402
import gc  # noqa: E402
from importlib.util import find_spec  # noqa: E402

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
