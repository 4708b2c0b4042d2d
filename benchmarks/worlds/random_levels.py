"""Random mines with heights, built and certified. A run goes on where the last one stopped."""

from __future__ import annotations

import argparse
import collections
import sys
import tempfile
from functools import partial
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import shapely
from scipy.optimize import linear_sum_assignment

from baselines.base.markdown import markdown_table, write_table
from benchmarks.resume import resume
from pipeline.compose import compose
from pipeline.errors import MineError
from pipeline.params.config import Config
from pipeline.proof.validator import Validator
from tests.heights import Leg, MineWithHeights, certificate_params

_LEGS, _LENGTH_M, _GRADE, _TURN_RAD = (6, 14), (14.0, 30.0), 0.13, 1.2
_ROCK_M, _FLOORS_M = 7.0, 5.0  # between centre lines in plan, and between floors over each other
_LEVEL_M = 6.0  # from level to level
_TURN_FALL_M = 4.4  # of a spiral, so that the pillar between two turns holds
_WITHIN_M, _STATION_M = 0.01, 0.02  # the page states them
_END_M = 3.0  # a drift's end is traced about its half width, 2.2 m, before its last wall
_CONTACTS = 200
_COLUMNS = ("kind", "mines", "hold", "certificate", "graph", "refused", "largest floor error", "sheets", "drift")
SHAFT = "shaft"
RESULTS, TABLE = Path("artifacts/bench/random-levels.jsonl"), Path("docs/evidence/parts/random-levels.md")


def wandering(rng: np.random.Generator) -> dict[str, Leg]:
    """Return a decline that wanders, with level drifts from some of its stations, and rock where it crosses itself."""
    while True:
        legs = _wandering(rng)
        if _has_rock_between(legs):
            return legs


def _has_rock_between(legs: dict[str, Leg]) -> bool:
    """Return whether shots that share no station are `_ROCK_M` apart in plan, or one is `_FLOORS_M` over the other."""
    shots = [np.array([a[1:], b[1:]]) for leg in legs.values() for a, b in pairwise(leg)]
    for one, two in combinations(shots, 2):
        line, other = shapely.LineString(one[:, :2]), shapely.LineString(two[:, :2])
        if any((p == q).all() for p in one for q in two) or line.distance(other) > _ROCK_M:
            continue
        near = shapely.get_coordinates(shapely.shortest_line(line, other))
        heights = [
            np.interp(way.project(shapely.Point(place)), [0, way.length], shot[:, 2])
            for way, shot, place in ((line, one, near[0]), (other, two, near[1]))
        ]
        if abs(heights[0] - heights[1]) < _FLOORS_M:
            return False
    return True


def _wandering(rng: np.random.Generator) -> dict[str, Leg]:
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


def spiral(rng: np.random.Generator) -> dict[str, Leg]:
    """Return a spiral decline of 1.5 to 4.5 turns with a straight drift at either end."""
    turns, radius, stations = rng.uniform(1.5, 4.5), rng.uniform(11.0, 20.0), int(rng.integers(8, 17))
    grade = max(rng.uniform(0.08, 0.16), _TURN_FALL_M / (2 * np.pi * radius))
    k = np.arange(int(turns * stations) + 1)
    angle = rng.choice([-1, 1]) * 2 * np.pi * k / stations + rng.uniform(0, 2 * np.pi)
    fall = grade * 2 * np.pi * radius / stations
    turn = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 100 - fall * k])
    first, last = (_unit((one - two)[:2]) for one, two in (turn[:2], turn[:-3:-1]))
    start = [*turn[0, :2] + rng.uniform(8, 25) * first, turn[0, 2]]
    end = [*turn[-1, :2] + rng.uniform(8, 25) * last, turn[-1, 2]]
    return {"D": [(f"d{i}", float(x), float(y), float(z)) for i, (x, y, z) in enumerate([start, *turn, end])]}


def dipping_rooms(rng: np.random.Generator) -> dict[str, Leg]:
    """Return rooms and pillars on a seam that dips by up to 13 %, without some of the crosscuts."""
    columns, rows, apart = int(rng.integers(3, 6)), int(rng.integers(3, 6)), rng.uniform(12.0, 18.0)
    dip, towards, turned = rng.uniform(0.02, _GRADE), rng.uniform(0, 2 * np.pi), rng.uniform(0, np.pi)
    shift = rng.uniform(-0.08, 0.08, (columns, rows, 2)) * apart

    def station(i: int, j: int) -> tuple[str, float, float, float]:
        along, across = apart * np.array([i, j]) + shift[i, j]
        x, y = along * np.cos(turned) - across * np.sin(turned), along * np.sin(turned) + across * np.cos(turned)
        return f"p{i}-{j}", float(x), float(y), float(100 - dip * (x * np.cos(towards) + y * np.sin(towards)))

    legs = {f"R{j}": [station(i, j) for i in range(columns)] for j in range(rows)}
    for i in range(columns):
        for j in range(rows - 1):
            if i == 0 or rng.random() < 0.75:
                legs[f"C{i}-{j}"] = [station(i, j), station(i, j + 1)]
    return legs


def levels(rng: np.random.Generator) -> dict[str, Leg]:
    """Return two or three levels under one another, each a ring with a drift, ramps between them, and a shaft."""
    legs: dict[str, Leg] = {}
    apart, wide, deep = _LEVEL_M + rng.uniform(0, 1.5), rng.uniform(18.0, 24.0), rng.uniform(16.0, 26.0)
    count = int(rng.integers(2, 4))
    for n in range(count):
        z, side = 100 - n * apart, rng.choice([-1, 1])
        main = [(f"m{n}{i}", wide * i, 0.0, z) for i in range(4)]
        first = int(rng.integers(0, 2))
        legs[f"M{n}"] = main
        corners = [(f"c{n}{i}", wide * (first + i), side * deep, z) for i in (0, 1)]
        legs[f"C{n}"] = [main[first], *corners, main[first + 1]]
    for n in range(count - 1):
        z, east, side = 100 - n * apart, 3 * wide, rng.choice([-1, 1])
        way = [(15, 0), (27, 12), (17, 26), (2, 26), (-9, 15)]
        down = apart * np.array([0.08, 0.33, 0.55, 0.75, 0.92])
        ramp = [
            (f"r{n}{i}", east + x, side * y, z - fall) for i, ((x, y), fall) in enumerate(zip(way, down, strict=True))
        ]
        legs[f"R{n}"] = [(f"m{n}3", east, 0.0, z), *ramp, (f"m{n + 1}3", east, 0.0, z - apart)]
    legs[SHAFT] = [("m00", 0.0, 0.0, 100.0), ("s1", 0.4, 0.4, 100 - apart / 2), ("m10", 0.0, 0.0, 100 - apart)]
    return legs


KINDS = {"wandering decline": wandering, "spiral decline": spiral, "dipping rooms": dipping_rooms, "levels": levels}


def random_legs(seed: int) -> tuple[str, dict[str, Leg]]:
    """Return the kind of one random mine, which takes turns with the seed, and its legs."""
    kind = list(KINDS)[seed % len(KINDS)]
    return kind, KINDS[kind](np.random.default_rng(seed))


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def judge(seed: int, config: Config) -> dict[str, Any]:
    """Build and certify one mine; return what was measured, or why it was refused."""
    kind, legs = random_legs(seed)
    row: dict[str, Any] = {"seed": seed, "kind": kind}
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
        if leg is not legs.get(SHAFT):  # too steep to drive: it is fenced off
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
    return bool(apart[linear_sum_assignment(apart)].max(initial=0.0) < _END_M)


def holds(row: dict[str, Any]) -> bool:
    """Return whether a mine was built, its certificate holds, its graph is the truth's and its floor the survey's."""
    if "refused" in row:
        return False
    return not row["broken"] and row["graph"] and row["floor_m"] <= _WITHIN_M and row["station_m"] <= _STATION_M


def tables(rows: list[dict[str, Any]]) -> str:
    """Return the table of docs/evidence/parts/random-levels.md, and why mines do not hold."""
    of_kinds = [_cells(kind, [row for row in rows if row["kind"] == kind]) for kind in KINDS]
    failed = [f"\nSeed {row['seed']}: {row.get('refused') or row}\n" for row in rows if not holds(row)]
    return markdown_table(_COLUMNS, [*of_kinds, _cells("all", rows)]) + "".join(failed)


def _cells(kind: str, rows: list[dict[str, Any]]) -> list[object]:
    built = [row for row in rows if "refused" not in row]
    floor_mm = 1000 * max((row["floor_m"] for row in built), default=0.0)
    counts = [
        len(rows),
        sum(map(holds, rows)),
        sum(not row["broken"] for row in built),
        sum(row["graph"] for row in built),
        len(rows) - len(built),
    ]
    sheets = {row["sheets"] for row in built} or {0}
    drift_km = sum(row["length_m"] for row in built) / 1000
    return [kind, *counts, f"{floor_mm:.1f} mm", f"{min(sheets)} to {max(sheets)}", f"{drift_km:.1f} km"]


def main() -> int:
    """Build and certify the mines that have no result yet; return 1 if one does not hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    arguments = parser.parse_args()
    build = partial(judge, config=compose(["preset=light"]))
    rows = resume(RESULTS, range(arguments.count), lambda seeds: map(build, seeds), "mine")
    rows.sort(key=lambda row: row["seed"])
    write_table(TABLE, tables(rows))
    print(tables(rows))
    return int(not all(map(holds, rows)))


if __name__ == "__main__":
    sys.exit(main())
