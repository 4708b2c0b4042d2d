"""Simplification of a large mesh in a process of its own: `python -m pipeline.mjcf.simplify`.

`fast_simplification` keeps what it worked with, 350 bytes a face, until its process ends: 0.7 GB for the visible floor
of the default mine (findings/fast-simplification-keeps-memory.sh).
"""

from __future__ import annotations

import io
import subprocess
import sys

import numpy as np

from pipeline.errors import GeometryError, MemoryShortageError

_FEW_FACES = 200_000  # 70 MB; a process takes 0.3 s to start


def simplify_mesh(points: np.ndarray, faces: np.ndarray, reduction: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the points (k, 3) and faces (m, 3) that `fast_simplification.simplify` makes.

    Parameters
    ----------
    points : (n, 3) float32
    faces : (l, 3) int32
    reduction : float
        Share of the faces that is removed.

    Raises
    ------
    MemoryShortageError
        If the process ran out of memory.
    GeometryError
        If it failed otherwise; the message is its last line.
    """
    if len(faces) <= _FEW_FACES:
        return _simplify(points, faces, reduction)
    command = [sys.executable, "-m", __name__, str(reduction)]
    done = subprocess.run(command, input=_packed(points, faces), capture_output=True, check=False)
    if done.returncode:
        reason = done.stderr.decode(errors="replace").strip().rpartition("\n")[2][-300:]
        short = done.returncode < 0 or "MemoryError" in reason or "bad_alloc" in reason  # a signal: the system ended it
        raise (MemoryShortageError if short else GeometryError)(f"simplification of {len(faces)} faces: {reason}")
    simplified, kept = _unpacked(done.stdout)
    return simplified, kept


def _simplify(points: np.ndarray, faces: np.ndarray, reduction: float) -> tuple[np.ndarray, np.ndarray]:
    import fast_simplification

    simplified, kept = fast_simplification.simplify(points, faces, target_reduction=reduction)
    return simplified, kept


def _packed(*arrays: np.ndarray) -> memoryview:
    stream = io.BytesIO()
    for array in arrays:
        np.save(stream, array, allow_pickle=False)
    return stream.getbuffer()


def _unpacked(data: bytes) -> tuple[np.ndarray, np.ndarray]:
    stream = io.BytesIO(data)
    return np.load(stream, allow_pickle=False), np.load(stream, allow_pickle=False)


if __name__ == "__main__":
    sys.stdout.buffer.write(_packed(*_simplify(*_unpacked(sys.stdin.buffer.read()), float(sys.argv[1]))))
