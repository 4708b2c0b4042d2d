"""What the shell is worth: rock in the free space and free surface without rock behind it, by exact booleans."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np
import open3d

from pipeline.volume.rock.tiles import Tiles
from pipeline.volume.shell import SLIVER_M2, THIN_M, ShellPart
from pipeline.volume.union import Volume

_INTO_FREE_M = 1e-6  # parts move into the free space by this, so that they overlap what they cover


@dataclass(frozen=True)
class Enclosure:
    """Volume of parts in the free space (m3), surface without a part behind it (m2), in the measured tiles."""

    intrusion_m3: float
    missing_m2: float
    surface_m2: float
    measured_m2: float
    thinnest_m: float
    thin_m2: float  # behind which the rock is thinner than 2 cm
    full_share: float  # of the surface behind which it is 0.3 m


def measure_enclosure(volume: Volume, parts: list[ShellPart], most_tiles: int, rng: np.random.Generator) -> Enclosure:
    """Measure the shell against the free space in boxes; in `most_tiles` of them if there are more."""
    tiles, own = Tiles(volume.solid).all(), volume.solid.original_id()
    low = np.array([part.corners.min(axis=0) for part in parts])
    high = np.array([part.corners.max(axis=0) for part in parts])
    normal = volume.normals
    shift = np.array([-_unit(normal[max(part.facets, key=lambda k: float(normal[k] @ normal[k]))]) for part in parts])
    chosen = rng.permutation(len(tiles))[:most_tiles]
    intrusion = missing = measured = 0.0
    for number in chosen:
        box, tile = tiles[number], tiles[number].solid
        near = ((low < box.high + _INTO_FREE_M) & (high > box.low - _INTO_FREE_M)).all(axis=1)
        hulls = [manifold3d.Manifold.hull_points(parts[k].corners) for k in np.flatnonzero(near)]
        # Part by part: the union of parts that touch each other once gave 2.5 m3 of rock where there is none.
        intrusion += sum(abs((hull ^ tile).volume()) for hull in hulls)
        moved = [hull.translate(_INTO_FREE_M * shift[k]) for hull, k in zip(hulls, np.flatnonzero(near), strict=True)]
        open_part = manifold3d.Manifold.batch_boolean([tile, *moved], manifold3d.OpType.Subtract)
        missing += _area_of(open_part, own)
        measured += _area_of(tile, own)
    depth, area = np.array([part.depth_m for part in parts]), np.array([part.area_m2 for part in parts])
    real = area > SLIVER_M2
    return Enclosure(
        intrusion,
        missing,
        float(np.linalg.norm(normal, axis=1).sum() / 2),
        measured,
        float(depth[real].min()),
        float(area[depth < THIN_M].sum()),
        float(area[depth > 0.299].sum() / area.sum()),
    )


def _unit(vector: np.ndarray) -> np.ndarray:
    found: np.ndarray = vector / max(float(np.linalg.norm(vector)), 1e-30)
    return found


def _area_of(solid: manifold3d.Manifold, source: int) -> float:
    """Return the area of a solid's facets that come from one source."""
    mesh = solid.to_mesh64()
    runs = np.diff(np.asarray(mesh.run_index).astype(int)) // 3
    ours = np.repeat(np.asarray(mesh.run_original_id, np.int64) == source, runs)
    a, b, c = np.moveaxis(np.asarray(mesh.vert_properties)[:, :3][np.asarray(mesh.tri_verts, np.int64)[ours]], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


class Inside:
    """Which places are in the free space, and how far they are from rock."""

    def __init__(self, volume: Volume) -> None:
        """Index the facets."""
        self._scene = open3d.t.geometry.RaycastingScene(nthreads=1)
        self._scene.add_triangles(volume.vertices.astype(np.float32), volume.faces.astype(np.uint32))

    def distance_m(self, places: np.ndarray) -> np.ndarray:
        """Return the distance (n,) m from rock, negative in rock; of five parities of rays the most frequent counts."""
        tensor = open3d.core.Tensor(places.astype(np.float32))
        found: np.ndarray = -self._scene.compute_signed_distance(tensor, nthreads=1, nsamples=5).numpy()
        return found
