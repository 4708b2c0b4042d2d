"""The shape of rock walls: slopes of faces, length of a level cut, spectrum along the wall, area in flat faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.geometry.polyline import arc_length
from pipeline.metrics.digits import repeatable
from pipeline.metrics.rock.profile import arc_windows, line_roughness, project_on_rings, tapered
from pipeline.metrics.rock.roughness import CUT_HEIGHTS_M

OCTAVES_M = ((0.2, 0.5), (0.5, 1.0), (1.0, 2.0))
LINE_WINDOWS_M = (0.5, 1.0, 2.0, 3.0)
_STEP_M, _WINDOW_M = 0.025, 8.0
_LEAST_RUN_M = 3.0
STEEP_DEG = (20, 40)  # between the two humps of the default rock: faces along the wall, and the sides of blocks
BANDS_M = ((0.0, 0.5), (0.5, 1.5), (1.5, None))  # of height: the foot leans, the robot's scanner sees the middle
_FLAT_DEG, _FLAT_M2 = 12.0, 0.05
_FINEST = 0.05  # of sides of faces: flat rock has fewer points than the mesh that it was made of
_JOIN = 1e4  # corners are one vertex if they agree to 0.1 mm


@dataclass(frozen=True)
class Relief:
    """Shares of steep wall area, all together and by band of height, the share in flat faces, and cuts by height.

    `steep_share` maps `above_20_deg` and `above_40_deg` to the share of the area whose angle to the plan's wall is
    larger. A median of angles would say less: they gather below 15 and above 55 deg, and the median lies between.
    `spacing_m` is the distance of points where the walls are finest: one side of a face in twenty is shorter.
    """

    steep_share: dict[str, float]
    steep_share_by_height: dict[str, dict[str, float]]
    flat_face_share: float
    spacing_m: float
    cut: dict[str, Cut]


@dataclass(frozen=True)
class Cut:
    """A level cut through the walls.

    `length_ratio` is its length over that of the plan's wall. `slope` is the slope of the power spectrum of the
    distance to the plan's wall, by octave of wavelength; `line_rq_m` the median RMS residual to a line, by window.
    """

    length_ratio: float
    slope: dict[str, float]
    line_rq_m: dict[str, float]


def measure_relief(
    walls: np.ndarray,
    sample: np.ndarray,
    free: Polygon | MultiPolygon,
    plumb: tuple[np.ndarray, np.ndarray] | None = None,
) -> Relief:
    """Measure the walls, faces (n, 3, 3) m in the mine frame; flat faces are grown in a `sample` (k, 3, 3) of rock.

    The plan's walls are the boundary of the free space. Where not all walls are plumb without relief, `plumb` are faces
    (m, 3, 3) m of those that are, and unit normals (m, 3) of the walls without relief.
    """
    cuts = {_cm("at", z): cut_walls(walls, free, z) for z in CUT_HEIGHTS_M}
    faces = walls if plumb is None else plumb[0]
    angle, area = face_angles_deg(walls, free.boundary) if plumb is None else angles_to_deg(*plumb)
    bands = {name: _steep_share(angle[band], area[band]) for name, band in _bands(faces).items() if band.any()}
    share = _steep_share(angle, area) if len(area) else {}
    return repeatable(Relief(share, bands, flat_face_share(sample), _spacing_m(walls), cuts))


def _spacing_m(faces: np.ndarray) -> float:
    return float(np.quantile(np.linalg.norm(faces - np.roll(faces, 1, axis=1), axis=2), _FINEST))


def face_angles_deg(walls: np.ndarray, lines: BaseGeometry) -> tuple[np.ndarray, np.ndarray]:
    """Return the angles (n,) deg between faces (n, 3, 3) m and the nearest of the plan's walls, and areas (n,) m2."""
    normal = np.cross(walls[:, 1] - walls[:, 0], walls[:, 2] - walls[:, 0])
    area = np.linalg.norm(normal, axis=1)
    # Rounded: the sides of a corner tie, and the last digit, which differs between processors, would choose.
    middle = walls.mean(axis=1)[:, :2].round(6)
    sides = np.concatenate([_sides(line) for line in shapely.get_parts(lines)])
    nearest = shapely.STRtree(shapely.linestrings(sides)).nearest(shapely.points(middle))
    along = sides[nearest, 1] - sides[nearest, 0]
    across = np.abs(normal[:, 0] * along[:, 1] - normal[:, 1] * along[:, 0])
    cosine = across / np.maximum(area * np.linalg.norm(along, axis=1), 1e-30)
    return np.degrees(np.arccos(np.clip(cosine, 0, 1))), area / 2


def angles_to_deg(faces: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the angles (n,) deg between faces (n, 3, 3) m and planes of unit normals (n, 3), and areas (n,) m2."""
    own = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    area = np.linalg.norm(own, axis=1)
    cosine = np.abs((own * normals).sum(axis=1)) / np.maximum(area, 1e-30)
    return np.degrees(np.arccos(np.clip(cosine, 0, 1))), area / 2


def _steep_share(angle: np.ndarray, area: np.ndarray) -> dict[str, float]:
    return {f"above_{least}_deg": float(area[angle > least].sum() / area.sum()) for least in STEEP_DEG}


def _bands(walls: np.ndarray) -> dict[str, np.ndarray]:
    """Return which faces (n,) have their middle in each band of height."""
    height = walls.mean(axis=1)[:, 2]
    return {
        _cm("from", low) + ("_up" if high is None else _cm("_to", high)): (height >= low) & (height < (high or np.inf))
        for low, high in BANDS_M
    }


def _sides(line: shapely.LineString) -> np.ndarray:
    xy = shapely.get_coordinates(line)
    return np.stack([xy[:-1], xy[1:]], axis=1)


def cut_walls(walls: np.ndarray, free: Polygon, height_m: float) -> Cut:
    """Cut the walls, faces (n, 3, 3) m, at a height above the floor, and measure the cut against the plan's walls."""
    lines = free.boundary
    import trimesh  # takes half a second to load, and light worlds do without

    mesh = trimesh.Trimesh(walls.reshape(-1, 3), np.arange(3 * len(walls)).reshape(-1, 3), process=False)
    segments = trimesh.intersections.mesh_plane(mesh, [0, 0, 1], [0, 0, height_m])[:, :, :2]
    length = float(np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum())
    joined = shapely.line_merge(shapely.multilinestrings(shapely.linestrings(np.round(segments, 4))))
    long = [line for line in shapely.get_parts(joined) if line.length >= _LEAST_RUN_M]
    runs = [_evenly_spaced(shapely.get_coordinates(line)) for line in long]
    return Cut(
        length / lines.length,
        _octave_slopes(runs, free, lines),
        {_cm("at", w): float(np.median(r)) for w in LINE_WINDOWS_M if len(r := line_roughness(runs, w))},
    )


def _evenly_spaced(line: np.ndarray) -> np.ndarray:
    """Return points (k, 2) m at even distances along a line (n, 2) m."""
    along = arc_length(line)
    at = np.arange(0, along[-1], _STEP_M)
    return np.column_stack([np.interp(at, along, line[:, k]) for k in (0, 1)])


def _octave_slopes(runs: list[np.ndarray], free: Polygon, lines: BaseGeometry) -> dict[str, float]:
    """Return the slope of the mean spectrum in each octave, by least squares in the logarithms."""
    rings = list(shapely.get_parts(lines))
    total = np.zeros(round(_WINDOW_M / _STEP_M) // 2 + 1)
    for run in runs:
        ring, along, offset = project_on_rings(rings, run)
        offset = np.where(shapely.contains_xy(free, run[:, 0], run[:, 1]), offset, -offset)
        for k in np.unique(ring):
            for part in arc_windows(along[ring == k], offset[ring == k], _STEP_M, _WINDOW_M):
                total += np.abs(np.fft.rfft(tapered(part))) ** 2
    frequency = np.fft.rfftfreq(round(_WINDOW_M / _STEP_M), _STEP_M)
    slopes = {}
    for shortest, longest in OCTAVES_M:
        inside = (frequency >= 1 / longest) & (frequency <= 1 / shortest)
        if total[inside].all():
            fit = np.polyfit(np.log(frequency[inside]), np.log(total[inside]), 1)
            slopes[_cm("from", shortest) + _cm("_to", longest)] = float(fit[0])
    return slopes


def _cm(word: str, length_m: float) -> str:
    return f"{word}_{100 * length_m:.0f}_cm"


def flat_face_share(triangles: np.ndarray) -> float:
    """Return the share of the area (n, 3, 3) m that lies in flat faces of 0.05 m2 and more.

    Faces grow from the largest triangle over neighbours whose normals are within 12 deg of the face's mean normal.
    """
    units = np.ascontiguousarray(np.rint(triangles.reshape(-1, 3) * _JOIN).astype(np.int64))
    _, faces = np.unique(units.view([("", np.int64)] * 3).ravel(), return_inverse=True)
    vector = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2
    area = np.linalg.norm(vector, axis=1)
    normal = (vector / np.maximum(area, 1e-30)[:, None]).tolist()
    beside = _neighbours(faces.reshape(-1, 3))
    face = np.full(len(area), -1)
    flat, least = 0.0, np.cos(np.radians(_FLAT_DEG))
    for seed in np.argsort(-area, kind="stable").tolist():
        if face[seed] < 0:
            grown = _grow(seed, face, normal, vector, beside, least)
            flat += grown if grown >= _FLAT_M2 else 0.0
    return flat / max(float(area.sum()), 1e-30)


def _neighbours(faces: np.ndarray) -> list[list[int]]:
    """Return the faces that share an edge with each face (m, 3)."""
    beside: list[list[int]] = [[] for _ in faces]
    import trimesh

    for one, two in trimesh.graph.face_adjacency(faces).tolist():
        beside[one].append(two)
        beside[two].append(one)
    return beside


def _grow(
    seed: int, face: np.ndarray, normal: list, vector: np.ndarray, beside: list[list[int]], least: float
) -> float:
    """Mark the triangles of a flat face from its first one, and return the face's area, m2."""
    total = vector[seed].copy()
    size = float(np.linalg.norm(total))
    mean = (total / max(size, 1e-30)).tolist()
    face[seed], border = seed, [seed]
    while border:
        for other in beside[border.pop()]:
            n = normal[other]
            if face[other] < 0 and n[0] * mean[0] + n[1] * mean[1] + n[2] * mean[2] >= least:
                face[other] = seed
                total += vector[other]
                size += float(np.linalg.norm(vector[other]))
                mean = (total / np.linalg.norm(total)).tolist()
                border.append(other)
    return size
