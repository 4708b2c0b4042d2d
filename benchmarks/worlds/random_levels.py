"""Random surveys with heights: legs of stations of four kinds, which take turns with the seed."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import shapely

from tests.heights import Leg

_LEGS, _LENGTH_M, _GRADE, _TURN_RAD = (6, 14), (14.0, 30.0), 0.13, 1.2
_ROCK_M, _FLOORS_M = 7.0, 5.0  # between centre lines in plan, and between floors over each other
_LEVEL_M = 6.0  # from level to level
_TURN_FALL_M = 4.4  # of a spiral, so that the pillar between two turns holds
SHAFT = "shaft"


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
