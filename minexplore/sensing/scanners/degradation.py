"""What dust, water, grazing incidence and noise do to the returns of a LiDAR.

The power of a return, against that of a perpendicular surface of 10 % reflectivity at the range where the data sheet
ends, decides whether there is one: P = (rho cos i / 0.1) (r10 / r)^2 exp(-2 a r), with the reflectivity rho, the
incidence i, the range r, the data sheet's range r10, and the extinction a of dust (Beer and Lambert).
"""

from __future__ import annotations

import numpy as np

from minexplore.sensing.params import SensorParams
from minexplore.sensing.scanners.caster import Hits, SurfaceCaster
from minexplore.sensing.scanners.labels import DUST, LABELS, NOTHING, ROCK, ROOF, WATER, WET_FLOOR
from minexplore.sensing.scanners.pattern import ScanPattern

_TEN_PERCENT = 0.1
_DUST_REFLECTIVITY = 0.1  # assumption: of a clump of particles as a target
_DUST_SHAPE = 3.0  # of the Weibull distribution, an assumption: 1 would be even dust, and plumes are denser farther in
_WATER_BODY = 0.02  # assumption: what turbid water sends back from below its surface, at 865 to 905 nm
_WATER_INDEX = 1.33  # of refraction


def reflectivities(params: SensorParams) -> np.ndarray:
    """Return the reflectivity of each label (labels,) float32; metal and rubber count as rock."""
    found = np.full(len(LABELS), params.reflectivity, dtype=np.float32)
    wet = 1 - params.wet_walls * (1 - params.wet_factor)
    found[[ROCK, ROOF]] *= wet
    found[WET_FLOOR] *= params.wet_factor
    found[WATER] = found[WATER] * params.wet_factor if params.film_share < 1 else _WATER_BODY
    found[DUST], found[NOTHING] = _DUST_REFLECTIVITY, 0.0
    return found


def degrade_hits(
    hits: Hits,
    origins: np.ndarray,
    directions: np.ndarray,
    pattern: ScanPattern,
    params: SensorParams,
    caster: SurfaceCaster,
    rng: np.random.Generator,
) -> Hits:
    """Return what a LiDAR measures of what its rays hit; a lost return has the range inf.

    The random numbers are drawn in this order, each for all rays: film of water, power, dust, noise.
    """
    range_m, label, cosine = hits.range_m.copy(), hits.label.copy(), hits.cosine.copy()
    power = reflectivities(params)[label] * cosine / _TEN_PERCENT
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        power *= np.square(np.float32(pattern.range_at_ten_percent_m) / range_m)
        power *= np.exp(-2 * np.float32(params.dust_per_m) * range_m)
    film = rng.random(len(range_m)) < params.film_share
    mirrored = np.flatnonzero(film & ((label == WET_FLOOR) | (label == WATER)))
    _mirror(mirrored, range_m, label, cosine, power, origins, directions, pattern, params, caster)
    power *= 10 ** (params.power_spread_db / 10 * rng.standard_normal(len(range_m), dtype=np.float32))
    _add_dust(range_m, label, cosine, power, params, pattern, rng)
    range_m += np.float32(params.noise * pattern.noise_m) * rng.standard_normal(len(range_m), dtype=np.float32)
    lost = (power < 1) | ~np.isfinite(range_m)
    range_m[lost] = np.inf
    label[lost] = NOTHING
    return Hits(range_m, label, cosine)


def fresnel_reflectance(cosine: np.ndarray) -> np.ndarray:
    """Return the share (n,) of unpolarised light that water reflects at incidence angles of these cosines (Fresnel)."""
    refracted = np.sqrt(1 - (1 - np.square(cosine)) / _WATER_INDEX**2)
    across = (cosine - _WATER_INDEX * refracted) / (cosine + _WATER_INDEX * refracted)
    along = (_WATER_INDEX * cosine - refracted) / (_WATER_INDEX * cosine + refracted)
    reflectance: np.ndarray = (np.square(across) + np.square(along)) / 2
    return reflectance


def _mirror(
    mirrored: np.ndarray,
    range_m: np.ndarray,
    label: np.ndarray,
    cosine: np.ndarray,
    power: np.ndarray,
    origins: np.ndarray,
    directions: np.ndarray,
    pattern: ScanPattern,
    params: SensorParams,
    caster: SurfaceCaster,
) -> None:
    """Let water mirror the rays (k,) that hit it: they return, if at all, from what they hit next.

    The sensor sees that surface along the ray that it fired, as far below the water as the whole way is long: a ghost.
    Of the light that comes back by the same way the water reflects a share twice. What the water itself sends back is
    the stronger return near the upright only.
    """
    if not len(mirrored):
        return
    ways, first_m = directions[mirrored], range_m[mirrored]
    starts = np.broadcast_to(origins, directions.shape)[mirrored] + ways * first_m[:, None].astype(np.float64)
    bounced = caster.cast(starts, np.ascontiguousarray(ways * np.array([1, 1, -1], dtype=np.float32)))
    whole_m = first_m + bounced.range_m
    mirror = fresnel_reflectance(cosine[mirrored])
    with np.errstate(over="ignore", invalid="ignore"):
        ghost = np.square(mirror) * reflectivities(params)[bounced.label] * bounced.cosine / _TEN_PERCENT
        ghost *= np.square(pattern.range_at_ten_percent_m / whole_m) * np.exp(-2 * params.dust_per_m * whole_m)
    body = np.square(1 - mirror) * _WATER_BODY * cosine[mirrored] / _TEN_PERCENT
    body *= np.square(pattern.range_at_ten_percent_m / first_m) * np.exp(-2 * params.dust_per_m * first_m)
    wins = np.nan_to_num(ghost) > body
    power[mirrored] = np.where(wins, np.nan_to_num(ghost), body)
    range_m[mirrored] = np.where(wins, whole_m, first_m)
    label[mirrored] = np.where(wins, bounced.label, label[mirrored])
    cosine[mirrored] = np.where(wins, bounced.cosine, cosine[mirrored])


def _add_dust(
    range_m: np.ndarray,
    label: np.ndarray,
    cosine: np.ndarray,
    power: np.ndarray,
    params: SensorParams,
    pattern: ScanPattern,
    rng: np.random.Generator,
) -> None:
    """Let particles return rays before they reach a surface: the way to the first that does is Weibull-distributed.

    Half of all rays return from particles where dust transmits `dust_transmittance`.
    """
    if not params.dust_per_m or not params.dust_transmittance:
        return
    half_m = -np.log(params.dust_transmittance) / params.dust_per_m
    drawn = rng.standard_exponential(len(range_m), dtype=np.float32) / np.float32(np.log(2))
    before = np.float32(half_m) * drawn ** np.float32(1 / _DUST_SHAPE)
    near, far = pattern.range_m
    dusty = np.flatnonzero((before < np.minimum(range_m, far)) & (before > near))
    range_m[dusty], label[dusty], cosine[dusty] = before[dusty], DUST, 1.0
    within = np.square(pattern.range_at_ten_percent_m / before[dusty]) * _DUST_REFLECTIVITY / _TEN_PERCENT
    power[dusty] = within * np.exp(-2 * params.dust_per_m * before[dusty])
