"""Build a level plan as prisms and as one volume, and compare both by code that neither of them uses.

The default mine and five generated plans: ranges of beams, areas, reach, pushed discs, the certificate's local clauses,
and for the default what each costs: parts, processor time of stage 3, size of the bundle, control steps a second.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np

from baselines.base.markdown import markdown_table, write_table
from benchmarks.comparisons.one_model.measures import (
    Beams,
    enclosed_area,
    places_in,
    push,
    reach_by_outline,
    reach_on_grid,
    reach_on_spans,
)
from benchmarks.comparisons.one_model.twins import PLANS, Built, Twins
from minexplore.envs.env import MineEnv
from minexplore.envs.vector import MineVectorEnv
from minexplore.floors.volume_arrays import VolumeFacets
from pipeline.volume.enclosure import Enclosure, measure_enclosure
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.parts import collect_labelled
from pipeline.volume.world.proof.certificate import open_volume, validate_volume
from pipeline.volume.world.proof.fronts import fronts_of

TABLE = Path("docs/evidence/parts/one-model.md")
_BEAMS, _PUSHES = 100_000, 10_000
_ROBOTS, _STEPS, _ALONE_STEPS, _RUNS = 64, 60, 300, 5
_RANGE_M, _AREA_M2 = 1e-6, 1e-6  # by which both models may differ
_END_M, _FAR = 1e-2, 0.02  # of the ends of pushed discs, and the share that may be farther apart
_NUDGE_M, _NUDGED = 1e-6, 1000  # discs of the level model that are pushed again from beside their places
_LOCAL_MM = (2.0, 20.0)  # intrusion and gap of the certificate; discs may be deeper in one model by as much as parts


@dataclass(frozen=True)
class Agreement:
    """How two models of one plan agree; each pair is of the level model and of the volume."""

    name: str
    parts: tuple[int, int]
    range_m: float  # largest difference of a range
    off_m: float  # likewise from the outline, of the volume
    area_m2: tuple[float, float]  # that differs from the outline
    reach_m2: tuple[float, float, float]  # by the outline first
    touch: tuple[int, int]
    far: float  # share of the pushed discs that end over 1 cm apart
    nudged: float  # likewise of the level model twice, from places a micrometre apart
    deepest_mm: tuple[float, float]
    enclosure: tuple[Enclosure, Enclosure]

    @property
    def holds(self) -> bool:
        """Return whether the volume is as exact as the level model."""
        intrusion, gap = _LOCAL_MM
        return (
            max(self.range_m, self.off_m) <= _RANGE_M
            and max(self.area_m2) <= _AREA_M2
            and self.far <= _FAR
            and abs(self.deepest_mm[0] - self.deepest_mm[1]) <= intrusion
            and all(1e3 * one.intrusion.depth_m <= intrusion for one in self.enclosure)
            and all(1e3 * one.gap.width_m <= gap for one in self.enclosure)
            and not any(len(one.unbacked) for one in self.enclosure[1:])
        )


def compare(twins: Twins, beams: int, pushes: int, rng: np.random.Generator) -> Agreement:
    """Build both models of a plan and compare them."""
    both, outline, height_m = (twins.level, twins.volume), twins.outline, twins.height_m
    some = Beams.random(outline, height_m, beams, rng)
    ranges = [some.among(one.corners) for one in both]
    areas = [enclosed_area(one.corners, height_m / 2, twins.anchor_m).symmetric_difference(outline) for one in both]
    places, headings = places_in(outline.buffer(-0.36), pushes, rng), rng.uniform(-np.pi, np.pi, pushes)
    pushed = [push(one.corners, places, headings) for one in both]
    again = push(both[0].corners, places[:_NUDGED] + _NUDGE_M, headings[:_NUDGED])
    return Agreement(
        twins.plan.name,
        (len(both[0].corners), len(both[1].corners)),
        float(np.abs(ranges[0] - ranges[1]).max()),
        float(np.abs(ranges[1] - some.in_slab(outline, height_m)).max()),
        (areas[0].area, areas[1].area),
        (
            reach_by_outline(outline, twins.anchor_m),
            reach_on_grid(twins.grid, twins.anchor_m),
            reach_on_spans(twins.cells, twins.anchor_m),
        ),
        (int(pushed[0].touch.sum()), int(pushed[1].touch.sum())),
        _far(pushed[0].ends_m, pushed[1].ends_m),
        _far(pushed[0].ends_m[:_NUDGED], again.ends_m),
        (pushed[0].deepest_mm(outline), pushed[1].deepest_mm(outline)),
        (enclosure_of(twins.facets, both[0]), enclosure_of(twins.facets, both[1])),
    )


def _far(ends_m: np.ndarray, others_m: np.ndarray) -> float:
    """Return the share of ends (n, 2) m that are over 1 cm from the others."""
    return float((np.linalg.norm(ends_m - others_m, axis=1) > _END_M).mean())


def enclosure_of(facets: VolumeFacets, built: Built) -> Enclosure:
    """Measure the parts of either model against the volume's mesh, as the certificate of a volume does."""
    volume = closed_volume(facets)
    fronts = fronts_of(volume, collect_labelled(built.corners, built.label.tolist()))
    return measure_enclosure(volume, fronts.parts, fronts.faces)


def certificate_of(twins: Twins) -> bool:
    """Return whether the volume's certificate holds, robots and balls included."""
    params = twins.config.validation.volume
    return validate_volume(params, open_volume(twins.volume.folder), twins.slab).certificate.holds


def rates(folders: tuple[Path, Path]) -> tuple[list[float], list[float]]:
    """Return control steps per processor second of one robot and of 64, in two worlds by turns: the medians of five."""
    alone = [MineEnv(folder) for folder in folders]
    many = [MineVectorEnv(_ROBOTS, folder, threads=1) for folder in folders]
    rng = np.random.default_rng(0)
    actions = [np.column_stack([rng.uniform(0.3, 1, _ROBOTS), rng.uniform(-1, 1, _ROBOTS)]) for _ in range(9)]
    found: list[list[list[float]]] = [[[], []], [[], []]]
    for run in range(_RUNS + 1):
        for k in range(2):
            alone[k].reset(seed=0)
            one = _rate(alone[k].step, [actions[step // 10 % 9][0] for step in range(_ALONE_STEPS)])
            many[k].reset(seed=0)
            together = _ROBOTS * _rate(many[k].step, [actions[step // 10 % 9] for step in range(_STEPS)])
            if run:  # models are made in the first one
                found[0][k].append(one)
                found[1][k].append(together)
    return [median(rate) for rate in found[0]], [median(rate) for rate in found[1]]


def _rate(step: Callable[[np.ndarray], object], actions: list[np.ndarray]) -> float:
    start = time.process_time()
    for action in actions:
        step(action)
    return len(actions) / (time.process_time() - start)


def agreements_table(found: list[Agreement]) -> str:
    """Return the table of the plans."""
    rows = []
    for one in found:
        local = [f"{1e3 * e.intrusion.depth_m:.3f}, {1e3 * e.gap.width_m:.3f}" for e in one.enclosure]
        rows.append(
            (
                one.name,
                "{:,} / {:,}".format(*one.parts),
                f"{1e3 * one.range_m:.1e}",
                "{:.1e} / {:.1e}".format(*one.area_m2),
                "{:,.0f} / {:,.0f} / {:,.0f}".format(*one.reach_m2),
                "{:,} / {:,}".format(*one.touch),
                f"{100 * one.far:.2f} %; {100 * one.nudged:.2f} %",
                "{:.2f} / {:.2f}".format(*one.deepest_mm),
                " / ".join(local),
            )
        )
    heads = (
        "plan",
        "parts",
        "largest difference of ranges, mm",
        "area off the outline, m2",
        "reach by outline / grid / spans, m2",
        "discs at rock",
        "discs that end over 1 cm apart; of the level model twice",
        "deepest disc, mm",
        "intrusion and gap, mm",
    )
    return markdown_table(heads, rows)


def costs_table(twins: Twins) -> str:
    """Return the table of what the two models of the default cost."""
    one, many = rates((twins.level.folder, twins.volume.folder))
    pairs: tuple[tuple[str, float, float, str], ...] = (
        ("collision parts, floor and roof included", len(twins.level.corners), len(twins.volume.corners), ",.0f"),
        ("processor time of stage 3 in a process that is warm, s", twins.level.seconds, twins.volume.seconds, ".2f"),
        ("light bundle, MB", twins.level.bundle_bytes / 1e6, twins.volume.bundle_bytes / 1e6, ".2f"),
        ("control steps a second, one robot", one[0], one[1], ",.0f"),
        ("control steps a second, 64 robots", many[0], many[1], ",.0f"),
    )
    rows = [(name, f"{a:{form}}", f"{b:{form}}", f"{b / a:.2f}") for name, a, b, form in pairs]
    return markdown_table(("the default", "level", "volume", "ratio"), rows)


def main() -> int:
    """Compare all plans, write the page and print it; the exit code is 1 if a volume is less exact."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks one-model", description=__doc__)
    parser.add_argument("--beams", type=int, default=_BEAMS)
    parser.add_argument("--pushes", type=int, default=_PUSHES)
    args = parser.parse_args()
    found, certified, costs, text = [], [], "", ""
    for number, plan in enumerate(PLANS):
        with tempfile.TemporaryDirectory(prefix="twins-") as folder:
            twins = Twins(plan(), Path(folder))
            found.append(compare(twins, args.beams, args.pushes, np.random.default_rng(number)))
            certified.append(certificate_of(twins))
            costs = costs or costs_table(twins)
        text = (
            f"{args.beams:,} beams and {args.pushes:,} discs a plan. The certificate of the volume holds for "
            f"{sum(certified)} of {len(certified)} plans.\n\n{agreements_table(found)}\n{costs}"
        )
        write_table(TABLE, text)  # after each plan: all of them take some ten minutes
    print(text)
    return 0 if all(one.holds for one in found) and all(certified) else 1


if __name__ == "__main__":
    sys.exit(main())
