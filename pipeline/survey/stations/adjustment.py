"""Adjustment of a survey network: compute the positions of stations from the shots between them."""

from __future__ import annotations

from pathlib import Path

import networkx as nx
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

from pipeline.errors import InputError

Points = np.ndarray
Shot = tuple[str, str, np.ndarray, float]


def adjust_network(
    path: Path, shots: list[Shot], fixed: dict[str, np.ndarray], equal: list[tuple[str, str]]
) -> dict[str, np.ndarray]:
    """Compute the positions of all stations from all shots by weighted least squares.

    Parameters
    ----------
    path : Path
        The survey file; errors name it.
    shots : list of (from, to, step (3,) m, length m)
        The variance of a step is proportional to its length.
    fixed : dict
        Positions (3,) m of the fixed stations. Without any, the first station is the origin.
    equal : list of (name, name)
        Pairs of names of the same station.

    Returns
    -------
    dict
        Position (3,) m of every station.

    Raises
    ------
    InputError
        If there are no shots, or if some stations are not connected to a fixed station.
    """
    if not shots:
        raise InputError(f"{path}: no shots")
    same = _representatives(equal)
    names = sorted({same.get(n, n) for a, b, _, _ in shots for n in (a, b)})
    first = shots[0][0]
    fixed = {same.get(n, n): position for n, position in fixed.items()} or {same.get(first, first): np.zeros(3)}
    index = {name: i for i, name in enumerate(names)}
    rows, cols, values, right = [], [], [], np.zeros((len(names), 3))
    for a, b, step, length in shots:
        i, j, weight = index[same.get(a, a)], index[same.get(b, b)], 1.0 / length
        rows += [i, j, i, j]
        cols += [i, j, j, i]
        values += [weight, weight, -weight, -weight]
        right[i] -= weight * step
        right[j] += weight * step
    for name, position in fixed.items():
        if name in index:
            rows.append(index[name])
            cols.append(index[name])
            values.append(1e6)
            right[index[name]] += 1e6 * position
    _require_connected(path, shots, same, fixed)
    matrix = coo_matrix((values, (rows, cols)), shape=(len(names), len(names))).tocsc()
    solution = np.column_stack([spsolve(matrix, right[:, k]) for k in range(3)])
    if not np.isfinite(solution).all():
        raise InputError(f"{path}: the shots give no finite positions")
    positions = {name: solution[i] for name, i in index.items()}
    return positions | {name: positions[to] for name, to in same.items() if to in positions}


def _representatives(equal: list[tuple[str, str]]) -> dict[str, str]:
    """Map every equated station to one representative of its group."""
    return {name: min(group) for group in nx.connected_components(nx.Graph(equal)) for name in group}


def _require_connected(path: Path, shots: list[Shot], same: dict[str, str], fixed: dict[str, np.ndarray]) -> None:
    graph = nx.Graph([(same.get(a, a), same.get(b, b)) for a, b, _, _ in shots])
    unconnected = [part for part in nx.connected_components(graph) if not part & set(fixed)]
    if unconnected:
        raise InputError(
            f"{path}: no shot joins station {min(unconnected[0])} to a fixed station; "
            "add *equate or *fix for one station of its survey"
        )
