"""What dust, water and noise do to pictures and depth images."""

from __future__ import annotations

import numpy as np

from minexplore.sensing.params import SensorParams
from minexplore.sensing.scanners.labels import WATER, WET_FLOOR

_AIRLIGHT_RGB = np.array([0.42, 0.38, 0.33])  # of dust in a headlamp's light, an assumption
_LOST_SHARE = 0.15  # assumption: of a depth camera's own light that must come back from a perpendicular surface
_DUST_SHAPE = 3.0  # as of LiDARs


def degrade_picture(
    picture: np.ndarray, depth_m: np.ndarray | None, params: SensorParams, rng: np.random.Generator
) -> np.ndarray:
    """Return a picture (h, w, 3) uint8 through dust, with noise; dust needs the depth (h, w) m.

    By the law of Beer and Lambert a surface keeps exp(-a d) of its light, and the lamp's light in the dust fills the
    rest (Koschmieder 1924).
    """
    shown = picture.astype(np.float32) / 255
    if params.dust_per_m and depth_m is not None:
        passed = np.exp(-np.float32(params.dust_per_m) * depth_m)[..., None]
        shown = shown * passed + _AIRLIGHT_RGB.astype(np.float32) * (1 - passed)
    if params.image_noise:
        shown += np.float32(params.image_noise) * rng.standard_normal(shown.shape, dtype=np.float32)
    return np.rint(255 * np.clip(shown, 0, 1)).astype(np.uint8)


def degrade_depth(
    depth_m: np.ndarray,
    label: np.ndarray,
    focal_px: float,
    baseline_m: float,
    params: SensorParams,
    rng: np.random.Generator,
    farthest_m: float = np.inf,
) -> np.ndarray:
    """Return a depth image (h, w) m as an active stereo camera measures it; 0 where it measures nothing.

    Noise grows with the square of the depth: a disparity of f b / z is off by `depth_noise_px`. Dust takes the
    camera's own light twice, and returns from particles as those of a LiDAR do, up to `farthest_m`. Standing water
    mirrors it away.
    """
    surface = np.where(depth_m > 0, depth_m, np.inf).astype(np.float32)
    film = rng.random(surface.shape) < params.film_share
    lost = np.isinf(surface) | (film & ((label == WET_FLOOR) | (label == WATER)))
    found = surface
    if params.dust_per_m:
        half_m = -np.log(params.dust_transmittance) / params.dust_per_m if params.dust_transmittance else np.inf
        drawn = rng.standard_exponential(surface.shape, dtype=np.float32) / np.float32(np.log(2))
        before = np.float32(half_m) * drawn ** np.float32(1 / _DUST_SHAPE)
        lost |= np.exp(-2 * params.dust_per_m * surface) < _LOST_SHARE
        found = np.minimum(surface, before)
        lost &= before > np.minimum(surface, farthest_m)  # particles return where a surface does not
    found = np.where(lost, np.float32(0), found)
    noise = params.depth_noise_px * np.square(found) / np.float32(focal_px * baseline_m)
    found = found + noise.astype(np.float32) * rng.standard_normal(found.shape, dtype=np.float32)
    return np.where(lost, np.float32(0), np.maximum(found, 0))
