"""Weld mesh under the roof of junctions: wires as ribbons that hang on the lowest bumps of the rock."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.ndimage import gaussian_filter, minimum_filter

from pipeline.geometry.polyline import FloorLine, resample
from pipeline.geometry.raycast import RayCaster
from pipeline.params.fittings import WeldMeshParams

_UP_TO_EYE = np.array([0.0, 0.0, 1.7])  # m: the roof is looked at from there, on the middle of the drift
_RAYS_M, _RAYS_DEG = 0.3, 6.0  # between rays along a drift and across it
_BEND = 4  # rays from one bend of a wire to the next: between two rows of bolts it is straight
_TAUT = 2 * _BEND + 1  # rays among which the lowest bump holds the mesh off the others
_OFF_ROCK_M = 0.03
_REACH_M = 6.0  # a ray that goes farther has met no roof


def hang_weld_mesh(
    params: WeldMeshParams, ways: Sequence[FloorLine], rock: RayCaster
) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield ribbons of weld mesh as vertices (n, 3) m and faces (m, 3), mine frame, which face into the drift.

    Mesh hangs over the ends of drifts at junctions, where the roof has the widest span.

    Parameters
    ----------
    params : WeldMeshParams
    ways : sequence of FloorLine
    rock : RayCaster
        Of the visible rock.
    """
    for way in ways:
        _, places = resample(way.floor_m, _RAYS_M)
        along = _RAYS_M * np.arange(len(places))
        for at_junction, from_end in zip(way.ends_at_junctions, (along, along[::-1]), strict=True):
            covered = places[from_end <= params.from_junction_m]
            if at_junction and len(covered) > _BEND:
                yield from _cover(params, rock, covered)


def _cover(params: WeldMeshParams, rock: RayCaster, places: np.ndarray) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield the wires over places (n, 3) m on the floor along a drift."""
    ahead = np.gradient(places[:, :2], axis=0)
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
    left = np.column_stack([-ahead[:, 1], ahead[:, 0], np.zeros(len(ahead))])
    half = _BEND * max(1, round(params.spread_deg / _RAYS_DEG / _BEND))
    angle = np.radians(params.spread_deg) * np.arange(-half, half + 1) / half
    ray = np.sin(angle)[None, :, None] * left[:, None] + np.cos(angle)[None, :, None] * np.array([0.0, 0.0, 1.0])
    eye = np.broadcast_to((places + _UP_TO_EYE)[:, None], ray.shape)
    distance = rock.cast(eye.reshape(-1, 3), ray.reshape(-1, 3)).reshape(ray.shape[:2])
    if (distance > _REACH_M).any():
        return
    taut = gaussian_filter(minimum_filter(distance, _TAUT), 1.0)
    bends = (eye + (np.minimum(taut, distance) - _OFF_ROCK_M)[..., None] * ray)[::_BEND, ::_BEND]
    for net in (bends, bends.transpose(1, 0, 2)):  # wires across the drift, then along it
        wires = _between(net, params.aperture_m)
        yield "weldmesh", *_ribbons(wires, params.wire_m, places[len(places) // 2] + _UP_TO_EYE)


def _between(net: np.ndarray, apart_m: float) -> np.ndarray:
    """Return wires (k, m, 3) at even distances of about `apart_m` between the lines (n, m, 3) of a net."""
    length = np.linalg.norm(np.diff(net, axis=0), axis=2).mean(axis=1)
    at = np.concatenate([[0.0], np.cumsum(length)])
    where = np.linspace(0.0, at[-1], max(2, round(at[-1] / apart_m) + 1))
    low = np.clip(np.searchsorted(at, where, side="right") - 1, 0, len(length) - 1)
    share = ((where - at[low]) / length[low])[:, None, None]
    return (1 - share) * net[low] + share * net[low + 1]


def _ribbons(wires: np.ndarray, width_m: float, eye: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return ribbons along wires (k, m, 3) that show their faces to an eye (3,)."""
    ahead = np.gradient(wires, axis=1)
    aside = np.cross(ahead, eye - wires)
    aside *= width_m / 2 / np.maximum(np.linalg.norm(aside, axis=2, keepdims=True), 1e-9)
    count, points = wires.shape[:2]
    vertices = np.stack([wires + aside, wires - aside], axis=2).reshape(-1, 3)
    start = 2 * (points * np.arange(count)[:, None] + np.arange(points - 1)).ravel()
    quads = np.column_stack([start, start + 1, start + 3, start + 2])
    return vertices, np.concatenate([quads[:, [0, 2, 1]], quads[:, [0, 3, 2]]])
