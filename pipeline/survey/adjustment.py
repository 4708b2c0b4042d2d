"""Shots between stations to the stations' places: the adjustment of a survey network."""

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
    path: Path, shots: list[Shot], known: dict[str, np.ndarray], equal: list[tuple[str, str]]
) -> dict[str, np.ndarray]:
    """Return the places of stations that agree best with all shots, by weighted least squares.

    Parameters
    ----------
    path : Path
        Named in errors.
    shots : list of (from, to, step (3,) m, length m)
        The variance of a step grows with its length.
    known : dict
        Fixed stations' places (3,) m; if there are none, the first station stands at the origin.
    equal : list of (name, name)
        Stations that are one.

    Raises
    ------
    InputError
        If there are no shots or some hang together with no fixed station.
    """
    if not shots:
        raise InputError(f"{path}: no shots")
    same = _representatives(equal)
    names = sorted({same.get(n, n) for a, b, _, _ in shots for n in (a, b)})
    fixed = {same.get(n, n): place for n, place in known.items()} or {same.get(shots[0][0], shots[0][0]): np.zeros(3)}
    index = {name: i for i, name in enumerate(names)}
    rows, cols, values, right = [], [], [], np.zeros((len(names), 3))
    for a, b, step, length in shots:
        i, j, weight = index[same.get(a, a)], index[same.get(b, b)], 1.0 / length
        rows += [i, j, i, j]
        cols += [i, j, j, i]
        values += [weight, weight, -weight, -weight]
        right[i] -= weight * step
        right[j] += weight * step
    for name, place in fixed.items():
        if name in index:
            rows.append(index[name])
            cols.append(index[name])
            values.append(1e6)
            right[index[name]] += 1e6 * place
    _require_connected(path, shots, same, fixed)
    matrix = coo_matrix((values, (rows, cols)), shape=(len(names), len(names))).tocsc()
    found = np.column_stack([spsolve(matrix, right[:, k]) for k in range(3)])
    if not np.isfinite(found).all():
        raise InputError(f"{path}: the shots give no finite places")
    places = {name: found[i] for name, i in index.items()}
    return places | {name: places[to] for name, to in same.items() if to in places}


def _representatives(equal: list[tuple[str, str]]) -> dict[str, str]:
    """Return for every equated station the one that stands for it and its equals."""
    return {name: min(group) for group in nx.connected_components(nx.Graph(equal)) for name in group}


def _require_connected(path: Path, shots: list[Shot], same: dict[str, str], fixed: dict[str, np.ndarray]) -> None:
    graph = nx.Graph([(same.get(a, a), same.get(b, b)) for a, b, _, _ in shots])
    loose = [part for part in nx.connected_components(graph) if not part & set(fixed)]
    if loose:
        raise InputError(
            f"{path}: no shot joins station {min(loose[0])} to a fixed one; *equate or *fix one of its survey"
        )
