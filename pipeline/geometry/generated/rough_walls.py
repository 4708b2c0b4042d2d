"""Rough walls for generated plans: every wall point is displaced by self-affine noise."""

from __future__ import annotations

import math

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.errors import GeometryError
from pipeline.geometry.generated.perturb import move_by_waves
from pipeline.geometry.outline.enclosure import as_polygons

_WAVES_PER_OCTAVE = 24
_STEPS = 4  # points on the shortest wavelength
_SPECK_M2 = 1.0


def roughen_walls(
    workings: BaseGeometry, rms_m: float, hurst: float, shortest_m: float, longest_m: float, rng: np.random.Generator
) -> MultiPolygon:
    """Displace the walls of a plan by a self-affine field; each octave's amplitude falls as wavelength to `hurst`.

    Parameters
    ----------
    workings : shapely geometry, m
        One connected component.
    rms_m : float
        Standard deviation of the displacement across a wall, over all octaves.
    hurst : float
        Exponent in (0, 1]: 1 is smooth at small scale.
    shortest_m, longest_m : float
        Band of wavelengths.
    rng : Generator

    Returns
    -------
    shapely.MultiPolygon, m
        One valid polygon with the same number of islands.

    Raises
    ------
    GeometryError
        If the displacement closes a drift or an island.
    """
    octaves = max(1, round(math.log2(longest_m / shortest_m)))
    centre_m = [longest_m / 2.0 ** (k + 0.5) for k in range(octaves)]
    share = np.array([math.pow(centre, hurst) for centre in centre_m])
    share *= rms_m / np.sqrt((share**2).sum())
    within = rng.uniform(-0.5, 0.5, (octaves, _WAVES_PER_OCTAVE)).tolist()
    length = np.array([centre * 2.0**u for centre, octave in zip(centre_m, within, strict=True) for u in octave])
    heading, phase = rng.uniform(0, 2 * np.pi, (2, len(length)))
    size = rng.standard_normal((len(length), 2)) * np.repeat(share, _WAVES_PER_OCTAVE)[:, None]
    size *= np.sqrt(2.0 / _WAVES_PER_OCTAVE)
    fine = shapely.segmentize(workings, shortest_m / _STEPS)
    rough = shapely.transform(fine, lambda points: move_by_waves(points, length, heading, phase, size))
    return as_polygons(_whole(rough, workings))


def _whole(rough: BaseGeometry, workings: BaseGeometry) -> Polygon:
    """Return the one valid polygon of a displaced plan, without specks where the field folds a wall."""
    parts = [part for part in shapely.get_parts(shapely.make_valid(rough)) if isinstance(part, Polygon)]
    largest = max(parts, key=lambda part: part.area)
    whole = Polygon(largest.exterior, [ring for ring in largest.interiors if Polygon(ring).area > _SPECK_M2])
    islands = sum(len(part.interiors) for part in shapely.get_parts(workings))
    if len(whole.interiors) != islands or whole.area < 0.9 * workings.area:
        raise GeometryError(
            f"rough walls: {islands} islands and {workings.area:.0f} m2 become {len(whole.interiors)} islands and "
            f"{whole.area:.0f} m2; use a smaller roughness"
        )
    return whole
