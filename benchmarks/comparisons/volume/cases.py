"""Five surveys whose volumes are measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from minesurveys.solved_surveys import solve_file
from pipeline.survey.solved.plan_view import plan_legs
from pipeline.volume.height_field.assumed_roofs import network_with_roofs
from pipeline.volume.network import SurveyNetwork
from tests.heights import HEADER, levels, spiral, table

ROOF_M, HALF_M = 3.5, 1.0  # where nobody measured: as today's default height, and as stated for Sakany
_TEE = """A,1,0,0,2.5,2.5,100,3.5,0
A,2,60,0,2.5,2.5,96,3.5,0
A,3,120,30,2.5,2.5,90,3.5,0
B,2,60,0,2,2,96,3,0
B,4,60,50,2,2,99,3,0
"""


@dataclass(frozen=True)
class GateCase:
    """A survey: its file or the table to write, options of `pipeline new`, and how much is thrown at least."""

    title: str
    source: str
    options: tuple[str, ...] = ()
    is_table: bool = True
    robot_contacts: int = 2_000  # of discs with rock
    ball_contacts: int = 20_000
    physics_within_m: float | None = None  # of the middle: MuJoCo's specs take 1 ms a part

    def path(self, folder: Path) -> Path:
        """Return the survey's file; a table is written into the folder."""
        if not self.is_table:
            return Path(self.source).absolute()
        path = folder / "survey.csv"
        path.write_text(self.source)
        return path

    def network(self, folder: Path) -> SurveyNetwork:
        """Return the survey's network."""
        path = self.path(folder)
        survey = solve_file(path)
        legs = plan_legs(path, survey, HALF_M if "--half-width" in self.options else None)
        return network_with_roofs(legs, ROOF_M, HALF_M)


def _spiral() -> str:
    legs = spiral(2)
    name, x, y, z = legs["D"][12]
    return table({**legs, "S": [(name, x, y, z), ("side", x + 26.0, y, z)]})


CASES = {
    "spiral": GateCase("spiral of two turns, a side drift", _spiral()),
    "levels": GateCase("three levels, ramps and a winze", table(levels())),
    "tee": GateCase("a T on a slope", HEADER + _TEE),
    "pell": GateCase("Wheal Pell", "data/wheal_pell/pell.3d", (), False),
    "sakany": GateCase("Sakany", "data/sakany/Sakany_nodes.dat", ("--half-width", "1.0"), False, physics_within_m=25.0),
}


def within(network: SurveyNetwork, radius_m: float) -> SurveyNetwork:
    """Return the shots whose ends are within a distance of the middle station, seen from above."""
    middle = network.places_m[
        np.argmin(np.abs(network.places_m[:, :2] - np.median(network.places_m[:, :2], axis=0)).sum(axis=1))
    ]
    kept = (np.linalg.norm((network.ends_m - middle)[:, :, :2], axis=2) < radius_m).all(axis=1)
    joined = network.joined & np.column_stack([np.roll(kept, 1), np.roll(kept, -1)])
    return replace(
        network,
        shots=network.shots[kept],
        across=network.across[kept],
        lrud_m=network.lrud_m[kept],
        joined=joined[kept],
        known=network.known[kept],
        roof_lowered=network.roof_lowered[kept],
    )
