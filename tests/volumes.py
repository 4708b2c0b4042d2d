"""Mines that are one volume, with known answers, as worlds in memory."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tests.heights import HEADER, Leg, spiral, table
from tests.volume_worlds import VolumeWorld

BOX = HEADER + "A,1,0,0,2,2,0,3,0\nA,2,20,0,2,2,0,3,0\n"
RAMP = HEADER + "A,1,0,0,2,2,0,3,0\nA,2,20,0,2,2,0,3,0\nA,3,40,0,2,2,3,3,0\nA,4,60,0,2,2,3,3,0\n"
# A drift, and one 8 m under it that crosses it; a ramp joins their ends.
OVER = table({"A": [("a", 0, 0, 8), ("b", 30, 0, 8)], "R": [("b", 30, 0, 8), ("c", 50, 0, 4), ("d", 50, -20, 2)]})
OVER += table({"S": [("d", 50, -20, 2), ("e", 15, -20, 0), ("f", 15, 20, 0)]}).removeprefix(HEADER)
TEE = HEADER + (
    "A,1,0,0,2.5,2.5,100,3.5,0\nA,2,60,0,2.5,2.5,96,3.5,0\nA,3,120,30,2.5,2.5,90,3.5,0\n"
    "B,2,60,0,2,2,96,3,0\nB,4,60,50,2,2,99,3,0\n"
)


def spiral_with_side_drift() -> str:
    """Return a spiral of two turns that passes over itself, with a side drift."""
    legs: dict[str, Leg] = spiral(2)
    name, x, y, z = legs["D"][12]
    return table({**legs, "S": [(name, x, y, z), ("side", x + 26.0, y, z)]})


def build_volume(source: str | Path, folder: Path, **values: Any) -> Path:
    """Return the folder of the bundle that the stages make of a station table's text, or of a file.

    The values are those of the survey's section.
    """
    return VolumeWorld(source, folder, **values).bundle
