"""Random mines with heights, built and certified: `make random-levels`. A run goes on where the last one stopped."""

from __future__ import annotations

import argparse
import collections
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
from scipy.optimize import linear_sum_assignment
from tqdm import tqdm

from pipeline.compose import compose
from pipeline.errors import MineError
from pipeline.params.config import Config
from pipeline.proof.validator import Validator
from pipeline.store.files import write_atomically
from tests.heights import Leg, MineWithHeights, certificate_params

_LEGS, _LENGTH_M, _GRADE, _TURN_RAD = (6, 14), (14.0, 30.0), 0.13, 1.2
_WITHIN_M, _STATION_M = 0.01, 0.02
_END_M = 3.0  # a drift's end is traced about its half width, 2.2 m, before its last wall
_CONTACTS = 200
RESULTS, TABLE = Path("artifacts/bench/random-levels.jsonl"), Path("docs/random-levels.md")


def random_legs(rng: np.random.Generator) -> dict[str, Leg]:
    """Return a decline that wanders, with level drifts from some of its stations."""
    x, y, z, heading = 0.0, 0.0, 200.0, rng.uniform(-np.pi, np.pi)
    way: Leg = [("d0", x, y, z)]
    legs: dict[str, Leg] = {"D": way}
    bias = rng.choice([-0.6, 0.0, 0.6])  # some wind round themselves
    for k in range(1, int(rng.integers(*_LEGS))):
        run, slope = rng.uniform(*_LENGTH_M), -rng.uniform(0.3, 1.0) * _GRADE
        heading += bias + rng.uniform(-_TURN_RAD, _TURN_RAD) * (0.4 if bias else 1.0)
        if k > 1 and rng.random() < 0.3:
            side = heading + rng.choice([-1, 1]) * rng.uniform(1.0, 1.6)
            far = rng.uniform(*_LENGTH_M)
            legs[f"S{k}"] = [(f"d{k - 1}", x, y, z), (f"s{k}", x + far * np.cos(side), y + far * np.sin(side), z)]
        x, y, z = x + run * np.cos(heading), y + run * np.sin(heading), z + slope * run
        way.append((f"d{k}", x, y, z))
    return legs


def judge(seed: int, config: Config) -> dict[str, Any]:
    """Build and certify one mine; return what was measured, or why it was refused."""
    legs = random_legs(np.random.default_rng(seed))
    row: dict[str, Any] = {"seed": seed}
    with tempfile.TemporaryDirectory() as folder:
        try:
            mine = MineWithHeights(legs, config, Path(folder))
        except MineError as error:
            return row | {"refused": str(error).removeprefix(folder)}
        try:
            return row | _measure(legs, mine, config)
        except Exception as error:  # this mine fails and the others continue
            return row | {"refused": f"{type(error).__name__}: {error}".replace(folder, "")}


def _measure(legs: dict[str, Leg], mine: MineWithHeights, config: Config) -> dict[str, Any]:
    validator = Validator(certificate_params(config, _CONTACTS), mine.bundle, mine.cleaned, mine.raw, mine.survey)
    clauses = validator.certificate.clauses.items()
    stations, floor = mine.stations(), mine.floor
    return {
        "sheets": len(floor.offset_m),
        "broken": {name: clause.value for name, clause in clauses if not clause.holds},
        "graph": same_graph(legs, mine),
        "station_m": round(float(np.abs(floor.heights_at(stations[:, :2]) - stations[:, 2]).max()), 5),
        "floor_m": validator.containment["floor_error_m"],
        "length_m": mine.network.total_length_m,
    }


def same_graph(legs: dict[str, Leg], mine: MineWithHeights) -> bool:
    """Return whether the world's network is the truth's: as many loops and forks, the same ends at their heights.

    A fork is a leg of a junction beyond two, so that one junction of four legs equals two of three.
    """
    truth: nx.Graph = nx.Graph()
    for leg in legs.values():
        nx.add_path(truth, [name for name, *_ in leg])
    places = {name: place for leg in legs.values() for name, *place in leg}
    ends = np.array([places[name] for name in truth if truth.degree(name) == 1])
    datum = mine.survey.heights.datum_m if mine.survey.heights else 0.0
    found = np.array([(*mine.network.nodes_m[name], 0.0) for name in mine.network.dead_ends]).reshape(-1, 3)
    found = mine.floor.fold(found) + np.array([0.0, 0.0, datum])
    loops = truth.number_of_edges() - truth.number_of_nodes() + 1
    forks = sum(degree - 2 for _, degree in truth.degree if degree > 2)
    at = collections.Counter(name for leg in mine.network.legs for name in (leg.start, leg.end))
    found_forks = sum(at[name] - 2 for name in mine.network.junctions)
    if (len(found), mine.network.loops, mine.network.components, found_forks) != (len(ends), loops, 1, forks):
        return False
    apart = np.linalg.norm(ends[:, None] - found[None], axis=2)
    return bool(apart[linear_sum_assignment(apart)].max() < _END_M)


def holds(row: dict[str, Any]) -> bool:
    """Return whether a mine was built, its certificate holds, its graph is the truth's and its floor the survey's."""
    if "refused" in row:
        return False
    return not row["broken"] and row["graph"] and row["floor_m"] <= _WITHIN_M and row["station_m"] <= _STATION_M


def report(rows: list[dict[str, Any]]) -> str:
    """Return the page docs/random-levels.md."""
    built = [row for row in rows if "refused" not in row]
    refused = len(rows) - len(built)
    sheets = collections.Counter(row["sheets"] for row in built)
    lines = [
        "# Random mines with heights\n",
        "Declines that wander or wind round themselves, with level drifts, written by `make random-levels`. A mine",
        "holds if its certificate does, its network is the truth's with the ends at their places and heights, the",
        f"floor that wheels touch is within {100 * _WITHIN_M:g} cm of the mesh, and the mesh within",
        f"{100 * _STATION_M:g} cm of the stations.\n",
        "| figure | value |",
        "|---|---|",
        f"| mines | {len(rows)} |",
        f"| hold | {sum(map(holds, rows))} |",
        f"| certificate holds | {sum(not row['broken'] for row in built)} |",
        f"| graph equal to the truth's | {sum(row['graph'] for row in built)} |",
        f"| floor within {100 * _WITHIN_M:g} cm | {sum(row['floor_m'] <= _WITHIN_M for row in built)} |",
        f"| largest floor error | {1000 * max((row['floor_m'] for row in built), default=0):.1f} mm |",
        f"| refused | {refused} |",
        f"| sheets | {', '.join(f'{n} in {count} mines' for n, count in sorted(sheets.items()))} |",
        f"| drift, all together | {sum(row['length_m'] for row in built) / 1000:.1f} km |",
    ]
    lines += [f"\nSeed {row['seed']}: {row.get('refused') or row}" for row in rows if not holds(row)]
    return "\n".join(lines) + "\n"


def main() -> int:
    """Build and certify the mines that have no result yet; return 1 if one does not hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    arguments = parser.parse_args()
    config = compose(["preset=light"])
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(line) for line in RESULTS.read_text().splitlines()] if RESULTS.is_file() else []
    wanted = sorted(set(range(arguments.count)) - {row["seed"] for row in rows})
    with RESULTS.open("a") as log:
        for seed in tqdm(wanted, unit="mine", disable=None):
            rows.append(judge(seed, config))
            log.write(json.dumps(rows[-1]) + "\n")
            log.flush()
    rows.sort(key=lambda row: row["seed"])
    text = report(rows)
    write_atomically(TABLE, text.encode())
    print(text)
    return int(not all(map(holds, rows)))


if __name__ == "__main__":
    sys.exit(main())
