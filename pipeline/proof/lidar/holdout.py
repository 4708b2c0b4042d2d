"""Hold-out validation: rock is built from one half of the sweeps and scored on the other half."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from pipeline.errors import InputError
from pipeline.params.surface import SurfaceParams
from pipeline.progress import counted
from pipeline.surface.build import build_rough_surface, lay_rough_lattice
from pipeline.surface.reference import measure_sweeps
from pipeline.surface.relief_source import choose_relief
from pipeline.surface.roughness_report import report_roughness

_DRIFT = shapely.box(0, 0, 80, 7)  # m; it holds many of the longest windows
_HEIGHT_M = 3.5
_MOST_HALVES = 40


@dataclass(frozen=True)
class Split:
    """One split: residual RMS, mm, by window, m, of the source sweeps, the built wall and the held-out sweeps."""

    built_from: list[str]
    held_out: list[str]
    window_m: list[float]
    source_mm: list[float]
    built_mm: list[float]
    held_out_mm: list[float]
    built_vs_held_out: list[float]
    source_vs_held_out: list[float]


@dataclass(frozen=True)
class HoldoutReport:
    """All splits, and the typical factors by which built wall and source sweeps differ from the held-out sweeps.

    A factor is exp of the mean absolute logarithm of ratios. No builder can do better than `source_factor` on average,
    because the two halves of the sweeps differ by this factor.
    """

    splits: list[Split]
    built_factor: float
    source_factor: float


def score_holdout(sweeps: dict[str, Path], params: SurfaceParams) -> HoldoutReport:
    """Build the rock of a straight drift from every half of the sweeps and compare its section with the other half.

    With many sweeps, at most 40 halves are built; they are taken evenly from the list of all halves.

    Parameters
    ----------
    sweeps : dict of Path
        The files by name; at least two.
    params : SurfaceParams

    Raises
    ------
    InputError
        If there are fewer than two sweeps, or one cannot be read.
    """
    if len(sweeps) < 2:
        raise InputError(f"holdout: {len(sweeps)} sweeps; two halves need at least two")
    names = sorted(sweeps)
    halves = list(itertools.combinations(names, len(names) // 2))
    halves = halves[:: -(-len(halves) // _MOST_HALVES)]
    splits = [_score(half, sweeps, params) for half in counted(halves, "holdout", "halves")]
    return HoldoutReport(
        splits,
        _factor([r for s in splits for r in s.built_vs_held_out]),
        _factor([r for s in splits for r in s.source_vs_held_out]),
    )


def _score(half: tuple[str, ...], sweeps: dict[str, Path], params: SurfaceParams) -> Split:
    rest = sorted(set(sweeps) - set(half))
    source_roughness, held_out_roughness = (
        measure_sweeps(params.sweeps.model_copy(update={"files": {n: str(sweeps[n]) for n in part}}))
        for part in (half, rest)
    )
    copy = params.model_copy(update={"reference": "sweeps"})
    sources = {"sweeps": {"wall": source_roughness}}
    lattice = lay_rough_lattice(copy, _DRIFT, None, _HEIGHT_M)
    relief = choose_relief(copy, sources, lattice)
    report = report_roughness(copy, sources, relief, build_rough_surface(copy, lattice, relief))
    measured = (source_roughness, report.built["section"], held_out_roughness)
    by_window = [dict(zip(r.window_m, r.rq_m, strict=True)) for r in measured]
    windows = [w for w in by_window[0] if all(w in other for other in by_window[1:])]
    source, built, held = (np.array([rq[w] for w in windows]) for rq in by_window)
    return Split(
        built_from=list(half),
        held_out=rest,
        window_m=windows,
        source_mm=np.round(1000 * source, 2).tolist(),
        built_mm=np.round(1000 * built, 2).tolist(),
        held_out_mm=np.round(1000 * held, 2).tolist(),
        built_vs_held_out=np.round(built / held, 3).tolist(),
        source_vs_held_out=np.round(source / held, 3).tolist(),
    )


def _factor(ratios: list[float]) -> float:
    return round(math.exp(float(np.mean(np.abs(np.log(ratios))))), 3)
