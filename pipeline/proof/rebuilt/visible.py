"""Whether the visible rock is one closed surface along the collision walls, seen from inside, with nothing between."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from shapely import Polygon

from minexplore.bundle import MESHES, RECORD, SMOOTH_MESHES, WALLS, is_fitting, mesh_file, mesh_of
from minexplore.looks import PLAIN
from pipeline.errors import ArtifactError
from pipeline.geometry.nearest_facets import NearestFacets
from pipeline.mjcf.bundle import WorldRecord
from pipeline.proof.rebuilt.shading import JoinedRock, require_shading
from pipeline.proof.rebuilt.smooth import RemadeSmooth
from pipeline.store.codecs import decode
from pipeline.types import Mesh, Occupancy

HEIGHTS_M = (0.3, 0.5, 1.0, 1.5)  # where visible and collision walls are compared; the roof's arch begins above
_TOE_M = 0.5
_STRETCHED = 3.0  # of an edge's length, that its texture may cover
_TEXTURED_M = 5e-3  # far from the origin a coordinate has millimetres
_ACROSS_M = 1.5  # a face belongs to the tile of its centre before it was displaced
_FOOT_M = 1e-4  # above the floor
_FOOT_AWAY_M = 1.0  # bumps, the floor chamfer, and rounded corners
_FROM_SMOOTH_M = 1.0  # of a rough vertex: bumps of 0.45 m, and the arch against the chamfer of the roof
_FROM_WALL_M = 0.6  # of a slice through the visible walls: bumps, and the floor chamfer below
_KEPT_SHARE, _KEPT_M = 0.3, 0.15  # of a free cell's clearance, that the visible rock leaves, less this
_SAMPLE_M, _FINE_M = 0.1, 0.02
_SAMPLED_M = 0.3  # distance of points on faces that are longer
_LONGEST_M = 10.0  # of an edge; the default world has 2.6 m
_LOW_M = (0.3, 1.5)  # heights at which rock far from its wall must leave free cells clear
_SMALLEST_M = 0.35  # cells with less clearance admit no robot
_VOLUME = (0.7, 1.3)  # of the visible space, as shares of the plan's area times the height


def require_visible(folder: Path, record: WorldRecord, free: Polygon, grid: Occupancy, smooth: RemadeSmooth) -> None:
    """Check the visible surface of a bundle whose smooth surface has been made again.

    Raises
    ------
    ArtifactError
        With the file or place, the value and the limit.
    """
    sizes = smooth.sizes
    names = [mesh_of(name) for name in record.files if name.startswith(MESHES)]
    rough: dict[str, Mesh] = {name: decode(folder / mesh_file(name), Mesh) for name in rough_meshes(names)}
    near, foot_m = NearestFacets.of(smooth.triangles), record.height_m - sizes.roof_chamfer_m
    walls = cKDTree(shapely.get_coordinates(shapely.segmentize(free.boundary, _FINE_M)))
    far, relaxed = [np.zeros((0, 2))], record.look != PLAIN
    for name, chunk in rough.items():
        _require_near(folder / mesh_file(name), chunk, near, sizes.repeat_m, relaxed=relaxed)
        far.append(_require_bounded(folder / mesh_file(name), chunk, walls, foot_m, sizes.repeat_m))
    _require_kept(folder, np.concatenate(far), grid, f"{_LOW_M[0]} to {_LOW_M[1]} m")
    _require_tiles(folder, rough)
    if rough:
        joined = JoinedRock.of(list(rough.values()))
        _require_closed(folder, joined, free, walls, record.height_m)
        require_shading(folder, rough, joined)
    seen = np.concatenate([chunk.vertices[chunk.faces] for chunk in rough.values()]) if rough else smooth.triangles
    for height in HEIGHTS_M:
        if height < record.height_m / 2:
            _require_clear(folder, seen, walls, grid, height)


def rough_meshes(names: Iterable[str]) -> list[str]:
    """Return the names of the chunks of the rough surface among names of meshes."""
    return [name for name in names if name not in SMOOTH_MESHES and not is_fitting(name)]


def _require_tiles(folder: Path, chunks: dict[str, Mesh]) -> None:
    """Check that the column and row in the chunks' names rise from the south-west."""
    spans: dict[tuple[int, int], list[tuple[float, float]]] = {}
    for name, chunk in chunks.items():
        centre = chunk.vertices[chunk.faces].mean(axis=1)
        for axis, number in enumerate(map(int, name.split("_")[-2:])):
            spans.setdefault((axis, number), []).append((centre[:, axis].min(), centre[:, axis].max()))
    ends = {key: (min(low for low, _ in span), max(high for _, high in span)) for key, span in spans.items()}
    for (axis, number), (low, high) in sorted(ends.items()):
        before = [ends[other][1] for other in ends if other[0] == axis and other[1] < number]
        if before and max(before) > low + _ACROSS_M:
            raise ArtifactError(
                f"{folder / RECORD}: visible rock: chunks of {('column', 'row')[axis]} {number} reach from {low:.2f} "
                f"to {high:.2f} m, those before it to {max(before):.2f} m"
            )


def _require_near(path: Path, mesh: Mesh, smooth: NearestFacets, repeat_m: float, relaxed: bool) -> None:
    """Check that all vertices of a mesh are used, lie near the smooth surface, and carry the texture of their piece.

    A `relaxed` texture follows the rock, and so leaves the wall's heights by as much as the rock leaves the wall.
    """
    # Pieces are textured before they are displaced: walls by their height in space, which stays, the roof from above.
    laid = mesh.texcoords * repeat_m
    wall = path.name.startswith(f"{WALLS}_")
    off = np.abs(laid[:, 1] - mesh.vertices[:, 2]) if wall else np.abs(laid - mesh.vertices[:, :2]).max(axis=1)
    most = _TEXTURED_M if wall and not relaxed else _FROM_WALL_M
    if not off.max() <= most:
        worst = int(off.argmax())
        raise ArtifactError(
            f"{path}: vertex {worst} at {mesh.vertices[worst].round(3).tolist()} m has the texture of a place "
            f"{off[worst]:.3f} m away, want at most {most:g} m"
        )
    if len(np.unique(mesh.faces)) != len(mesh.vertices):
        raise ArtifactError(f"{path}: vertices that belong to no face")
    apart = smooth.query(mesh.vertices).distance_m
    worst = int(apart.argmax())
    if not apart[worst] <= _FROM_SMOOTH_M:
        raise ArtifactError(
            f"{path}: vertex {worst} at {mesh.vertices[worst].round(3).tolist()} m is {apart[worst]:.3f} m from the "
            f"smooth surface, want at most {_FROM_SMOOTH_M:g} m"
        )


def _require_bounded(path: Path, mesh: Mesh, walls: cKDTree, foot_m: float, repeat_m: float) -> np.ndarray:
    """Check that walls stand along the outline and the roof above its foot, and that texture fits faces.

    Returns
    -------
    (n, 2) float64, m
        Points of walls that are so far from the outline that they could stand in a free cell's clearance.
    """
    corners = mesh.vertices[mesh.faces]
    side = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    if not side.max() <= _LONGEST_M:
        at = corners.reshape(-1, 3)[int(side.argmax())].round(3).tolist()
        raise ArtifactError(f"{path}: an edge of {side.max():.3f} m at {at} m, want at most {_LONGEST_M:g} m")
    # A long face may cross a drift although its corners are allowed.
    long = mesh.vertices[mesh.faces[side.max(axis=1) > _SAMPLED_M]]
    points = np.concatenate([mesh.vertices, face_samples(long, _SAMPLED_M)])
    if path.name.startswith(f"{WALLS}_"):
        off = walls.query(points[:, :2])[0]
        low = (points[:, 2] >= _LOW_M[0]) & (points[:, 2] <= _LOW_M[1])
        far = points[low & (off > _KEPT_M + (1 - _KEPT_SHARE) * _SMALLEST_M), :2]
        off -= np.maximum(0.0, _TOE_M - points[:, 2])  # the floor chamfer leans inwards
    else:
        far, off = np.zeros((0, 2)), foot_m - points[:, 2]
    if not off.max() <= _FROM_WALL_M:
        at = points[int(off.argmax())].round(3).tolist()
        raise ArtifactError(f"{path}: rock at {at} m is {off.max():.3f} m off, want at most {_FROM_WALL_M:g} m")
    woven = (
        np.linalg.norm(mesh.texcoords[mesh.faces] - np.roll(mesh.texcoords[mesh.faces], 1, axis=1), axis=2) * repeat_m
    )
    stretched = woven - _STRETCHED * side
    if not stretched.max() <= _FROM_WALL_M:
        worst = int(stretched.argmax())
        raise ArtifactError(
            f"{path}: an edge of {side.flat[worst]:.3f} m has {woven.flat[worst]:.3f} m of texture, want at most "
            f"{_STRETCHED * side.flat[worst] + _FROM_WALL_M:.3f} m"
        )
    return far


def face_samples(triangles: np.ndarray, most_m: float) -> np.ndarray:
    """Return the corners of triangles (n, 3, 3) and points on them, (m, 3), no two neighbours farther than `most_m`."""
    longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    steps = np.maximum(1, np.ceil(longest / most_m).astype(int))
    points = [np.zeros((0, 3))]
    for count in np.unique(steps).tolist():
        i, j = np.indices((count + 1, count + 1)).reshape(2, -1)
        inside = i + j <= count
        weights = np.column_stack([i, j, count - i - j])[inside] / count
        points.append(np.einsum("pk,nkd->npd", weights, triangles[steps == count]).reshape(-1, 3))
    return np.concatenate(points)


def _require_closed(
    folder: Path,
    rock: JoinedRock,
    free: Polygon,
    walls: cKDTree,
    height_m: float,
) -> None:
    """Check that the chunks together have no flipped and no double face, and end on the floor alone."""
    corners, faces, places = rock.places, rock.corners, rock.places.astype(np.float64)
    ahead = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    edge = ahead[:, 0] * len(corners) + ahead[:, 1]
    order, back = np.sort(edge), np.sort(ahead[:, 1] * len(corners) + ahead[:, 0])
    double = order[:-1][np.diff(order) == 0]
    if len(double):
        at = corners[int(double[0] // len(corners))]
        raise ArtifactError(f"{folder / RECORD}: visible rock: two faces on one side of an edge at {at.tolist()} m")
    alone = _is_in(edge, order[~_is_in(order, back)])  # sorted numbers are searched for in sorted ones: `isin` is slow
    rim = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])[alone]
    lifted = np.abs(places[rim][:, :, 2]).max(axis=1, initial=0.0) > _FOOT_M
    if lifted.any() or not len(rim):
        at = corners[rim[lifted][0, 0]].tolist() if lifted.any() else None
        raise ArtifactError(f"{folder / RECORD}: visible rock: a hole at {at} m; its only rim is on the floor")
    _require_foot(folder, places[rim][:, :, :2], free, walls)
    del edge, order, back, alone, rim
    links = coo_array((np.ones(len(ahead)), ahead.T.astype(np.int32)), shape=(len(corners), len(corners)))
    pieces, _ = connected_components(links, directed=False)
    del links
    if pieces != 1:
        raise ArtifactError(f"{folder / RECORD}: visible rock: {pieces} separate surfaces, want 1")
    (ax, ay), (bx, by) = ((places[faces[:, k], :2] - places[faces[:, 0], :2]).T for k in (1, 2))
    upward_m2 = (ax * by - ay * bx) / 2  # of each face, seen from above
    share = -float((places[:, 2][faces].mean(axis=1) * upward_m2).sum()) / (free.area * height_m)
    if not _VOLUME[0] <= share <= _VOLUME[1]:
        raise ArtifactError(
            f"{folder / RECORD}: visible rock: encloses {share:.3f} of the workings' volume, want {_VOLUME[0]} to "
            f"{_VOLUME[1]}; a surface inside out encloses less than 0"
        )


def _is_in(numbers: np.ndarray, ordered: np.ndarray) -> np.ndarray:
    """Return which numbers (n,) are among ordered ones (k,)."""
    if not len(ordered):
        return np.zeros(len(numbers), bool)
    at = np.minimum(np.searchsorted(ordered, numbers), len(ordered) - 1)
    return np.asarray(ordered[at] == numbers)


def _require_foot(folder: Path, rim: np.ndarray, free: Polygon, walls: cKDTree) -> None:
    """Check that the rim (k, 2, 2) m on the floor has the rings of the outline."""
    foot = shapely.get_parts(shapely.polygonize(shapely.linestrings(rim)))
    shape = max(foot, key=lambda piece: piece.intersection(free).area, default=Polygon())
    rings = len(foot) == 1 + len(free.interiors) and len(shape.interiors) == len(free.interiors)
    away = walls.query(rim[:, 0])[0]
    if not rings or not away.max() <= _FOOT_AWAY_M:  # the slices find walls that have no foot
        raise ArtifactError(
            f"{folder / RECORD}: visible rock: its foot on the floor is not the outline of the workings"
        )


def _require_clear(folder: Path, triangles: np.ndarray, walls: cKDTree, grid: Occupancy, height_m: float) -> None:
    """Check one height: visible walls near all collision walls, none elsewhere, clearance kept at free cells."""
    seen = slice_points(triangles, height_m)
    away = walls.query(seen)[0] if len(seen) else np.array([np.inf])
    if not away.max() <= _FROM_WALL_M:
        x, y = seen[int(away.argmax())] if len(seen) else (np.nan, np.nan)
        raise ArtifactError(
            f"{folder / RECORD}: visible rock at ({x:.2f}, {y:.2f}) m, {height_m} m above the floor, is "
            f"{away.max():.3f} m from the collision walls, want at most {_FROM_WALL_M:g} m"
        )
    tree = cKDTree(seen)
    bare = tree.query(walls.data)[0]
    if not bare.max() <= _FROM_WALL_M:
        x, y = walls.data[int(bare.argmax())]
        raise ArtifactError(
            f"{folder / RECORD}: no visible rock within {_FROM_WALL_M:g} m of the collision wall at ({x:.2f}, "
            f"{y:.2f}) m, {height_m} m above the floor"
        )
    _require_kept(folder, seen, grid, f"{height_m} m")


def _require_kept(folder: Path, rock: np.ndarray, grid: Occupancy, height: str) -> None:
    """Check that points (n, 2) m of visible rock leave free cells a share of their clearance."""
    if not len(rock):
        return
    row, col = np.nonzero(grid.clearance_m >= _SMALLEST_M)
    places = grid.origin_m + (np.column_stack([col, row]) + 0.5) * grid.cell_m
    kept_m = _KEPT_SHARE * grid.clearance_m[row, col] - _KEPT_M
    away = cKDTree(rock).query(places, distance_upper_bound=max(kept_m.max(initial=0.0), 0.0) + 1e-9)[0]  # inf beyond
    spare = away - kept_m
    if spare.min(initial=0.0) < 0:
        x, y = places[int(spare.argmin())]
        raise ArtifactError(
            f"{folder / RECORD}: visible rock stands in the drift at ({x:.2f}, {y:.2f}) m, {height} above the floor"
        )


def slice_points(triangles: np.ndarray, height_m: float) -> np.ndarray:
    """Return points (n, 2) m along the level slice of triangles (m, 3, 3) m, at most 0.1 m apart."""
    above = triangles[:, :, 2] > height_m
    cut = triangles[above.any(axis=1) & ~above.all(axis=1)]
    ends = []
    for start, end in ((0, 1), (1, 2), (2, 0)):
        a, b = cut[:, start], cut[:, end]
        crosses = (a[:, 2] > height_m) != (b[:, 2] > height_m)
        share = (height_m - a[:, 2]) / np.where(crosses, b[:, 2] - a[:, 2], 1.0)
        ends.append(np.where(crosses[:, None], a[:, :2] + share[:, None] * (b[:, :2] - a[:, :2]), np.nan))
    sides = np.stack(ends, axis=1)  # two of the three are numbers
    order = np.argsort(np.isnan(sides[:, :, 0]), axis=1, kind="stable")
    segment = np.take_along_axis(sides, order[:, :2, None], axis=1)
    length = np.linalg.norm(segment[:, 1] - segment[:, 0], axis=1)
    count = np.maximum(2, np.ceil(length / _SAMPLE_M).astype(int) + 1)
    owner = np.repeat(np.arange(len(segment)), count)
    step = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    share = (step / (count[owner] - 1))[:, None]
    return segment[owner, 0] * (1 - share) + segment[owner, 1] * share
