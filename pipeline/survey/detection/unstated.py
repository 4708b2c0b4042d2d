"""What meshes and scans rarely state, seen in their facets: the unit, and the axis that points up."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from minesurveys.frames import METRES, Unit
from minesurveys.remarks import warn_user
from pipeline.survey.clouds.normals import planes_of
from pipeline.survey.clouds.thinned import ThinnedCloud, spacing_of
from pipeline.survey.clouds.voxels import REACH, cells_at, grown, is_in, keys_of

_POINTS, _FACETS, _ACROSS = 200_000, 20_000, 2000  # spread over the rock, with normals, from which it is looked across
_ALONG = 0.9  # of a normal along an axis
_SIDE_RATIO = 1.5  # of facets across y to those across x and z: 1.9 and more across z in ten random mines with z up
_FIRST, _LAST = 2.5, 500.0  # voxels from a place to the wall that faces it
_USUAL_M, _MIDDLE_M = (1.0, 8.0), 4.0  # across passages
_GUESS, _RULE = "states no unit; read as metres", "its format counts in metres"
IN_METRES = (".e57", ".ptx", ".bt", ".ot")  # ASTM E2807; Leica's programs; OctoMap's resolution
_NAMES: dict[Unit, str] = {"mm": "millimetres", "cm": "centimetres", "in": "inches", "ft": "feet"}


@dataclass(frozen=True)
class SampledFacets:
    """Points (n, 3) m spread over the rock, and of some of them, `rows` (k,), the normals (k, 3) and areas (k,).

    Normals show to either side. Areas are relative. `size_m` (3,) is that of the whole.
    """

    size_m: np.ndarray
    points_m: np.ndarray
    rows: np.ndarray
    normals: np.ndarray
    area: np.ndarray


def facets_of_scan(cloud: ThinnedCloud) -> SampledFacets:
    """Return those of a scan: the planes of points, as large as they reach."""
    some = cloud.some(_spread(len(cloud), _POINTS))
    rows = _spread(len(some), _FACETS)
    planes = planes_of(some, rows)
    return SampledFacets(np.ptp(cloud.points_m, axis=0), some.points_m, rows, planes.normals, planes.reach_m**2)


def facets_of_mesh(vertices: np.ndarray, faces: np.ndarray) -> SampledFacets:
    """Return those of a mesh, at points that are as dense all over it."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    points, face = trimesh.sample.sample_surface(mesh, _POINTS, seed=0)
    rows = _spread(_POINTS, _FACETS)
    normals = np.asarray(mesh.face_normals[face[rows]])
    return SampledFacets(np.ptp(vertices, axis=0), points, rows, normals, np.ones(len(rows)))


def warn_of_guesses(path: Path, facets: SampledFacets, unit: bool, up: bool) -> None:
    """Warn of a file's size if its unit is a guess, and that it seems to stand on its side if z is one.

    Some formats state no unit, as theirs is the metre.
    """
    if unit:
        by_rule = path.suffix.lower() in IN_METRES
        warn_user(size_remark(facets, _RULE if by_rule else _GUESS), of=path.name, option="--unit")
    if up and stands_on_side(facets):
        warn_user(
            "most level surfaces face along its y axis; z is taken as up",
            of=path.name,
            option="--up",
            advice="--up y turns it",
        )


def stands_on_side(facets: SampledFacets) -> bool:
    """Return whether far more of the surface is square to y than to x and z, as it is where y is up.

    Floors and roofs are all square to one axis, walls to all that lie across it.
    """
    x, y, z = ((np.abs(facets.normals) > _ALONG) * facets.area[:, None]).sum(axis=0)
    return bool(y > _SIDE_RATIO * max(x, z))


def size_remark(facets: SampledFacets, why: str = _GUESS) -> str:
    """Return as what a file without a unit is read: its size, and the unit that gives its passages a usual width."""
    size = " x ".join(f"{side:.4g}" for side in facets.size_m)
    across = across_m(facets)
    if across is None:
        return f"{why}, {size} m; --unit states another"
    text = f"{why}, {size} m, its passages {across:.3g} m across"
    least, most = _USUAL_M
    fits = {unit: across * METRES[unit] for unit in _NAMES if least <= across * METRES[unit] <= most}
    if least <= across <= most or not fits:
        return f"{text}; --unit states another"
    unit = min(fits, key=lambda name: abs(np.log(fits[name] / _MIDDLE_M)))
    return f"{text}; in {_NAMES[unit]} they are {fits[unit]:.3g} m across: --unit {unit}"


def across_m(facets: SampledFacets) -> float | None:
    """Return how far it is from half of the places along their normals to the next wall, m; None if there is none."""
    some = _spread(len(facets.rows), _ACROSS)
    from_m, normals = facets.points_m[facets.rows[some]], facets.normals[some]
    middle = facets.points_m.mean(axis=0)
    size = max(spacing_of(facets.points_m), float(np.abs(facets.points_m - middle).max()) / (REACH / 2))
    walls = grown(np.unique(keys_of(cells_at(facets.points_m - middle, size))))
    found = np.full(len(some), np.inf)
    for far in np.arange(_FIRST, _LAST):
        left = np.flatnonzero(np.isinf(found))
        if 2 * len(left) < len(some):  # the median is among those that are found
            break
        ends = from_m[left] - middle + far * size * normals[left] * np.array([[[1]], [[-1]]])
        within = (np.abs(ends) < size * REACH).all(axis=2)
        hit = is_in(keys_of(cells_at(np.where(within[..., None], ends, 0), size).reshape(-1, 3)), walls)
        found[left[(hit.reshape(within.shape) & within).any(axis=0)]] = (far + 1) * size  # walls are thickened by one
    middle_m = float(np.median(found))
    return middle_m if np.isfinite(middle_m) else None


def _spread(count: int, wanted: int) -> np.ndarray:
    """Return about so many rows, spread over `count`."""
    return np.arange(0, count, max(1, count // wanted))
