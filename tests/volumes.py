"""Mines that are one volume, with known answers, as worlds in memory."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely

from pipeline.compose import compose
from pipeline.survey.passages.legs import SurveyLeg
from pipeline.survey.solved.plan_view import plan_legs
from pipeline.survey.solved_surveys import solve_file
from pipeline.types import Areas, FreeSpace, Scale, Survey, SurveyedLegs, text_array
from pipeline.volume.world.bundle import bundle_volume
from pipeline.volume.world.compile import compile_volume
from tests.heights import HEADER, Leg, levels, spiral, table
from tests.mines import frame_for

BOX = HEADER + "A,1,0,0,2,2,0,3,0\nA,2,20,0,2,2,0,3,0\n"
RAMP = HEADER + "A,1,0,0,2,2,0,3,0\nA,2,20,0,2,2,0,3,0\nA,3,40,0,2,2,3,3,0\nA,4,60,0,2,2,3,3,0\n"
# A drift, and one 8 m under it that crosses it; a ramp joins their ends.
OVER = table({"A": [("a", 0, 0, 8), ("b", 30, 0, 8)], "R": [("b", 30, 0, 8), ("c", 50, 0, 4), ("d", 50, -20, 2)]})
OVER += table({"S": [("d", 50, -20, 2), ("e", 15, -20, 0), ("f", 15, 20, 0)]}).removeprefix(HEADER)
TEE = HEADER + (
    "A,1,0,0,2.5,2.5,100,3.5,0\nA,2,60,0,2.5,2.5,96,3.5,0\nA,3,120,30,2.5,2.5,90,3.5,0\n"
    "B,2,60,0,2,2,96,3,0\nB,4,60,50,2,2,99,3,0\n"
)
_FAR_M = 5000.0


def spiral_with_side_drift() -> str:
    """Return a spiral of two turns that passes over itself, with a side drift."""
    legs: dict[str, Leg] = spiral(2)
    name, x, y, z = legs["D"][12]
    return table({**legs, "S": [(name, x, y, z), ("side", x + 26.0, y, z)]})


def three_levels() -> str:
    """Return three levels, ramps and a winze."""
    return table(levels())


def build_volume(source: str | Path, folder: Path, name: str = "test", overrides: tuple[str, ...] = ()) -> Path:
    """Return the folder of the bundle that stages 3 and 5 make of a station table's text, or of a file."""
    path = source if isinstance(source, Path) else folder / "survey.csv"
    if isinstance(source, str):
        path.write_text(source)
    config = compose(list(overrides))
    legs = plan_legs(path, solve_file(path), 1.0)
    compiled, bundle = folder / "compiled", folder / "world"
    for place, files in ((compiled, compile_volume(config.compile3d, surveyed(legs))), (bundle, None)):
        place.mkdir()
        files = files or bundle_volume(config.realism, survey_of_volume(name), plan_of_volume(), compiled)
        for file, data in files.items():
            (place / file).write_bytes(data)
    return bundle


def surveyed(legs: list[SurveyLeg]) -> SurveyedLegs:
    """Return legs as stage 1 hands them on."""
    places, lrud, names = [], [], []
    for leg in legs:
        assert leg.heights_m is not None
        places.append(np.column_stack([leg.positions_m, leg.heights_m[:, 0]]))
        lrud.append(np.column_stack([leg.walls_m, leg.heights_m[:, 1:]]))
        names += leg.stations
    middle = np.concatenate(places).mean(axis=0).round()
    if np.abs(middle).max() > _FAR_M:  # as stage 1 does with a national grid
        places = [one - middle for one in places]
    first = np.cumsum([0, *map(len, places)]).astype(np.int32)
    length = sum(float(np.linalg.norm(np.diff(one, axis=0), axis=1).sum()) for one in places)
    none = text_array([])
    return SurveyedLegs(
        np.concatenate(places), np.concatenate(lrud), first, text_array(names), none, np.zeros(0), none, np.zeros(0),
        length, 0.0,
    )  # fmt: skip


def survey_of_volume(name: str) -> Survey:
    return Survey(name, "volume", frame_for(shapely.box(0, 0, 10, 10)), Scale(8.0, "stated"), [], None, {}, ["a.csv"])


def plan_of_volume() -> FreeSpace:
    """Return a plan view; a volume's world only quotes its frame and areas."""
    square = shapely.box(0, 0, 10, 10)
    return FreeSpace(square, Areas(100.0, 0.0, 224.0, 0, 100.0, 0.0), 0.05, frame_for(square))
