"""Roughness of rock from sweeps, from clouds or from points of a mesh, with the same figures for each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.metrics.rock.planefit import sweep_residuals
from pipeline.metrics.rock.profile import (
    Amplitude,
    Spectrum,
    amplitude_of,
    line_roughness,
    profiles_of_cloud,
    profiles_of_runs,
    spectrum_of,
    sweep_runs,
)
from pipeline.metrics.rock.published import REAL_SWEEP

CUT_HEIGHTS_M = (1.0, 1.5)  # of level cuts through the walls
LINE_WINDOWS_M = (0.2, 0.3, 0.5, 1.0, 2.0, 3.0)
VOXELS_M = (0.10, 0.15, 0.20, 0.30, 0.50, 1.00, 2.00)
_VOXEL_POINTS = 20
_LEAST_WINDOWS = 8


@dataclass(frozen=True)
class SurfaceRoughness:
    """Roughness of one surface of one source.

    `rq_m` is the RMS residual by window. If `line`, it is to a straight line along the wall, the median over windows
    (`rq_p90_m` is their 90th percentile); else it is to a plane in voxels. `parts_rq_m` holds the value for 0.5 m of
    each sweep.
    """

    line: bool
    window_m: list[float]
    rq_m: list[float]
    rq_p90_m: list[float]
    spectrum: Spectrum | None
    amplitude: Amplitude | None
    parts_rq_m: dict[str, float]


def roughness_of_sweeps(
    sweeps: dict[str, np.ndarray], max_gap_m: float, window_m: float, footprint_m: float
) -> SurfaceRoughness:
    """Measure the walls in planar sweeps; each is (n, 2), m, in order of bearing.

    Raises
    ------
    InputError
        If no piece of wall is long enough for the window; the message states both lengths.
    """
    runs = {name: sweep_runs(sweep, max_gap_m) for name, sweep in sweeps.items()}
    all_runs = [run for of_sweep in runs.values() for run in of_sweep]
    residuals = {w: line_roughness(all_runs, w) for w in LINE_WINDOWS_M}
    windows = [w for w in LINE_WINDOWS_M if len(residuals[w]) >= _LEAST_WINDOWS]
    profiles = profiles_of_runs(all_runs, window_m)
    if not windows or not profiles:
        longest = max((float(np.linalg.norm(np.diff(r, axis=0), axis=1).sum()) for r in all_runs), default=0.0)
        raise InputError(
            f"sweeps {', '.join(sorted(sweeps))}: the longest wall without a gap ({max_gap_m:g} m) is {longest:.2f} m; "
            f"a spectrum over {window_m:g} m needs {0.8 * window_m:.2f} m (surface.sweeps.window_m)"
        )
    parts = {name: line_roughness(of_sweep, 0.5) for name, of_sweep in runs.items()}
    return SurfaceRoughness(
        line=True,
        window_m=windows,
        rq_m=[round(float(np.median(residuals[w])), 5) for w in windows],
        rq_p90_m=[round(float(np.percentile(residuals[w], 90)), 5) for w in windows],
        spectrum=spectrum_of(profiles, _wavelengths(footprint_m / 2, window_m / 2), window_m, footprint_m),
        amplitude=amplitude_of(profiles),
        parts_rq_m={name: round(float(np.median(rq)), 5) for name, rq in parts.items() if len(rq)},
    )


def roughness_of_cloud(points: np.ndarray, window_m: float, footprint_m: float, name: str) -> SurfaceRoughness:
    """Measure a surface given as points (n, 3) m.

    Raises
    ------
    InputError
        If the points fill no voxel, or fill no strip as long as the window.
    """
    sweep = [r for r in sweep_residuals(points, VOXELS_M, _VOXEL_POINTS) if r.voxels >= _LEAST_WINDOWS]
    profiles = profiles_of_cloud(points, window_m)
    if not sweep or not profiles:
        raise InputError(
            f"{name}: its {len(points):,} points fill {len(sweep)} voxel sizes and {len(profiles)} strips of "
            f"{window_m:g} m; a spectrum needs at least one of each (surface.cloud.window_m, thin_m)"
        )
    return SurfaceRoughness(
        line=False,
        window_m=[r.window_m for r in sweep],
        rq_m=[round(r.rq_m, 5) for r in sweep],
        rq_p90_m=[],
        spectrum=spectrum_of(profiles, _wavelengths(footprint_m, window_m / 2), window_m, footprint_m),
        amplitude=amplitude_of(profiles),
        parts_rq_m={},
    )


def published_roughness() -> SurfaceRoughness:
    """Return the published figures of the reference; it has no spectrum, because its points are not public."""
    return SurfaceRoughness(False, [r.window_m for r in REAL_SWEEP], [r.rq_m for r in REAL_SWEEP], [], None, None, {})


def _wavelengths(shortest_m: float, longest_m: float) -> np.ndarray:
    return np.round(np.geomspace(shortest_m, longest_m, 24), 4)
