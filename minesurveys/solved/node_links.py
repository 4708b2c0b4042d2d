"""Reader of a centreline as nodes and links: NAME_nodes.dat with x y z, and NAME_links.dat with pairs of nodes from 1.

It is the form in which networks of caves are published for studies of their shape (Collon et al. 2017,
doi:10.1016/j.geomorph.2017.01.034). It has no distances to walls.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from minesurveys.errors import InputError
from minesurveys.guard.plain_file import read_text_bytes, require_at_most
from minesurveys.guard.plain_number import plain_number
from minesurveys.limits import reader_limits
from minesurveys.solved.model import LegStyle, SolvedSurvey, StationFlag
from minesurveys.solved.project_files import inside

_FARTHEST_M = 1e8  # coordinates of a national grid
_NODES, _LINKS = "_nodes.dat", "_links.dat"


def is_node_list(path: Path) -> bool:
    """Return whether a file is a list of nodes, by its name."""
    return path.name.lower().endswith(_NODES)


def links_of(path: Path) -> Path:
    """Return the path of the links that belong to a list of nodes."""
    return path.with_name(path.name[: -len(_NODES)] + _LINKS)


def read_node_links(path: Path) -> SolvedSurvey:
    """Read nodes and links as a survey in three dimensions; node k is station `k`, from 1.

    Raises
    ------
    InputError
        If a file is missing or a line is not valid. The message names the file, the line and the value.
    """
    beside = links_of(path)
    inside(f"{path}", beside.name, path.parent, path.parent.resolve())  # it may be a link
    nodes, links = _read(path, 3, _FARTHEST_M), _read(beside, 2, reader_limits().survex_shots)
    bad = np.flatnonzero(
        (links != np.round(links)).any(axis=1) | (links < 1).any(axis=1) | (links > len(nodes)).any(axis=1)
    )
    if len(bad):
        a, b = links[bad[0]]
        raise InputError(f"{links_of(path)}: link {bad[0] + 1} joins {a:g} and {b:g}; the nodes are 1 to {len(nodes)}")
    pairs = links.astype(np.int64) - 1
    return SolvedSurvey(
        tuple(str(k) for k in range(1, len(nodes) + 1)),
        nodes,
        np.full(len(nodes), StationFlag.UNDERGROUND, np.uint8),
        pairs,
        np.zeros(len(pairs), np.uint8),
        np.full(len(pairs), LegStyle.CARTESIAN, np.uint8),
        title=path.name[: -len(_NODES)],
        files=(path, beside),
    )


def _read(path: Path, columns: int, most: float) -> np.ndarray:
    if not path.is_file():
        raise InputError(f"{path}: no such file; nodes and links belong together")
    rows: list[list[float]] = []
    for number, line in enumerate(read_text_bytes(path).decode("latin-1").splitlines(), start=1):
        words = line.split()
        if not words:
            continue
        limit = "stations" if columns == 3 else "survex_shots"
        require_at_most(path, len(rows) + 1, limit, f"{'nodes' if columns == 3 else 'links'} or more")
        try:
            values = [plain_number(word) for word in words]
        except ValueError:
            raise InputError(f"{path}:{number}: {line[:60]!r}: want {columns} numbers") from None
        if len(values) != columns or not all(abs(value) <= most for value in values):
            raise InputError(f"{path}:{number}: {line[:60]!r}: want {columns} numbers within +-{most:g}")
        rows.append(values)
    if not rows:
        raise InputError(f"{path}: holds no numbers")
    return np.array(rows)
