"""Independent validation: rock built from half of the sweeps, scored on the half that it has not seen."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from pipeline.errors import InputError
from pipeline.params.surface import SurfaceParams
from pipeline.surface.bands import choose_bands
from pipeline.surface.build import build_rough_surface
from pipeline.surface.built import report_roughness
from pipeline.surface.reference import measure_sweeps

_DRIFT = shapely.box(0, 0, 80, 7)  # m; long enough for many of the longest windows
_HEIGHT_M = 3.5
_MOST_HALVES = 40

Progress = Callable[[list[tuple[str, ...]]], Iterable[tuple[str, ...]]]


@dataclass(frozen=True)
class Split:
    """One split: residual RMS, mm, by window (m) of the sweeps built from, of the built wall, and of those held out."""

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
    """All splits, and typical factors (exp of the mean absolute logarithm) by which the two differ from the held out.

    What `source_factor` is above 1 no builder can avoid: the halves differ by that much themselves.
    """

    splits: list[Split]
    built_factor: float
    source_factor: float


def score_holdout(sweeps: dict[str, Path], params: SurfaceParams, progress: Progress = list) -> HoldoutReport:
    """Build a straight drift's rock from every half of the sweeps and compare its section with the other half.

    Of many sweeps there are more halves than can be built: then at most 40, evenly out of their list.

    Parameters
    ----------
    sweeps : dict of Path
        By name; at least two.
    params : SurfaceParams
    progress : callable
        Wraps the list of halves, as `tqdm.tqdm` does.

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
    splits = [_score(half, sweeps, params) for half in progress(halves)]
    return HoldoutReport(
        splits,
        _factor([r for s in splits for r in s.built_vs_held_out]),
        _factor([r for s in splits for r in s.source_vs_held_out]),
    )


def _score(half: tuple[str, ...], sweeps: dict[str, Path], params: SurfaceParams) -> Split:
    rest = sorted(set(sweeps) - set(half))
    ours, theirs = (
        measure_sweeps(params.sweeps.model_copy(update={"files": {n: str(sweeps[n]) for n in part}}))
        for part in (half, rest)
    )
    copy = params.model_copy(update={"reference": "sweeps"})
    sources = {"sweeps": {"wall": ours}}
    noise = choose_bands(copy, sources)
    report = report_roughness(copy, sources, noise, build_rough_surface(copy, _DRIFT, None, _HEIGHT_M, noise))
    by_window = [dict(zip(r.window_m, r.rq_m, strict=True)) for r in (ours, report.built["section"], theirs)]
    windows = [w for w in by_window[0] if all(w in other for other in by_window[1:])]
    source, built, held = (np.array([of[w] for w in windows]) for of in by_window)
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
