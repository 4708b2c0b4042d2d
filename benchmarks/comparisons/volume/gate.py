"""Five surveys as one closed volume each: floors, shell, bodies, speed. A run goes on where one stopped.

`python -m benchmarks volume-gate` runs it.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import resource
import sys
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from baselines.base.markdown import markdown_table, write_table
from benchmarks.comparisons.volume import throw_bodies
from benchmarks.comparisons.volume.cases import CASES, LEVEL, GateCase, within
from benchmarks.comparisons.volume.local.drives import LevelDrive
from benchmarks.comparisons.volume.local.environment import BUILT, VARIANTS
from benchmarks.comparisons.volume.local.environment import measure as measure_steps
from benchmarks.comparisons.volume.pictures import draw
from pipeline.store.files import write_atomically
from pipeline.volume.enclosure import measure_enclosure
from pipeline.volume.floor_error import measure_floor
from pipeline.volume.floors import solve_floors
from pipeline.volume.shell import build_shell
from pipeline.volume.union import STEEPEST, pieces_of, unite
from pipeline.volume.world.parts import without_refused
from pipeline.volume.world.proof import physics
from pipeline.volume.world.proof.region import region_of
from pipeline.volume.world.proof.throws import Throws

FOLDER, PAGE, PICTURE = (
    Path("artifacts/bench/volume-gate"),
    Path("docs/evidence/parts/volume-gate.md"),
    "volume-gate.jpg",
)


def measure(case: GateCase, folder: Path) -> dict[str, Any]:
    """Build a case as one volume and return the figures of its geometry."""
    network = case.network(folder)
    row: dict[str, Any] = {"length_m": float(network.lengths_m.sum()), "legs": len(network.shots)}
    row |= {"flat_legs": int((network.grades <= STEEPEST).sum()), "no_length": network.skipped}
    clock = [sum(os.times()[:4])]
    rough = unite(network, pieces_of(network))
    clock.append(sum(os.times()[:4]))
    volume = solve_floors(network)
    clock.append(sum(os.times()[:4]))
    np.savez_compressed(folder / "solved.npz", vertices=volume.vertices, faces=volume.faces, label=volume.label)
    built = build_shell(volume)
    clock.append(sum(os.times()[:4]))
    row |= dict(zip(("union_s", "floors_s", "shell_s"), np.diff(clock).tolist(), strict=True))
    row |= {"facets": len(volume.faces), "parts": len(built)}
    row["before"] = dataclasses.asdict(measure_floor(rough, network))
    row["floor"] = dataclasses.asdict(measure_floor(volume, network))
    row["enclosure"] = measure_enclosure(volume, built).figures
    parts, row["refused"] = without_refused(built)
    row["refused_m2"] = sum(p.area_m2 for p in built) - sum(p.area_m2 for p in parts)
    row["peak_gb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return row


def measure_physics(name: str, folder: Path, level: Path, seed: int = 0) -> dict[str, Any]:
    """Build a case, or the part about its middle, and return the figures of bodies among the parts.

    Bodies are thrown as `python -m benchmarks volume-throws` does, whose regions are taken if they are there.
    """
    rng, case = np.random.default_rng(seed), CASES[name]
    network = case.network(folder)
    if case.physics_within_m is not None:
        network = within(network, case.physics_within_m)
    volume = solve_floors(network)
    parts, _ = without_refused(build_shell(volume))
    row: dict[str, Any] = {"of_m": float(network.lengths_m.sum()), "of_parts": len(parts)}
    ours, theirs, gone = measure_steps(volume, parts, LevelDrive(level), {BUILT: VARIANTS[BUILT]})[BUILT]
    rates = [1e6 / (cost.total_us + rest) for cost, rest in ((ours, theirs.rest_us), (theirs, 0.0))]
    row["steps_per_s"] = dict(zip(("volume", "level"), rates, strict=True)) | {"gone": gone}
    region = region_of(volume, parts, throw_bodies.PARTS, rng)
    row["standing"] = dataclasses.asdict(physics.measure_standing(volume, region.parts, rng, region.targets))
    mine, kept = throw_bodies.Mine(volume, parts), throw_bodies.FOLDER / name / throw_bodies.KEPT
    thrown = throw_bodies.throw_everywhere(mine, kept, case.robot_contacts, case.ball_contacts)
    for kind in ("robots", "balls"):
        row[kind] = dataclasses.asdict(sum((Throws(**one[kind]) for one in thrown), Throws()))
    return row


def _kept(path: Path, make: Any) -> dict[str, Any]:
    """Return the figures in a file, or make and write them."""
    if path.is_file():
        found: dict[str, Any] = json.loads(path.read_text())
        return found
    row: dict[str, Any] = make()
    write_atomically(path, json.dumps(row, indent=1).encode())
    return row


def _off(floor: dict[str, Any]) -> float:
    """Return the floor's largest distance, m, from the survey, in other workings too."""
    return max([floor["error_m"], *(abs(place["off_m"]) for place in floor["elsewhere"])])


def _column(ours: dict[str, Any]) -> list[str]:
    """Return a case's column."""
    floor, before, shut, robots, balls = (ours[k] for k in ("floor", "before", "enclosure", "robots", "balls"))
    length, stands, rate = ours["length_m"], ours["standing"], ours["steps_per_s"]
    build = ours["union_s"] + ours["floors_s"] + ours["shell_s"]
    thin = f"{shut['thin_mm']:.1f} mm wide under 20, {100 * shut['full_share']:.1f} % at 300"
    follows = f"{1000 * floor['error_m']:.1f}, {1000 * floor['median_m']:.2f}, {100 * floor['over_1cm']:.2f} %"
    return [
        f"{100 * floor['share_built']:.1f} % of {length:,.0f} m",
        f"{follows}; in other workings {len(floor['elsewhere'])} legs; union alone {1000 * _off(before):.0f}",
        f"{1000 * floor['way_step_m']:.1f}, {1000 * floor['step_m']:.1f}, {len(floor['ledges'])} ledges; "
        f"union alone {1000 * before['step_m']:.0f}",
        f"{100 * floor['steep_share']:.2f} %",
        f"{robots['escapes']} in {robots['contacts']:,}",
        f"{balls['escapes']} in {balls['contacts']:,}, pushed at {balls['facets']:,} facets",
        f"{shut['intrusion_mm']:.2f}",
        f"{shut['gap_mm']:.2f}",
        f"{ours['refused']}, {1e4 * ours['refused_m2']:.2g} cm2",
        f"{shut['thinnest_mm']:.1f}; {thin}",
        f"{ours['parts'] / length:.1f} ({ours['parts']:,})",
        f"{ours['union_s']:.1f} + {ours['floors_s']:.1f} + {ours['shell_s']:.1f} = {build:.0f}",
        f"{rate['volume']:,.0f} in {ours['of_m']:,.0f} m; {rate['level']:,.0f}; {rate['volume'] / rate['level']:.2f}",
        f"{1000 * stands['rest_m']:.1f}, {100 * stands['climb_share']:.0f} %, {stands['both_off_s']:.2f} s",
        f"{ours['peak_gb']:.1f} GB",
    ]


ROWS = (
    "share of the surveyed length in the world",
    "floor against survey along the drivable legs, mm: largest, median, share over 1 cm",
    "largest step, mm: within 0.5 m of the legs' floors, where legs meet, and how many ledges are listed",
    "floor steeper than 20 deg",
    "robots that escape, in contacts",
    "balls that escape, in contacts",
    "deepest place of a part in the free space, mm",
    "widest circle of surface without a part behind it, mm",
    "parts that MuJoCo refuses",
    "thinnest part, mm",
    "parts a metre",
    "build: union + floors + shell, s",
    "control steps/s of the environment's robots; in the level mine in the same run; ratio",
    "robots at rest, mm in 5 s; that climb at 0.15 m/s; longest off both wheels",
    "memory",
)


def tables(rows: dict[str, dict[str, Any]]) -> str:
    """Return one table a case."""
    text = ""
    for name, ours in rows.items():
        table = markdown_table(("", "volume"), zip(ROWS, _column(ours), strict=True))
        text += f"## {CASES[name].title}\n\n{table}\n"
    return text


def main() -> int:
    """Measure the cases that have no result yet; write page and picture."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.comparisons.volume.gate", description=__doc__)
    parser.add_argument(
        "cases", nargs="*", help=f"default: {' '.join(CASES)}; the page is written of all that have one"
    )
    parser.add_argument(
        "--level", type=Path, default=LEVEL, help="the level world that steps a second are compared with"
    )
    a = parser.parse_args()
    unknown = sorted(set(a.cases) - set(CASES))
    if unknown:
        print(f"volume-gate: no case {unknown[0]!r}; there are {', '.join(CASES)}", file=sys.stderr)
        return 2
    for name in tqdm(a.cases or CASES, unit="case", disable=None):
        folder = FOLDER / name
        folder.mkdir(parents=True, exist_ok=True)
        case = CASES[name]
        _kept(FOLDER / f"{name}.json", lambda c=case, f=folder: measure(c, f))  # type: ignore[misc]
        _kept(FOLDER / f"{name}-physics.json", lambda n=name, f=folder: measure_physics(n, f, a.level))  # type: ignore[misc]
    rows = {}
    for name in CASES:
        files = [FOLDER / f"{name}{end}.json" for end in ("", "-physics")]
        if all(file.is_file() for file in files):
            ours, bodies = (json.loads(file.read_text()) for file in files)
            rows[name] = ours | bodies
    write_table(PAGE, tables(rows))
    draw({CASES[n].title: FOLDER / n / "solved.npz" for n in rows}, Path("docs") / PICTURE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
