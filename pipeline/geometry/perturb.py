"""Random variants of workings, within the errors of a survey."""

from __future__ import annotations

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.errors import GeometryError
from pipeline.geometry.enclosure import as_polygons

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
    along = 2 * np.pi * np.column_stack([np.cos(heading), np.sin(heading)]) / length[:, None]
    size = sd_m * np.sqrt(2.0 / _WAVES) * rng.standard_normal((_WAVES, 2))
    steepest = 2.0 * float(np.sqrt((np.linalg.norm(along, axis=1)[:, None] ** 2 * size**2 / 2).sum()))
    if steepest > _STEEPEST:
        raise GeometryError(
            f"errors of {sd_m:g} m over waves of {wave_m:g} m would fold the plan: "
            f"the gradient of the errors is {steepest:.2f} (at most {_STEEPEST:g})"
        )

    def moved(points: np.ndarray) -> np.ndarray:
        # Equal rows of a matrix product may be rounded differently, but a ring's first and last point must stay equal.
        places, index = np.unique(points, axis=0, return_inverse=True)
        return (places + np.cos(places @ along.T + phase) @ size)[index.ravel()]

    return shapely.transform(shapely.segmentize(shape, wave_m / 6), moved)


def _network(shape: BaseGeometry) -> tuple[int, int]:
    """Return the number of components and the number of islands, which equals the number of loops."""
    components = [part for part in shapely.get_parts(shape) if isinstance(part, Polygon)]
    return len(components), sum(len(component.interiors) for component in components)
