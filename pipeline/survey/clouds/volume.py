"""The closed volume of free space that a scan's points bound, and what was left out and closed on the way."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np
from scipy.spatial import cKDTree

from minesurveys.errors import InputError
from pipeline.scans.meshes.uncrossed import UncrossedMesh, arrays_of, uncrossed
from pipeline.survey.clouds.facing import turned_alike
from pipeline.survey.clouds.flood import Flood, Walls, largest_flood
from pipeline.survey.clouds.gaps import Gap, fill_gaps, find_gaps, plates_of
from pipeline.survey.clouds.missing import missing_sides
from pipeline.survey.clouds.normals import PointPlanes, SidedPoints, SignedDistance, planes_of, sided, strays_of
from pipeline.survey.clouds.people_and_vehicles import Thing, find_things
from pipeline.survey.clouds.sight import nearest_in_sight, seen_from
from pipeline.survey.clouds.surface import BlockSurface
from pipeline.survey.clouds.thinned import ThinnedCloud, spacing_of
from pipeline.survey.clouds.voxels import cells_at, grown, keys_of
from pipeline.survey.solids.closing import close_pieces
from pipeline.survey.solids.decimate import decimated
from pipeline.survey.solids.free_space import union_of
from pipeline.survey.solids.pieces import joined_by_edges

_WELD_M = 1e-6
_FLAW_VOXELS = 10  # wide is a hole that marching cubes may leave where four surfaces meet in an edge
_BARE_M = 0.3  # from a part of the surface to the next point, or twice the points' spacing: nobody saw it
_LEAST_M3 = 5.0  # of the free space of a scan
_FILL_VOXELS = 3  # the flood ends two voxels behind the plane of a hole at most
_ROOM = 2  # voxels between what a flood reaches and the points: walls are thickened by one
_BESIDE_M = 0.5  # from what a scanner saw: shadows and niches; what lies farther behind a hole may be a reflection
_SEED = 0
_RAYS = 20_000  # of the scanner, that the world is judged by
NOWHERE = np.zeros((0, 3))


@dataclass(frozen=True)
class ScannedVolume:
    """The surface of a scan's free space, whose normals point out of it and whose triangles do not cross: `apart`.

    Four fifths of it moved by `moved_m` at most when it was simplified. `bounding` are the points of it, `things` what
    stood free and was left out with its points `thing_points_m`, `thin_points_m` points with free space on both sides,
    such as ropes, `beyond_m` points with none, which bound nothing, 30 cm and more behind the surface, `gaps` where
    nobody saw the surface, and `others_m3` the sizes of other free spaces that the points bound. `rays_m` (k, 2, 3) are
    places of the scanner and points that it saw from there: a sample of those of walls, and with times of those behind
    walls too. `unseen` points of that sample no place sees. `missing` are sides most of which nobody saw, in words,
    `strays` is how many voxels with points stood apart in the air and were left out.
    """

    apart: UncrossedMesh
    moved_m: float
    bounding: ThinnedCloud
    spacing_m: float
    things: list[Thing]
    thing_points_m: np.ndarray
    thin_points_m: np.ndarray
    beyond_m: np.ndarray
    gaps: list[Gap]
    others_m3: list[float]
    rays_m: np.ndarray
    unseen: int
    missing: list[str]
    strays: int

    @property
    def vertices(self) -> np.ndarray:
        """Return the vertices (n, 3) m."""
        return self.apart.vertices

    @property
    def faces(self) -> np.ndarray:
        """Return the triangles (m, 3)."""
        return self.apart.faces


def volume_of_cloud(
    cloud: ThinnedCloud,
    voxel_m: float,
    tolerance_m: float,
    most_facets: int,
    way_m: np.ndarray = NOWHERE,
    seen_from_m: np.ndarray = NOWHERE,
) -> ScannedVolume:
    """Return the free space of a scan.

    Parameters
    ----------
    cloud : ThinnedCloud
    voxel_m : float
        Of the free space, at least the spacing of the points.
    tolerance_m : float
        Of ten points of the surface eight move by less when it is simplified.
    most_facets : int
        Of the simplified surface.
    way_m : (n, 3) float64, m
        Places of the scanner. The space that it saw from them is built; without places, the largest space.
    seen_from_m : (len(cloud), 3) float64, m
        Place of the scanner that saw each point, NaN where it is not known; (0, 3): of none.

    Raises
    ------
    InputError
        If the points enclose no space. The message names the side without points: roof, floor or wall.
    """
    strays = strays_of(cloud)
    cloud, seen_from_m = _without(cloud, strays, seen_from_m)
    planes = planes_of(cloud)
    free, walls, others = _flooded(cloud, planes, voxel_m, way_m)
    sides = sided(cloud, planes, free.free, voxel_m)
    things, rows = find_things(cloud, planes, sides, free.free, voxel_m)
    standing = cloud.points_m[rows]
    if len(rows):
        seen_from_m = _without(cloud, rows, seen_from_m)[1]
        cloud, planes = planes.without(cloud, rows)
        walls = _walls(cloud, planes, voxel_m)
        free = _seen(walls, way_m) if len(way_m) else walls.flood_again(free.free)
        sides = sided(cloud, planes, free.free, voxel_m)
    enclosed_m3 = len(free.free) * voxel_m**3
    missing = missing_sides(cloud.points_m, planes.normals, voxel_m)
    if enclosed_m3 < _LEAST_M3 or not len(sides.rows):
        if missing:
            raise InputError(f"its points bound no space of {_LEAST_M3:g} m3: {'; '.join(missing)}")
        raise InputError(
            f"its points enclose {enclosed_m3:.1f} m3, at least {_LEAST_M3:g} m3 are needed; --voxel M "
            f"(now {voxel_m:g}) bridges gaps of M metres, and closes passages narrower than ten times that"
        )
    bounding = cloud.some(sides.rows)
    beyond = np.setdiff1d(grown(free.ends, _ROOM), walls.thick)  # the mouth of a drift is not carried on
    band = np.setdiff1d(grown(free.free, _ROOM + 1), beyond)
    signed = SignedDistance(bounding.points_m, sides.normals, bounding.count, voxel_m / 2)
    surface, spacing = BlockSurface(free.free, band, voxel_m, signed), spacing_of(bounding.points_m)
    far_m, most_m = max(_BARE_M, 2 * spacing), _FILL_VOXELS * voxel_m
    vertices, faces = _largest(*surface.mesh(), voxel_m)
    gaps = find_gaps(vertices, faces, cloud.points_m, far_m)
    surface.close([plate for _, plate in plates_of(vertices, gaps, bounding.points_m, sides.normals, most_m)])
    vertices, faces = _largest(*surface.mesh(), voxel_m)
    gaps = find_gaps(vertices, faces, cloud.points_m, far_m)
    vertices = fill_gaps(vertices, faces, plates_of(vertices, gaps, bounding.points_m, sides.normals, most_m))
    behind = cloud.points_m[sides.beyond]  # noise at the walls themselves is not worth a remark
    far = cKDTree(vertices).query(behind)[0]
    vertices, faces, moved_m = decimated(vertices, faces, tolerance_m, most_facets)
    apart = uncrossed(vertices, faces)
    return ScannedVolume(
        apart,
        moved_m,
        bounding,
        spacing,
        things,
        standing,
        cloud.points_m[sides.thin],
        behind[far > far_m],
        gaps,
        [round(len(other.free) * voxel_m**3, 1) for other in others],
        *_rays(cloud, sides, seen_from_m, way_m, walls),
        missing,
        len(strays),
    )


def _without(cloud: ThinnedCloud, rows: np.ndarray, seen_from_m: np.ndarray) -> tuple[ThinnedCloud, np.ndarray]:
    """Return a cloud without some points, and from where the others were seen, where that is known."""
    left = np.setdiff1d(np.arange(len(cloud)), rows)
    return cloud.some(left), seen_from_m[left] if len(seen_from_m) else seen_from_m


def _rays(
    cloud: ThinnedCloud, sides: SidedPoints, seen_from_m: np.ndarray, way_m: np.ndarray, walls: Walls
) -> tuple[np.ndarray, int]:
    """Return places of the scanner with points that it saw from there, (k, 2, 3) m, and how many points none sees."""
    if not len(way_m):
        return np.zeros((0, 2, 3)), 0
    rng = np.random.default_rng(_SEED)
    if len(seen_from_m):
        rows = rng.permutation(np.concatenate([sides.rows, sides.beyond]))[:_RAYS]
        ends, starts = cloud.points_m[rows], seen_from_m[rows]
    else:
        some = rng.permutation(len(sides.rows))[:_RAYS]
        ends = cloud.points_m[sides.rows[some]]
        starts = nearest_in_sight(ends, sides.normals[some], way_m, walls)
    rays = np.stack([starts, ends], axis=1)
    known = np.isfinite(starts).all(axis=1)
    return rays[known], int((~known).sum())


def _occupied(cloud: ThinnedCloud, voxel_m: float) -> np.ndarray:
    return np.unique(keys_of(cells_at(cloud.points_m, voxel_m)))


def _walls(cloud: ThinnedCloud, planes: PointPlanes, voxel_m: float) -> Walls:
    occupied = _occupied(cloud, voxel_m)
    return Walls(occupied, voxel_m, turned_alike(cloud.points_m, planes.normals, grown(occupied), voxel_m))


def _flooded(
    cloud: ThinnedCloud, planes: PointPlanes, voxel_m: float, way_m: np.ndarray
) -> tuple[Flood, Walls, list[Flood]]:
    walls = _walls(cloud, planes, voxel_m)
    if len(way_m):
        return _seen(walls, way_m), walls, []
    free, others = largest_flood(walls, _occupied(cloud, voxel_m), np.random.default_rng(_SEED))
    return free, walls, others


def _seen(walls: Walls, way_m: np.ndarray) -> Flood:
    """Return the space on a scanner's rays, and what is enclosed beside it: niches and shadows."""
    seen = seen_from(way_m, walls)
    return walls.flood(seen, grown(seen, max(1, round(_BESIDE_M / walls.size_m))))


def _largest(vertices: np.ndarray, faces: np.ndarray, voxel_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a surface, closed, without pieces that it encloses or that lie apart."""
    out = np.ascontiguousarray(faces[:, ::-1], np.uint64)  # marching cubes turn them inwards
    whole = manifold3d.Manifold(manifold3d.Mesh64(np.asarray(vertices, np.float64), out))
    if whole.status() != manifold3d.Error.NoError or whole.volume() <= 0:
        whole = union_of(close_pieces(vertices, faces, _WELD_M, _FLAW_VOXELS * voxel_m).solids)
    vertices, faces = arrays_of(whole)  # its library parts a noisy scan, of thousands of pieces, in minutes
    part, (a, b, c) = joined_by_edges(faces, len(vertices)), np.moveaxis(vertices[faces], 1, 0)
    own = faces[part == np.bincount(part, np.einsum("ij,ij->i", a, np.cross(b, c))).argmax()]
    used, number = np.unique(own, return_inverse=True)
    return vertices[used], number.reshape(-1, 3)
