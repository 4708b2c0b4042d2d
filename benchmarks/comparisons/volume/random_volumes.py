"""Surveys as one volume each, by the certificate's limits: five surveys, and random mines and caves.

Into the five, robots are thrown and balls pushed at every facet. One column counts surveys with under 0.01 mm of rock
in the free space.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from baselines.base.markdown import markdown_table
from benchmarks.comparisons.volume.cases import CASES, GateCase, within
from benchmarks.comparisons.volume.random_caves import random_cave
from benchmarks.comparisons.volume.throw_bodies import Mine, throw_everywhere
from benchmarks.judged_cases import JudgedCases, largest
from benchmarks.worlds.random_levels import random_legs
from pipeline.errors import MineError
from pipeline.geometry.facets.crossings import CROSSING_M, crossing_facets
from pipeline.volume.enclosure import measure_enclosure
from pipeline.volume.floor_error import measure_floor
from pipeline.volume.floors import solve_floors
from pipeline.volume.shell import build_shell
from pipeline.volume.world.content import in_mine_frame
from pipeline.volume.world.parts import labelled_parts, without_refused
from pipeline.volume.world.proof.fronts import fronts_of
from pipeline.volume.world.proof.surveyed.open_legs import open_figures
from tests.heights import table

_RANDOM = 200  # mines, and as many caves, by turns
_INTRUSION_MM = 0.01  # beside the limit of the certificate


def limits() -> dict[str, dict[str, float]]:
    """Return the certificate's limits by figure, and none of facets that cross."""
    groups = yaml.safe_load(Path("conf/validation/default.yaml").read_text())["volume"]["limits"]
    found = {f"{group}.{name}": limit for group, some in groups.items() for name, limit in some.items()}
    return found | {"crossings": {"max": 0.0}}


def table_of(kind: str, seed: int) -> str:
    """Return the station table of a random mine or cave."""
    return table(random_legs(seed)[1]) if kind == "mine" else random_cave(seed)


def judge(kind: str, seed: int) -> dict[str, Any]:
    """Return what was measured of one survey, or why it was refused."""
    row: dict[str, Any] = {"kind": kind, "seed": seed}
    with tempfile.TemporaryDirectory() as folder:
        try:
            return row | _measure(GateCase(f"{kind} {seed}", table_of(kind, seed)), Path(folder))
        except MineError as error:
            return row | {"refused_because": str(error).replace(folder, "")}
        except Exception as error:  # this one fails and the others go on
            return row | {"refused_because": f"{type(error).__name__}: {error}".replace(folder, "")}


def _measure(case: GateCase, folder: Path) -> dict[str, Any]:
    network = case.network(folder)
    volume = solve_floors(network)
    parts, refused = without_refused(build_shell(volume))
    mine = in_mine_frame(volume, np.zeros(3))
    fronts = fronts_of(volume, labelled_parts(parts, mine, np.zeros(3)))
    floor = measure_floor(volume, network)
    found = measure_enclosure(volume, fronts.parts, fronts.faces).figures
    return {
        "length_m": float(network.lengths_m.sum()),
        "parts": len(parts),
        "refused": refused,
        "survey.share_built": floor.share_built,
        "survey.open_share": open_figures(network, np.zeros(3), volume)["open_share"],
        "floor.error_mm": 1e3 * floor.error_m,
        "floor.step_mm": 1e3 * floor.step_m,
        "floor.other_step_mm": 1e3 * floor.other_step_m,
        **{f"enclosure.{name}": found[name] for name in ("intrusion_mm", "gap_mm", "thin_mm", "unbacked")},
        "crossings": len(crossing_facets(volume.vertices, volume.faces, CROSSING_M)),
    }


def beyond(row: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of a row that are beyond their limits, or why it was refused; nothing for a clean one."""
    if "refused_because" in row:
        return {"refused_because": row["refused_because"]}
    known = {name: limit for name, limit in limits().items() if name in row}
    return {
        name: row[name]
        for name, limit in known.items()
        if not limit.get("min", -np.inf) <= row[name] <= limit.get("max", np.inf)
    }


def judge_case(case: tuple[str, int]) -> dict[str, Any]:
    """Return the row of one of the five surveys, with bodies thrown, or of a random one."""
    kind, seed = case
    if kind in CASES:
        with tempfile.TemporaryDirectory() as folder:
            return {
                "kind": CASES[kind].title,
                **_measure(CASES[kind], Path(folder)),
                **_bodies(CASES[kind], Path(folder)),
            }
    return judge(kind, seed) | {"kind": f"random {kind}s"}


def mine_of(case: GateCase, folder: Path) -> Mine:
    """Build a case, or the part about its middle."""
    network = case.network(folder)
    if case.physics_within_m is not None:
        network = within(network, case.physics_within_m)
    volume = solve_floors(network)
    return Mine(volume, without_refused(build_shell(volume))[0])


def _bodies(case: GateCase, folder: Path) -> dict[str, int]:
    """Return the contacts of bodies in a case, and how many escaped."""
    found = throw_everywhere(mine_of(case, folder), case.robot_contacts, case.ball_contacts)
    return {"contacts": sum(one.contacts for one in found), "escapes": sum(one.escapes for one in found)}


def _sum(key: str) -> Any:
    def cell(rows: list[dict[str, Any]]) -> str:
        values = [row[key] for row in rows if key in row]
        return f"{sum(values):,.0f}" if values else ""

    return cell


def _least_intruded(rows: list[dict[str, Any]]) -> int:
    return sum(not beyond(row) and row["enclosure.intrusion_mm"] <= _INTRUSION_MM for row in rows)


def note(rows: list[dict[str, Any]]) -> str:
    """Return which surveys are not clean, and why."""
    bad = [
        (f"{' '.join(map(str, row['case']))}", name, f"{value:.4g}" if isinstance(value, float) else value)
        for row in rows
        for name, value in beyond(row).items()
    ]
    return markdown_table(("not clean", "figure", "is"), bad) if bad else ""


VOLUMES = JudgedCases(
    name="volumes",
    cases=[
        *((name, 0) for name in CASES),
        *((kind, k) for k in range(_RANDOM) for kind in ("mine", "cave")),
    ],
    sample=len(CASES) + 24,
    judge=judge_case,
    holds=lambda row: not beyond(row) and not row.get("escapes"),
    groups=lambda row: [row["kind"]],
    with_all=False,
    columns={
        "surveys": len,
        "clean": lambda rows: sum(not beyond(row) for row in rows),
        "and under 0.01 mm of intrusion": _least_intruded,
        "surveyed, m": _sum("length_m"),
        "parts": _sum("parts"),
        "floor off, mm": largest("floor.error_mm", ".1f"),
        "step, mm": largest("floor.step_mm", ".1f"),
        "intrusion, mm": largest("enclosure.intrusion_mm", ".2g"),
        "gap, mm": largest("enclosure.gap_mm", ".2g"),
        "contacts of bodies": _sum("contacts"),
        "escapes": _sum("escapes"),
    },
    note=note,
)

if __name__ == "__main__":
    sys.exit(VOLUMES.run(__doc__))
