"""Real sweeps beside simulated ones: returns lost by incidence, and spread of ranges by range.

The real ones are bins of 0.22 to 0.25 deg of a RIEGL VZ-400 in the slice within 0.15 m of its height. They are placed
in the world as `pipeline replay` places them; the same bins are simulated by the pattern `vz-400` from the same poses.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from minexplore.bundle import FREE_SPACE
from minexplore.sensing.params import sensor_params
from minexplore.sensing.scanners import load_pattern
from minexplore.sensing.scanners.caster import SurfaceCaster, shared_caster
from minexplore.sensing.scanners.degradation import degrade_hits
from minexplore.world import World
from pipeline.compose import compose
from pipeline.mjcf.bundle import open_bundle
from pipeline.proof.lidar.replay import find_sweeps, replay_sweeps
from pipeline.proof.lidar.swept import swept_level
from pipeline.scans.sweeps import read_returns
from pipeline.store.codecs import decode
from pipeline.types import FreeSpace

INCIDENCE_DEG = (0, 30, 60, 75, 85, 90)
RANGE_M = (0, 5, 10, 20, 40)
_BIN_RAYS, _HEIGHTS = 4, 5  # rays over a bin's width and over the slice's height
_SLICE_M = 0.15
_CLEAR = {"dust_per_m": 0.0, "film_share": 0.0}  # the survey was made while nobody drove, on a dry floor
_BLIND_RAD = np.radians(10.0)  # the robot itself hides 39.5 deg of every sweep, at the same bearings
_FARTHEST_M = 40.0  # what is beyond is seen through junctions, where the plan may end


@dataclass(frozen=True)
class Bins:
    """Bins of sweeps, real or simulated, one row a bin of the world's bearings.

    `incidence_deg` and `world_m` (n,) are what the world says of the bin's middle, `returned` (n,) whether there is a
    return, `spread_m` (n,) the standard deviation of the ranges within a bin that has some.
    """

    incidence_deg: np.ndarray
    world_m: np.ndarray
    returned: np.ndarray
    spread_m: np.ndarray


def placed_poses(world: World, folder: Path) -> dict[str, tuple[float, float, float]]:
    """Return the poses of real sweeps in the world: x, y, m, and yaw, rad."""
    level = swept_level(open_bundle(world.folder), decode(world.folder / FREE_SPACE, FreeSpace).polygon)
    replay = replay_sweeps(level, folder / "scan_poses.csv", find_sweeps(folder), compose([]).validation.replay)
    return {name: sweep.pose_m for name, sweep in replay.report.sweeps.items()}


def compare_sweep(world: World, file: Path, pose: tuple[float, float, float], height_m: float) -> tuple[Bins, Bins]:
    """Return a real sweep and its simulation from a pose in a world, on the same bins."""
    returns = read_returns(file)
    bearing = np.sort(returns.bearing)
    width = float(np.median(np.diff(bearing)))
    edges = np.arange(bearing[0] - width / 2, bearing[-1] + width, width)
    middle = (edges[1:] + edges[:-1]) / 2
    wide = np.flatnonzero(np.diff(bearing) > _BLIND_RAD)
    blind = [(middle > bearing[gap]) & (middle < bearing[gap + 1]) for gap in wide]
    middle = middle[~np.any([np.zeros(len(middle), dtype=bool), *blind], axis=0)]
    order = np.argsort(returns.bearing)
    after = np.clip(np.searchsorted(bearing, middle), 1, len(bearing) - 1)
    nearest = np.where(middle - bearing[after - 1] < bearing[after] - middle, after - 1, after)
    # The real bins are cut by time and not of one width: one is lost where the next return is a whole bin away.
    counted = np.abs(bearing[nearest] - middle) < width
    spread = np.where(counted, np.sqrt(returns.variance_m2)[order][nearest], np.nan)
    caster = shared_caster(world, load_pattern("vz-400").range_m[1])
    origin = np.array([*pose[:2], height_m])
    world_m, cosine = _cast_level(caster, origin, pose[2] + middle)
    incidence = np.degrees(np.arccos(np.clip(cosine, 0, 1)))
    simulated, spreads = _simulated(caster, origin, pose[2] + middle, width, world_m)
    return Bins(incidence, world_m, counted, spread), Bins(incidence, world_m, simulated, spreads)


def _cast_level(caster: SurfaceCaster, origin: np.ndarray, bearing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    level = np.column_stack([np.cos(bearing), np.sin(bearing), np.zeros(len(bearing))]).astype(np.float32)
    hits = caster.cast(origin, level)
    return hits.range_m, hits.cosine


def _simulated(
    caster: SurfaceCaster, origin: np.ndarray, bearing: np.ndarray, width: float, world_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return which bins have a return, and the spreads of the ranges in them."""
    beside = (np.arange(_BIN_RAYS) + 0.5) / _BIN_RAYS * width - width / 2
    up = np.linspace(-_SLICE_M, _SLICE_M, _HEIGHTS)[None] / np.minimum(world_m, _FARTHEST_M)[:, None]
    yaw = (bearing[:, None, None] + beside[None, :, None]) + 0 * up[:, None, :]
    pitch = up[:, None, :] + 0 * yaw
    ways = np.stack([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)], axis=-1)
    ways = np.ascontiguousarray(ways.reshape(-1, 3), dtype=np.float32)
    hits = caster.cast(origin, ways)
    pattern, params = load_pattern("vz-400"), sensor_params({"preset": "typical", **_CLEAR})
    rng = np.random.default_rng(0)
    found = degrade_hits(hits, origin, ways, pattern, params, caster, rng)
    ranges = np.where(np.isfinite(found.range_m), found.range_m, np.nan).reshape(len(bearing), -1)
    seen: np.ndarray = np.asarray(np.isfinite(ranges).any(axis=1))
    spread = np.full(len(bearing), np.nan)
    spread[seen] = np.nanstd(ranges[seen], axis=1)
    return seen, spread


def lost_by_incidence(bins: list[Bins]) -> list[tuple[int, float]]:
    """Return for each span of `INCIDENCE_DEG` how many bins the world has there, and the share without a return."""
    incidence, returned, world_m = (
        np.concatenate([getattr(each, name) for each in bins]) for name in ("incidence_deg", "returned", "world_m")
    )
    spans = pairwise(INCIDENCE_DEG)
    masks = [(incidence >= low) & (incidence < high) & (world_m < _FARTHEST_M) for low, high in spans]
    return [(int(mask.sum()), float(1 - returned[mask].mean()) if mask.any() else np.nan) for mask in masks]


def spread_by_range(bins: list[Bins]) -> list[tuple[int, float]]:
    """Return for each span of `RANGE_M` how many bins have returns, and the median spread of their ranges, m."""
    spread, world_m = (np.concatenate([getattr(each, name) for each in bins]) for name in ("spread_m", "world_m"))
    spans = pairwise(RANGE_M)
    masks = [(world_m >= low) & (world_m < high) & np.isfinite(spread) for low, high in spans]
    return [(int(mask.sum()), float(np.median(spread[mask])) if mask.any() else np.nan) for mask in masks]
