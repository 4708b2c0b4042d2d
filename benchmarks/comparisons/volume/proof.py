"""What the shell is worth: rock in the free space and free surface without rock behind it, by exact booleans."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np
import open3d

from benchmarks.comparisons.volume.floors import drop, leg_floor_samples
from benchmarks.comparisons.volume.network import SurveyNetwork
from benchmarks.comparisons.volume.shell import ShellPart, Tiles
from benchmarks.comparisons.volume.volume import STEEPEST, Label, Volume

_INTO_FREE_M = 1e-6  # parts move into the free space by this, so that they overlap what they cover
_THIN_M = 0.0199  # what a body may sink in, 2 cm, less the rounding of parts that are as thick
_SLIVER_M2 = 1e-6  # behind a smaller facet the rock may be as thin as it is
_SAMPLE_M = 0.25
_STEP_REACH_M = 0.05  # beyond the edge of a floor's facet, where the next floor is looked for
_STEP_MOST_M = 0.5  # a ledge that is higher is a wall
_NEAR_M = 5.0


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
    tiles, own = Tiles(volume.solid), volume.solid.original_id()
    low = np.array([part.corners.min(axis=0) for part in parts])
    high = np.array([part.corners.max(axis=0) for part in parts])
    normal = volume.normals
    shift = np.array([-_unit(normal[max(part.facets, key=lambda k: float(normal[k] @ normal[k]))]) for part in parts])
    chosen = rng.permutation(len(tiles.solids))[:most_tiles]
    intrusion = missing = measured = 0.0
    for number in chosen:
        tile = tiles.solids[number]
        near = ((low < tiles.high[number] + _INTO_FREE_M) & (high > tiles.low[number] - _INTO_FREE_M)).all(axis=1)
        hulls = [manifold3d.Manifold.hull_points(parts[k].corners) for k in np.flatnonzero(near)]
        # Part by part: the union of parts that touch each other once gave 2.5 m3 of rock where there is none.
        intrusion += sum(abs((hull ^ tile).volume()) for hull in hulls)
        moved = [hull.translate(_INTO_FREE_M * shift[k]) for hull, k in zip(hulls, np.flatnonzero(near), strict=True)]
        open_part = manifold3d.Manifold.batch_boolean([tile, *moved], manifold3d.OpType.Subtract)
        missing += _area_of(open_part, own)
        measured += _area_of(tile, own)
    depth, area = np.array([part.depth_m for part in parts]), np.array([part.area_m2 for part in parts])
    real = area > _SLIVER_M2
    return Enclosure(
        intrusion,
        missing,
        float(np.linalg.norm(normal, axis=1).sum() / 2),
        measured,
        float(depth[real].min()),
        float(area[depth < _THIN_M].sum()),
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


@dataclass(frozen=True)
class FloorFigures:
    """How the floor follows the survey, m: largest and median error; largest step where legs meet, and elsewhere."""

    error_m: float
    median_m: float
    over_1cm: float  # share of the samples on the floor that are farther from it than 1 cm
    over_floor: float  # share of the legs' samples that have floor under them, the others are over other passages
    step_m: float
    other_step_m: float
    steep_share: float  # of the floor's area over 20 deg
    share_built: float  # of all the surveyed length


def measure_floor(volume: Volume, network: SurveyNetwork) -> FloorFigures:
    """Measure the floor along the drivable legs, and the steps beside its facets."""
    shots = np.flatnonzero(network.grades <= STEEPEST)
    places, _ = leg_floor_samples(network, shots, _SAMPLE_M)
    hit, height = drop(volume.vertices, volume.faces, places + np.array([0, 0, 0.1]))
    on_floor = (hit >= 0) & (volume.label[hit] == Label.FLOOR) & (np.abs(height - places[:, 2]) < _STEP_MOST_M)
    error = np.abs(height - places[:, 2])[on_floor]
    step, other = _steps(volume, network)
    normal = volume.normals[volume.label == Label.FLOOR]
    area = np.linalg.norm(normal, axis=1)
    steep = area[-normal[:, 2] < np.cos(np.radians(20)) * area].sum() / area.sum()
    everything, owner = leg_floor_samples(network, np.arange(len(network.shots)), _SAMPLE_M)
    above = np.minimum(0.1, network.lrud_m[:, :, 2:].sum(axis=2).min(axis=1) / 2)[owner]
    inside = Inside(volume).distance_m(everything + above[:, None] * [0, 0, 1.0]) > -1e-3
    weight = network.lengths_m[owner] / np.bincount(owner)[owner]
    return FloorFigures(
        float(error.max()),
        float(np.median(error)),
        float((error > 0.01).mean()),
        float(on_floor.mean()),
        step,
        other,
        float(steep),
        float(weight[inside].sum() / weight.sum()),
    )


def _steps(volume: Volume, network: SurveyNetwork) -> tuple[float, float]:
    """Return the largest steps, m, from a floor's facet down or up to another floor 5 cm beyond its edge.

    First where the two belong to legs that are within 5 m of each other along the survey, then elsewhere. The slope of
    both facets is taken out.
    """
    floor = volume.label == Label.FLOOR
    beside = {(f[i], f[(i + 1) % 3]): k for k, f in enumerate(volume.faces.tolist()) for i in range(3)}
    edges = np.array(
        [(a, b, k) for (a, b), k in beside.items() if floor[k] and not floor[beside.get((b, a), k)]]
    ).reshape(-1, 3)
    a, b = volume.vertices[edges[:, 0]], volume.vertices[edges[:, 1]]
    along = (b - a)[:, :2]
    length = np.linalg.norm(along, axis=1)
    keep = length > 0.02
    edges, a, b, along, length = (x[keep] for x in (edges, a, b, along, length))
    middle, third = (a + b) / 2, volume.vertices[volume.faces[edges[:, 2]]].mean(axis=1)
    out = np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None]
    out *= np.sign(np.sum(out * (middle - third)[:, :2], axis=1))[:, None]
    beyond = middle + np.column_stack([out * _STEP_REACH_M, np.full(len(out), _STEP_MOST_M)])
    hit, height = drop(volume.vertices, volume.faces, beyond)
    normal = volume.normals[edges[:, 2]]
    continued = middle[:, 2] - np.sum(normal[:, :2] * out, axis=1) / np.minimum(normal[:, 2], -1e-12) * _STEP_REACH_M
    step = np.abs(height - continued)
    inside = Inside(volume).distance_m(middle + np.column_stack([out * _STEP_REACH_M, np.full(len(out), 0.3)])) > 0
    good = (hit >= 0) & floor[hit] & (step < _STEP_MOST_M) & inside
    near = network.near_pairs(_NEAR_M)
    shot = np.array([piece.shot for piece in volume.pieces])[volume.source]
    pairs = zip(shot[edges[good, 2]].tolist(), shot[hit[good]].tolist(), strict=True)
    meets = np.array([i == j or j in near[i] for i, j in pairs], bool)
    return float(step[good][meets].max(initial=0.0)), float(step[good][~meets].max(initial=0.0))
