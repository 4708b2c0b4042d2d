#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check fast-simplification==0.2.0 numpy==2.4.6
venv/bin/python - <<'PY'
import ctypes
import gc
import sys
from importlib.metadata import version

import fast_simplification
import numpy as np

POINTS = 700  # along each side of a rough square


def resident_mb():
    """Return the resident memory of this process, MB, after free memory was handed back."""
    gc.collect()
    ctypes.CDLL("libc.so.6").malloc_trim(0)
    status = dict(line.split(":", 1) for line in open("/proc/self/status"))
    return round(int(status["VmRSS"].split()[0]) / 1000)


x, y = np.meshgrid(np.arange(POINTS), np.arange(POINTS))
places = np.column_stack([x.ravel(), y.ravel(), np.random.default_rng(0).normal(size=x.size)]).astype(np.float32)
one = np.arange(x.size).reshape(x.shape)[:-1, :-1].ravel()
faces = np.concatenate([[one, one + 1, one + POINTS + 1], [one, one + POINTS + 1, one + POINTS]], axis=1).T.astype(np.int32)
square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.int32)
fast_simplification.simplify(*square, 0.5)  # what the library itself needs
before = resident_mb()
points, left = fast_simplification.simplify(places, faces, 0.9)
count = len(left)
del points, left
after = resident_mb()
fast_simplification.simplify(*square, 0.5)
later = resident_mb()
print(f"version: fast-simplification {version('fast-simplification')}")
print(
    "behaviour: what simplify worked with stays in memory until the process ends, also after it simplified something small; a "
    "good guess says that it is free once the result is"
)
print(
    f"seen: {len(faces)} faces become {count}; with the result deleted the process has {after - before} MB more, and "
    f"{later - before} MB after another call with two faces: {(later - before) * 1e6 / len(faces):.0f} bytes a face"
)
sys.exit(not (after - before > 100 and later - before > 100))
PY
