"""Networks with so many loops that `cavern` would take minutes: their junctions are placed before it solves the rest.

`cavern` solves a network as one dense matrix. Here it measures each leg alone: where the leg ends, and how far that end
moves when a tie of a known deviation pulls it, which shows the weight that `cavern` gives the leg. The least squares of
all legs are then one sparse system. Stations where legs meet are fixed where it puts them, and `cavern` solves the
survey, which is now legs between fixed stations.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from minesurveys.errors import InputError
from minesurveys.limits import reader_limits
from minesurveys.remarks import collect_remarks
from minesurveys.solved.survex_3d import read_3d
from minesurveys.survex.network_text import MARK, ShotElement, ShotNetwork, read_network

_LEAST_LOOPS = 700  # `cavern` takes 4 s for 841 loops, and with their number the cube
# A `.3d` file has whole centimetres. The mean over starts a part of one apart is exact to 1.3 mm.
_STARTS_M = np.arange(4) / 400.0
_PULL_M, _TIE_M = 100_000.0, 0.1
_FREE = ("*units default", "*calibrate default", "*sd default", "*data cartesian from to dx dy dz")
_EXPORT = re.compile(rb"^[ \t,]*\*[ \t,]*(?=export\b)", re.IGNORECASE | re.MULTILINE)

Run = Callable[[list[str]], tuple[int, str]]


def fix_junctions(source: Path, program: str, run: Run) -> int:
    """Fix the junctions of a large network at the end of its main file; return the number of its loops, 0 if not.

    Parameters
    ----------
    source : Path
        The main file of a copy of a project, which lies in its folder for Survex alone.
    program : str
        `cavern`.
    run : function
        Runs a command; returns its exit status and what it prints.
    """
    network = read_network(source)
    if network is None or not network.legs:
        return 0
    stations = _NetworkStations(network)
    if stations.loops() < _LEAST_LOOPS or not stations.are_tied():
        return 0
    try:
        places = _measured(network, source.name, program, run)
        starts = _fixed_places(network, places)
        positions = stations.solve(*_observed(network, places), starts)
    except (KeyError, InputError, RuntimeError, np.linalg.LinAlgError):
        return 0  # Survex refuses it, or reads other names: it reports on the project itself
    fixes = stations.junctions(positions)
    lines = [f"*fix {name} {x:.4f} {y:.4f} {z:.4f}" for name, (x, y, z) in fixes.items()]
    marks = "".join(sorted({mark for name in fixes for mark in name if not mark.isalnum()} - {"."}))
    names = [f"*set names {marks}"] if marks else []
    for file in network.files:  # stations that a survey does not export have no names outside it
        path = source.parent / file
        path.write_bytes(_EXPORT.sub(b";", path.read_bytes()))
    with source.open("ab") as end:
        end.write("\n".join(["", *_system(network), "*case preserve", *names, *lines, ""]).encode("latin-1"))
    return stations.loops()


class _NetworkStations:
    """The stations of a network by number, of which equated ones have the same.

    `legs` (m, 2) has the stations of legs, and `fixed` (f,) the fixed ones.
    """

    def __init__(self, network: ShotNetwork) -> None:
        ends = [name for leg in network.legs for name in leg.names()]
        # Without a fixed station Survex fixes the first.
        fixed = [name for one in network.fixed for name in one.names()] or ends[:1]
        every = dict.fromkeys([*ends, *fixed, *(name for row in network.equal for name in row)])
        number = {name: k for k, name in enumerate(every)}
        equal = [(number[row[0]], number[name]) for row in network.equal for name in row[1:]]
        self._pieces, self._number = _pieces(equal, len(number)), number
        self.count = int(self._pieces.max()) + 1
        self.legs = np.array([self._of(name) for name in ends]).reshape(-1, 2)
        self.fixed = np.array([self._of(name) for name in fixed])

    def _of(self, name: str) -> int:
        return int(self._pieces[self._number[name]])

    def loops(self) -> int:
        """Return the number of loops."""
        return len(self.legs) - self.count + int(_pieces(self.legs, self.count).max()) + 1

    def are_tied(self) -> bool:
        """Return whether legs lead from each station to a fixed one."""
        piece = _pieces(self.legs, self.count)
        return len(np.setdiff1d(piece, piece[self.fixed])) == 0

    def solve(self, vectors: np.ndarray, weights: np.ndarray, starts: np.ndarray) -> np.ndarray:
        """Return the positions (count, 3) that fit the vectors (m, 3) of legs best, by weights (m, 3, 3).

        `starts` (f, 3) are those of fixed stations.
        """
        size = (len(self.legs), self.count)
        ones, rows = np.ones(len(self.legs)), np.arange(len(self.legs))
        along = scipy.sparse.csr_array((ones, (rows, self.legs[:, 1])), size)
        differences = scipy.sparse.kron(
            along - scipy.sparse.csr_array((ones, (rows, self.legs[:, 0])), size), np.eye(3)
        )
        each = scipy.sparse.csr_array(scipy.sparse.block_diag(list(weights)))
        positions = np.zeros((self.count, 3))
        positions[self.fixed] = starts
        free = np.repeat(~np.isin(np.arange(self.count), self.fixed), 3)
        forces = differences.T @ (each @ (vectors.ravel() - differences @ positions.ravel()))
        matrix = scipy.sparse.csc_array(differences.T @ each @ differences)[free][:, free]
        moved = splu(scipy.sparse.csc_matrix(matrix), permc_spec="MMD_AT_PLUS_A").solve(forces[free])
        flat = positions.ravel()
        flat[free] += moved
        return flat.reshape(-1, 3)

    def junctions(self, positions: np.ndarray) -> dict[str, np.ndarray]:
        """Return a name and the position of each station of three or more legs that is not fixed in the text."""
        degree = np.bincount(self.legs.ravel(), minlength=self.count)
        degree[self.fixed] = 0
        name_of = {int(self._pieces[k]): name for name, k in self._number.items()}
        return {name_of[int(k)]: positions[k] for k in np.flatnonzero(degree > 2)}


def _pieces(pairs: object, count: int) -> np.ndarray:
    """Return the piece of each of `count` things, of which pairs are connected."""
    rows = np.array(pairs, dtype=int).reshape(-1, 2)
    graph = scipy.sparse.csr_array((np.ones(len(rows)), (rows[:, 0], rows[:, 1])), (count, count))
    found: np.ndarray = connected_components(graph, directed=False)[1]
    return found


def _measured(network: ShotNetwork, name: str, program: str, run: Run) -> dict[str, np.ndarray]:
    """Return where `cavern` puts the stations of each element alone, by their names in it."""
    with tempfile.TemporaryDirectory(prefix="minexplore-") as made:
        folder = Path(made)
        for file, content in network.files.items():
            lines = (line for part in content for line in ([part] if isinstance(part, str) else _alone(part, network)))
            text = "\n".join(lines) + "\n"
            if len(text) > reader_limits().scratch_bytes:
                raise InputError(f"{file}: too large to measure its legs alone")
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            (folder / file).write_text(text, encoding="latin-1", newline="")
        result = folder / "alone.3d"
        status, output = run([program, "-q", "-s", "-o", str(result), str(folder / name)])
        if status != 0 or not result.is_file():
            raise InputError(f"{name}: {output[:300]}")
        with collect_remarks():
            survey = read_3d(result)
        return dict(zip(survey.names, survey.positions_m, strict=True))


def _system(network: ShotNetwork) -> list[str]:
    return [f"*cs {network.system}"] if network.system else []


def _alone(element: ShotElement, network: ShotNetwork) -> list[str]:
    """Return the lines that measure one element."""
    if len(element.stations) == 1:
        starts = [f"{element.stations[0]} {MARK}{k} {start} {start} {start}" for k, start in enumerate(_STARTS_M)]
        return [f"*begin {element.block}", *element.lines, *_FREE, *starts, f"*end {element.block}"]
    first, last = element.stations
    lines = [f"*begin {element.block}", *_system(network)]
    for k, start in enumerate(_STARTS_M):
        fix = f"*fix {first} {start} {start} {start}"
        lines += [f"*begin start{k}", *element.lines, fix, f"*end start{k}"]
    for axis, pull in enumerate(_PULL_M * np.eye(3, dtype=int)):
        ends = [f"*fix {first} 0 0 0", f"*fix {MARK} {pull[0]} {pull[1]} {pull[2]}"]
        tie = [*_FREE, f"*sd dx dy dz {_TIE_M} metres", f"{MARK} {last} 0 0 0"]
        lines += [f"*begin pull{axis}", *element.lines, *ends, *tie, f"*end pull{axis}"]
    return [*lines, f"*end {element.block}"]


def _observed(network: ShotNetwork, places: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the vector (m, 3) and the weight (m, 3, 3), 1/m2, of each leg.

    A leg of weight W that ends at v, and a tie of weight T that ends at f, meet at x: W (v - x) = T (x - f).
    """
    ends = _ends(network, places, [f"start{k}" for k in range(len(_STARTS_M))])
    vectors = (ends - _STARTS_M[None, :, None]).mean(axis=1)
    met = _ends(network, places, [f"pull{axis}" for axis in range(3)])
    left = np.swapaxes(vectors[:, None] - met, 1, 2)  # a column a pull
    right = np.swapaxes(met - _PULL_M * np.eye(3), 1, 2) / _TIE_M**2
    weights = right @ np.linalg.inv(left)
    return vectors, (weights + np.swapaxes(weights, 1, 2)) / 2.0


def _ends(network: ShotNetwork, places: dict[str, np.ndarray], parts: list[str]) -> np.ndarray:
    """Return where the legs end in some parts of their blocks: (m, parts, 3), m."""
    return np.array(
        [[places[leg.state.name(leg.block, part, leg.stations[1])] for part in parts] for leg in network.legs]
    )


def _fixed_places(network: ShotNetwork, places: dict[str, np.ndarray]) -> np.ndarray:
    """Return the places of fixed stations (f, 3); without one, Survex fixes the first at 0, 0, 0."""
    names = [[one.state.name(one.block, f"{MARK}{k}") for k in range(len(_STARTS_M))] for one in network.fixed]
    if not names:
        return np.zeros((1, 3))
    ends = np.array([[places[name] for name in row] for row in names])
    return (ends - _STARTS_M[None, :, None]).mean(axis=1)
