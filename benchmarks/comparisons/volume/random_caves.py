"""Random caves as station tables: galleries, crawls, pitches, loops, and passages that cross at all angles."""

from __future__ import annotations

import numpy as np

from tests.heights import HEADER

_STATIONS = (6, 22)  # of the main way
_SHOT_M, _PITCH_M = (2.0, 18.0), (4.0, 30.0)
_SIDE, _LOOP, _PITCH, _CROSSING = 0.25, 0.15, 0.12, 0.15  # how often each begins at a station
_LOOP_M = (4.0, 35.0)  # between stations that a loop joins
_STEEPEST = 0.9  # rise over run of a gallery that is no pitch


class _Cave:
    """Stations with their sections, and legs as lists of stations."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.places: list[np.ndarray] = []
        self.walls: list[np.ndarray] = []
        self.legs: list[list[int]] = []

    def station(self, place: np.ndarray) -> int:
        """Add a station; every third is a crawl's, some are on a wall."""
        rng = self.rng
        kind = rng.random()
        wide, tall = ((0.4, 1.2), (0.4, 0.9)) if kind < 0.3 else ((0.6, 8.0), (1.2, 9.0))
        left, right = rng.dirichlet([2, 2]) * rng.uniform(*wide) if kind < 0.85 else (0.0, rng.uniform(*wide))
        height = rng.uniform(*tall)
        down = min(rng.uniform(0.0, 1.6), 0.9 * height)
        self.places.append(place)
        self.walls.append(np.array([left, right, height - down, down]))
        return len(self.places) - 1

    def walk(self, start: int, heading: float, count: int) -> None:
        """Add a way of galleries from a station; pitches part it."""
        rng, leg = self.rng, [start]
        slope = rng.normal(0, 0.15)
        for _ in range(count):
            place = self.places[leg[-1]]
            if rng.random() < _PITCH:
                if len(leg) > 1:
                    self.legs.append(leg)
                lean = rng.normal(0, 0.5, 2) * (rng.random() < 0.5)
                foot = self.station(place + np.array([*lean, rng.choice([-1, -1, 1]) * rng.uniform(*_PITCH_M)]))
                self.legs.append([leg[-1], foot])
                leg = [foot]
                continue
            heading += rng.normal(0, 0.6)
            slope = float(np.clip(0.5 * slope + rng.normal(0, 0.2), -_STEEPEST, _STEEPEST))
            run = rng.uniform(*_SHOT_M)
            leg.append(self.station(place + run * np.array([np.cos(heading), np.sin(heading), slope])))
        if len(leg) > 1:
            self.legs.append(leg)

    def cross(self, leg: list[int]) -> None:
        """Add a passage through the middle of a leg at any angle, without a station there."""
        rng = self.rng
        middle = (self.places[leg[0]] + self.places[leg[1]]) / 2 + rng.normal(0, 0.5, 3)
        way = rng.normal(0, 1, 3) * [1, 1, 0.4]
        way *= rng.uniform(4, 12) / np.linalg.norm(way)
        self.legs.append([self.station(middle - way), self.station(middle + way)])


def random_cave(seed: int) -> str:
    """Return the station table of one random cave."""
    rng = np.random.default_rng(seed)
    cave = _Cave(rng)
    cave.walk(cave.station(np.zeros(3)), rng.uniform(-np.pi, np.pi), int(rng.integers(*_STATIONS)))
    for station in range(len(cave.places)):
        if rng.random() < _SIDE:
            cave.walk(station, rng.uniform(-np.pi, np.pi), int(rng.integers(1, 6)))
        if rng.random() < _LOOP:
            far = np.linalg.norm(np.array(cave.places) - cave.places[station], axis=1)
            others = np.flatnonzero((far > _LOOP_M[0]) & (far < _LOOP_M[1]))
            if len(others):
                cave.legs.append([station, int(rng.choice(others))])
        if rng.random() < _CROSSING and cave.legs:
            cave.cross(cave.legs[rng.integers(len(cave.legs))])
    rows = [
        f"L{number},s{k},{x:.3f},{y:.3f},{left:.3f},{right:.3f},{z:.3f},{up:.3f},{down:.3f}"
        for number, leg in enumerate(cave.legs)
        for k in leg
        for (x, y, z), (left, right, up, down) in [(cave.places[k], cave.walls[k])]
    ]
    return HEADER + "\n".join(rows) + "\n"
