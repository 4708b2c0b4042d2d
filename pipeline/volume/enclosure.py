"""What the shell is worth: rock in the free space and free surface without rock behind it, by exact booleans."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from operator import sub

import manifold3d
import numpy as np

from pipeline.volume.rock.cleared import parts_not_cleared
from pipeline.volume.rock.faces import ON_PLANE_M, PartFaces, faces_on_facets
from pipeline.volume.rock.inside import Inside
from pipeline.volume.rock.ragged import PartCorners
from pipeline.volume.rock.shared import shared_m3
from pipeline.volume.rock.tiles import Tile, drawn_tiles
from pipeline.volume.separation import Facets
from pipeline.volume.shell import SLIVER_M2, THIN_M, ShellPart
from pipeline.volume.union import Volume

_BOXES = 4  # in which booleans measure all parts: each takes 0.2 s, and planes have measured the whole
_LEFT_M2 = 1e-6  # of a box, which rounding leaves


@dataclass(frozen=True)
class Enclosure:
    """Volume of parts in the free space (m3), and surface without a part behind it (m2)."""

    intrusion_m3: float
    missing_m2: float
    surface_m2: float
    measured_m2: float
    thinnest_m: float
    thin_m2: float  # behind which the rock is thinner than 2 cm
    full_share: float  # of the surface behind which it is 0.3 m


def measure_enclosure(
    volume: Volume, parts: list[ShellPart], most_boxes: int, rng: np.random.Generator, faces: PartFaces | None = None
) -> Enclosure:
    """Measure the shell against the free space.

    What is free is measured of each part of which planes do not show that no facet reaches into it, or whose middle is
    in the free space. What of a facet has no part behind it is measured in its plane. In some boxes that are drawn,
    `most_boxes` at most, booleans measure both of all parts; the larger area counts. `faces` are those of
    `faces_on_facets`, if they are known.
    """
    normal = volume.normals
    size = np.linalg.norm(normal, axis=1)
    front = np.array([max(part.facets, key=size.__getitem__) for part in parts], int)
    outward = -normal[front] / np.maximum(size[front], 1e-30)[:, None]
    corners = PartCorners.of([part.corners for part in parts])
    missing = float((faces or faces_on_facets(volume, corners)).uncovered_m2(size / 2).sum())
    middles = np.add.reduceat(corners.corners, corners.first[:-1]) / np.diff(corners.first)[:, None]
    inside = Inside(volume)
    doubtful = set(parts_not_cleared(volume, corners, outward).tolist())
    doubtful |= set(np.flatnonzero(inside.distance_m(middles) > 0).tolist())
    by_booleans = 0.0
    for tile in drawn_tiles(volume.solid, min(most_boxes, _BOXES), rng):
        found = _measure_box(tile, volume.solid.original_id(), corners, outward)
        doubtful |= set(found.near)
        by_booleans += found.missing_m2
    facets, bodies = Facets(volume.vertices, volume.faces), [corners[k] for k in sorted(doubtful)]
    depth, area = np.array([part.depth_m for part in parts]), np.array([part.area_m2 for part in parts])
    return Enclosure(
        # Part by part: the union of parts that touch each other once gave 2.5 m3 of rock where there is none.
        float(shared_m3(facets, bodies, inside.are_free).sum()),
        max(missing, by_booleans),
        float(size.sum() / 2),
        float(size.sum() / 2),
        float(depth[area > SLIVER_M2].min()),
        float(area[depth < THIN_M].sum()),
        float(area[depth > 0.299].sum() / area.sum()),
    )


@dataclass(frozen=True)
class _Box:
    """The parts that reach into a box, and the surface in it that none of them covers, m2."""

    near: list[int]
    missing_m2: float


def _measure_box(tile: Tile, source: int, parts: PartCorners, outward: np.ndarray) -> _Box:
    """Subtract all parts from the free space in a box, and measure the area of facets that is left.

    Each part is first moved towards the free space, by as much as it may lie behind the plane of its facet. If all
    parts are subtracted at once, rounding may leave a facet that one of them covers. So if area is left, the parts are
    subtracted one after another as well, and the smaller area counts: a facet without a part is left both times.
    """
    low, high = parts.boxes()
    near = np.flatnonzero(((low < tile.high + ON_PLANE_M) & (high > tile.low - ON_PLANE_M)).all(axis=1)).tolist()
    moved = [manifold3d.Manifold.hull_points(parts[k] + ON_PLANE_M * outward[k]) for k in near]
    left = manifold3d.Manifold.batch_boolean([tile.solid, *moved], manifold3d.OpType.Subtract)
    missing = _area_of(left, source)
    if missing > _LEFT_M2:
        missing = min(missing, _area_of(reduce(sub, moved, tile.solid), source))
    return _Box(near, missing)


def _area_of(solid: manifold3d.Manifold, source: int) -> float:
    """Return the area of a solid's facets that come from one source."""
    mesh = solid.to_mesh64()
    runs = np.diff(np.asarray(mesh.run_index).astype(int)) // 3
    ours = np.repeat(np.asarray(mesh.run_original_id, np.int64) == source, runs)
    a, b, c = np.moveaxis(np.asarray(mesh.vert_properties)[:, :3][np.asarray(mesh.tri_verts, np.int64)[ours]], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
