"""Mines with heights and known answers, as station tables."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from shapely import Polygon

HEADER = "leg,station,easting_m,northing_m,left_m,right_m,elevation_m,up_m,down_m\n"
Leg = list[tuple[str, float, float, float]]
Roofs = dict[str, float | None]  # over the floor at stations, None: not surveyed; others have 3.5 m

_MOST_SHOTS = 6  # of a piece of a leg that is drawn: half a turn of a spiral
# 10 m of 15 % between two level drifts.
RAMP: dict[str, Leg] = {"A": [("a", 0, 0, 100), ("b", 20, 0, 100), ("c", 30, 0, 101.5), ("d", 60, 0, 101.5)]}
# A drift, a ramp from its end, and a drift that the ramp leads to, 9 m under the first.
UNDER: dict[str, Leg] = {
    "A": [("a0", 0, 0, 10), ("a1", 20, 0, 10), ("a2", 40, 0, 10), ("a3", 60, 0, 10)],
    "R": [
        ("a3", 60, 0, 10),
        ("r1", 75, 0, 9),
        ("r2", 88, -10, 7),
        ("r3", 80, -25, 4.8),
        ("r4", 60, -30, 3),
        ("b0", 30, -30, 1),
    ],
    "B": [("b0", 30, -30, 1), ("b1", 30, 0, 1), ("b2", 30, 30, 1)],
}


def spiral(turns: int, radius_m: float = 14.0, grade: float = 0.13) -> dict[str, Leg]:
    """Return a decline that winds round a vertical axis, in twelve legs a turn, with a drift at either end."""
    k = np.arange(12 * turns + 1)
    angle, fall = 2 * np.pi * k / 12, grade * 2 * np.pi * radius_m / 12
    places = np.column_stack([radius_m * np.cos(angle), radius_m * np.sin(angle), 100 - fall * k])
    places = np.vstack([[radius_m, -25, 100], places, places[-1] + np.array([0, 30, 0])])
    return {"D": [(f"d{i}", float(x), float(y), float(z)) for i, (x, y, z) in enumerate(places)]}


def levels() -> dict[str, Leg]:
    """Return three levels, each with a ring of a drift and a crosscut, ramps between them, and a shaft."""
    legs: dict[str, Leg] = {}
    for number, z in enumerate((0.0, -6.0, -12.0)):
        main = [(f"m{number}{i}", 20.0 * i, 0.0, z) for i in range(4)]
        legs[f"M{number}"] = main
        legs[f"C{number}"] = [main[1], (f"c{number}1", 20, 20, z), (f"c{number}2", 40, 20, z), main[2]]
    for n, z in enumerate((0.0, -6.0)):
        way = [(75, 0, 0.5), (85, -12, 2), (75, -24, 3.2), (62, -24, 4.4), (52, -14, 5.4)]
        ramp = [(f"r{n}{i}", float(x), float(y), z - down) for i, (x, y, down) in enumerate(way)]
        legs[f"R{n}"] = [(f"m{n}3", 60, 0, z), *ramp, (f"m{n + 1}3", 60, 0, z - 6)]
    legs["S"] = [("m00", 0, 0, 0), ("s1", 0.5, 0.5, -3), ("m10", 0, 0, -6)]
    return legs


def seam() -> dict[str, Leg]:
    """Return rooms and pillars on a seam that dips by 10 % to the west and 4 % to the south: nine pillars."""
    places = {(i, j): (14.0 * i, 14.0 * j, 100 + 1.4 * i + 0.56 * j) for i in range(4) for j in range(4)}
    station = {key: (f"p{key[0]}{key[1]}", *place) for key, place in places.items()}
    rows = {f"R{j}": [station[i, j] for i in range(4)] for j in range(4)}
    return rows | {f"C{i}": [station[i, j] for j in range(4)] for i in range(4)}


def shelves() -> dict[str, Leg]:
    """Return a cave: winding passages on three shelves, one under another, and the ramps between them."""

    def passage(name: str, *places: tuple[float, float, float]) -> Leg:
        return [(f"{name}{i}", *place) for i, place in enumerate(places)]

    upper = passage("a", (0, 0, 0), (12, 5, 0), (26, 2, 0), (38, 8, 0), (50, 4, 0))
    first = passage("f", (62, -2, -1.2), (60, -14, -2.6), (48, -18, -4))
    middle = passage("b", (36, -12, -5), (28, 0, -5), (24, 14, -5), (10, 18, -5.2))
    second = passage("s", (-4, 14, -6.8), (-8, 2, -8.4))
    lower = passage("c", (2, -8, -10), (14, -4, -10), (24, -2, -10), (34, -4, -10), (40, 10, -10.2), (42, 24, -10.4))
    ledge = [middle[2], *passage("l", (34, 22, -5.5))]
    ramps = {"F": [upper[-1], *first, middle[0]], "S": [middle[-1], *second, lower[0]]}
    return {"A": upper, "B": middle, "C": lower, "L": ledge, **ramps}


def table(legs: dict[str, Leg], half_m: float = 2.2, roofs: Roofs | None = None) -> str:
    """Return a station table of legs of one width."""
    up = {name: "" if roof is None else f"{roof:g}" for name, roof in (roofs or {}).items()}
    rows = [
        f"{leg},{name},{x:.4f},{y:.4f},{half_m},{half_m},{z:.4f},{up.get(name, '3.5')},0\n"
        for leg, stations in legs.items()
        for name, x, y, z in stations
    ]
    return HEADER + "".join(rows)


def walls_of(legs: dict[str, Leg], half_m: float = 2.2) -> str:
    """Return a drawing, GeoJSON, of the walls of legs with elevations; plumb legs are lines, the axes of shafts.

    A leg that turns above itself is drawn in pieces that do not.
    """
    shapes: list[dict[str, Any]] = []
    for stations in legs.values():
        places = np.array([place for _, *place in stations], float)
        step = np.diff(places[:, :2], axis=0)
        run = np.linalg.norm(step, axis=1)
        if (run < 1).any():
            shapes.append({"type": "LineString", "coordinates": places.tolist()})
            continue
        ahead = step / run[:, None]
        turn = ahead[:-1] + ahead[1:]
        heading = np.vstack([ahead[:1], turn / np.linalg.norm(turn, axis=1)[:, None], ahead[-1:]])
        across = np.column_stack([-heading[:, 1], heading[:, 0], np.zeros(len(places))])
        across[1:-1] /= (heading[1:-1] * ahead[1:]).sum(axis=1)[:, None]
        left, right = places + half_m * across, places - half_m * across
        first = 0
        for k in range(2, len(places) + 1):
            ends = k == len(places) or k - first > _MOST_SHOTS
            if ends or not Polygon(_ring(left, right, first, k)[:, :2]).is_valid:
                shapes.append({"type": "Polygon", "coordinates": [_ring(left, right, first, k - 1).tolist()]})
                first = k - 1
    features = [{"type": "Feature", "properties": {}, "geometry": shape} for shape in shapes]
    return json.dumps({"type": "FeatureCollection", "features": features})


def _ring(left: np.ndarray, right: np.ndarray, first: int, last: int) -> np.ndarray:
    """Return the closed wall of a leg between two of its stations."""
    return np.vstack([left[first : last + 1], right[first : last + 1][::-1], left[first : first + 1]])


__all__ = [
    "RAMP",
    "UNDER",
    "Roofs",
    "levels",
    "seam",
    "shelves",
    "spiral",
    "table",
]
