"""Random variants of workings, within the errors of a survey."""

from __future__ import annotations

import math

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.errors import GeometryError
from pipeline.geometry.outline.enclosure import as_polygons

_WAVES = 64
_STEEPEST = 0.7  # bound on the field's gradient; the field folds the plane at 1


def perturb_workings(
    workings: BaseGeometry, station_sd_m: float, width_sd_m: float, reach_m: float, rng: np.random.Generator
) -> MultiPolygon:
    """Return workings that differ from the given ones by a survey's errors and have the same loops and dead ends.

    Parameters
    ----------
    workings : shapely geometry, m
    station_sd_m : float
        Standard deviation of each coordinate of a place; neighbouring places move together.
    width_sd_m : float
        Standard deviation of the offset of all walls, drawn once for the mine.
    reach_m : float
        Distance over which places move together.
    rng : Generator

    Raises
    ------
    GeometryError
        If the errors would fold the plan, or close or open a drift; the message names them.
    """
    moved = displace(workings, station_sd_m, 2 * reach_m, rng)
    offset = rng.normal(0.0, width_sd_m) if width_sd_m else 0.0
    perturbed = as_polygons(moved.buffer(offset, join_style="mitre"))
    if _network(perturbed) != _network(workings):
        raise GeometryError(f"an offset of {offset:.2f} m closes or opens a drift; use a smaller survey.width_sd_m")
    return perturbed


def displace(shape: BaseGeometry, sd_m: float, wave_m: float, rng: np.random.Generator) -> BaseGeometry:
    """Move every place of a plan by a smooth random field; the plan keeps its loops and dead ends.

    Parameters
    ----------
    shape : shapely geometry, m
    sd_m : float
        Standard deviation in each coordinate.
    wave_m : float
        The field's wavelengths are 0.8 to 1.6 times this.
    rng : Generator

    Raises
    ------
    GeometryError
        If the field is so steep that it would fold the plan.
    """
    if sd_m == 0:
        return shape
    length = wave_m * rng.uniform(0.8, 1.6, _WAVES)
    heading, phase = rng.uniform(0, 2 * np.pi, (2, _WAVES))
    size = sd_m * np.sqrt(2.0 / _WAVES) * rng.standard_normal((_WAVES, 2))
    steepest = 2.0 * float(np.sqrt(((2 * np.pi / length[:, None]) ** 2 * size**2 / 2).sum()))
    if steepest > _STEEPEST:
        raise GeometryError(
            f"errors of {sd_m:g} m over waves of {wave_m:g} m would fold the plan: "
            f"the gradient of the errors is {steepest:.2f} (at most {_STEEPEST:g})"
        )

    fine = shapely.segmentize(shape, wave_m / 6)
    return shapely.transform(fine, lambda points: move_by_waves(points, length, heading, phase, size))


def move_by_waves(
    points: np.ndarray, length: np.ndarray, heading: np.ndarray, phase: np.ndarray, size: np.ndarray
) -> np.ndarray:
    """Displace points by a sum of plane waves.

    A point p moves by the sum over k of size_k cos(2 pi / length_k u(heading_k) . p + phase_k). The products and
    sums are written out: BLAS chooses a kernel by the processor, and kernels round a matrix product in different ways
    (ADR 22). Equal points stay equal, so a closed ring stays closed.

    Parameters
    ----------
    points : ndarray (n, 2), m
    length : ndarray (waves,), m
        Wavelengths.
    heading, phase : ndarray (waves,), rad
    size : ndarray (waves, 2), m
        Amplitudes in each coordinate.

    Returns
    -------
    ndarray (n, 2), m
    """
    x, y = points.T
    cosine = np.vectorize(math.cos, otypes=[float])
    offset = np.zeros_like(points)
    for wave_m, direction, start, size_m in zip(length, heading.tolist(), phase, size, strict=True):
        east, north = math.cos(direction) * 2 * math.pi / wave_m, math.sin(direction) * 2 * math.pi / wave_m
        offset += cosine(x * east + y * north + start)[:, None] * size_m
    return points + offset


def _network(shape: BaseGeometry) -> tuple[int, int]:
    """Return the number of components and the number of islands, which equals the number of loops."""
    components = [part for part in shapely.get_parts(shape) if isinstance(part, Polygon)]
    return len(components), sum(len(component.interiors) for component in components)
