"""Heights by a sparse linear system, with the same digits on every processor (ADR 22)."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import spsolve

_DIGITS = 6  # micrometres: the kernels of BLAS, which differ by processor, differ in about the twelfth


def solve_heights(system: csc_matrix, right: np.ndarray) -> np.ndarray:
    """Return the heights (n,) m that solve a system (n, n), to a micrometre; not finite where it is singular."""
    return np.atleast_1d(np.asarray(spsolve(system, right))).round(_DIGITS)
