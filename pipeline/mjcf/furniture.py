"""What hangs in a drift: bolts with plates, pipe, cable, ventilation duct and weld mesh, merged tile by tile."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from minesurveys.remarks import warn_user
from minexplore.bundle import FURNITURE_ABOVE_M, LINES_ABOVE_M, TriangleMesh, chunk_mesh, decode_msh, encode_msh
from pipeline.geometry.polyline import FloorLine
from pipeline.geometry.raycast import RayCaster
from pipeline.mjcf.weld_mesh import hang_weld_mesh
from pipeline.params.fittings import FurnitureParams
from pipeline.store.codecs import Bundle
from pipeline.types import DriftNetwork

HeightsOver = Callable[[np.ndarray], np.ndarray]  # of points (n, 3) m over the floors: (n,) m
LEAST_HEIGHT_M = 2.9  # of workings: a duct under the roof then leaves 2 m below it
_TILE_M = 20.0
_EYE_M = 1.7  # height that bolts are aimed from
_REACH_M = 3.0  # beyond half the drift's width a ray has met no rib but an opening
_TOWARDS_RIB_M = 0.7  # a line hangs at most so far from where the plan's wall is
_OFF_RIB_M = 0.5  # and so far off the rock, to pass its bumps
_STEP_M, _ALIKE_M = 1.0, 2.0  # of lines: distance of their points, and how far a bump of rock pushes them away
_SHORTEST_M = 4.0
_UPRIGHT = 0.9  # height of a direction from which on it is no base for a level one


@dataclass(frozen=True)
class ServiceLine:
    """A tube along a rib or under the roof: side (1 left, -1 right), height, gap to the rock, radius and shape."""

    kind: str
    side: int
    height_m: float
    gap_m: float
    radius_m: float
    sides: int
    sag_m: float


PIPE = ServiceLine("pipe", 1, 2.2, 0.06, 0.055, 6, 0.0)  # compressed air or water, 4 inches
CABLE = ServiceLine("cable", -1, 2.35, 0.05, 0.03, 4, 0.12)
DUCT_RADIUS_M, DUCT_SIDES, DUCT_GAP_M = 0.3, 8, 0.12
HANGERS_M = 3.0  # between the hooks of a cable or a duct


def ways_of(network: DriftNetwork, height_m: float) -> list[FloorLine]:
    """Return the legs of a level mine's network; none in workings too low for furniture, and a line says so."""
    ways: list[FloorLine] = []
    if height_m < LEAST_HEIGHT_M:
        warn_user(
            f"realism.furnish: no furniture, workings of {height_m:g} m are lower than {LEAST_HEIGHT_M:g} m",
            option="realism.furnish",
        )
        return ways
    for leg in network.legs:
        half_m = np.full(len(leg.stations_m), float(np.median(leg.half_width_m)))
        ends = leg.start in network.junctions, leg.end in network.junctions
        ways.append(FloorLine(on_level(leg.stations_m), half_m, half_m, ends))
    return ways


def on_level(line_m: object) -> np.ndarray:
    """Return a line (n, 2) m on the floor z = 0."""
    line = np.array(line_m, np.float64)
    return np.column_stack([line, np.zeros(len(line))])


def over_level(points_m: np.ndarray) -> np.ndarray:
    """Return the heights of points (n, 3) m over the floor z = 0."""
    found: np.ndarray = points_m[:, 2]
    return found


def hang_furniture(
    params: FurnitureParams,
    ways: Sequence[FloorLine],
    main_m: np.ndarray,
    rough: Bundle,
    over_m: HeightsOver = over_level,
    through: Sequence[FloorLine] | None = None,
) -> Bundle:
    """Return the furniture's meshes by name as `.msh`, m, mine frame; nothing of it collides.

    All of it is fixed to the visible rock, and above all robots: bolts above `FURNITURE_ABOVE_M`, all else
    above `LINES_ABOVE_M`. What would be lower is left out.

    Parameters
    ----------
    params : FurnitureParams
    ways : sequence of FloorLine
        Those that are high enough: bolts follow them, weld mesh hangs where they end at junctions.
    main_m : (n, 3) float64, m
        The line on the floor that the duct follows.
    rough : dict of bytes
        The chunks of the visible rock as `.msh`.
    over_m : callable
        The heights of points over the floors.
    through : sequence of FloorLine, optional
        What pipe and cable follow, by default the ways: where these meet at an angle, the ends of two lines are apart.
    """
    if not ways:
        return {}
    placed = [mesh.vertices[mesh.faces] for mesh in map(decode_msh, rough.values())]
    rock = RayCaster(np.concatenate(placed, dtype=np.float64))
    del placed
    parts: list[tuple[str, np.ndarray, np.ndarray]] = []
    for way in ways:
        if way.length_m >= _SHORTEST_M:
            parts += _bolts(params, rock, way)
    for line in ways if through is None else through:
        if line.length_m >= _SHORTEST_M:
            for kind in (PIPE, CABLE):
                parts += _along_rib(kind, rock, line, over_m)
    if params.weld_mesh:
        parts += hang_weld_mesh(params.weld_mesh, ways, rock)
    if params.duct:
        parts += _duct(
            rock, FloorLine(main_m, np.zeros(len(main_m)), np.zeros(len(main_m))), params.duct_side_m, over_m
        )
    return _merged(parts, over_m)


def _bolts(params: FurnitureParams, rock: RayCaster, way: FloorLine) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield rings of bolts, each ring turned by half a bolt against the one before."""
    at = way.places(params.bolt_spacing_m)
    spread = np.radians(np.linspace(-params.bolt_spread_deg, params.bolt_spread_deg, params.bolts))
    stagger = (spread[1] - spread[0]) / 4 if len(spread) > 1 else 0.0
    angle = spread + np.where(np.arange(len(at)) % 2, stagger, -stagger)[:, None]
    rays = np.concatenate([np.sin(angle)[..., None] * at.left[:, None], np.cos(angle)[..., None]], axis=2)
    rays = rays.reshape(-1, 3)
    eyes = np.repeat(at.over(_EYE_M), len(spread), axis=0)
    distance = rock.cast(eyes, rays)
    hit = distance < np.repeat(np.maximum(at.left_m, at.right_m), len(spread)) + _REACH_M
    points, faces = _bolts_at(eyes[hit] + rays[hit] * distance[hit, None], -rays[hit], params.plate_m)
    yield from (("bolts", *bolt) for bolt in zip(points, faces, strict=True))


def _bolts_at(foot: np.ndarray, out: np.ndarray, plate_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return plates, low pyramids, with the bolts' ends, steep ones, as vertices (n, 9, 3) m and faces (n, 7, 3).

    `foot` (n, 3) m is where they stand on the rock, `out` (n, 3) their unit direction.
    """
    across = np.cross(out, np.where(np.abs(out[:, 2:]) < _UPRIGHT, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    along = np.cross(out, across)
    square = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])[None, :, :, None] / 2
    ring = square[:, :, 0] * across[:, None] + square[:, :, 1] * along[:, None]
    base = foot + 0.05 * out
    end = base[:, None] + 0.05 * np.stack([across, along - across, -along], axis=1)
    tips = (base + 0.035 * out)[:, None], (base + 0.14 * out)[:, None]
    points = np.concatenate([base[:, None] + plate_m * ring, tips[0], end, tips[1]], axis=1)
    faces = np.array([[k, (k + 1) % 4, 4] for k in range(4)] + [[5 + k, 5 + (k + 1) % 3, 8] for k in range(3)])
    one, two, three = points[:, faces[0]].transpose(1, 0, 2)
    turned = (np.cross(two - one, three - one) * out).sum(axis=1) < 0  # seen from the rock
    return points, np.where(turned[:, None, None], faces[:, ::-1], faces)


def _along_rib(
    kind: ServiceLine, rock: RayCaster, way: FloorLine, over_m: HeightsOver
) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield tubes along a rib; a tube ends where the rib opens, or the floor beside it rises."""
    at = way.places(_STEP_M)
    outwards = np.column_stack([kind.side * at.left, np.zeros(len(at))])
    origin = at.over(kind.height_m)
    distance = rock.cast(origin, outwards)
    closed = distance < (at.left_m if kind.side > 0 else at.right_m) + _TOWARDS_RIB_M
    lowest = origin[closed] + (distance[closed] - kind.gap_m - kind.radius_m)[:, None] * outwards[closed]
    closed[closed] = over_m(lowest - _up(kind.radius_m + kind.sag_m)) >= LINES_ABOVE_M
    window = 2 * round(_ALIKE_M / _STEP_M) + 1
    for part in _runs(closed, round(_SHORTEST_M / _STEP_M)):
        offset = gaussian_filter1d(minimum_filter1d(distance[part], window), 1.0)
        offset = np.clip(offset, distance[part] - _OFF_RIB_M, distance[part]) - kind.gap_m - kind.radius_m
        middle = origin[part] + offset[:, None] * outwards[part]
        middle[:, 2] -= _sag(len(middle), kind.sag_m)
        yield kind.kind, *_tube(middle, kind.radius_m, kind.sides)


def _duct(
    rock: RayCaster, way: FloorLine, side: float, over_m: HeightsOver
) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield a duct under the roof of the main drift, `side` m left of its middle."""
    at = way.places(_STEP_M)
    floor = at.floor_m + np.column_stack([side * at.left, np.zeros(len(at))])
    roof = _EYE_M + rock.cast(floor + _up(_EYE_M), np.tile([0.0, 0.0, 1.0], (len(floor), 1)))
    sideways = np.column_stack([np.sign(side or 1.0) * at.left, np.zeros(len(at))])
    low = LINES_ABOVE_M + DUCT_RADIUS_M + 0.1
    room = rock.cast(floor + _up(low), sideways) > DUCT_RADIUS_M
    room &= over_m(floor + _up(low - DUCT_RADIUS_M)) >= LINES_ABOVE_M
    lowest = minimum_filter1d(np.where(np.isfinite(roof), roof, 0.0), 5) - DUCT_GAP_M - DUCT_RADIUS_M
    for part in _runs((lowest > low) & room, round(_SHORTEST_M / _STEP_M)):
        hung = np.maximum(gaussian_filter1d(lowest[part], 3.0) - _sag(part.stop - part.start, 0.04), low)
        yield "duct", *_tube(floor[part] + hung[:, None] * _up(1.0), DUCT_RADIUS_M, DUCT_SIDES)


def _up(height_m: float) -> np.ndarray:
    return np.array([0.0, 0.0, height_m])


def _sag(count: int, sag_m: float) -> np.ndarray:
    """Return how much points of a line hang below its hooks."""
    share = np.arange(count) * _STEP_M / HANGERS_M % 1.0
    return 4 * sag_m * share * (1 - share)


def _runs(closed: np.ndarray, least: int) -> list[slice]:
    """Return the runs of true values that have at least so many."""
    edge = np.flatnonzero(np.diff(np.concatenate([[0], closed.astype(int), [0]])))
    return [slice(start, end) for start, end in edge.reshape(-1, 2).tolist() if end - start >= least]


def _tube(middle: np.ndarray, radius_m: float, sides: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a tube along points (n, 3) m as vertices and faces; its ends are open."""
    ahead = np.gradient(middle, axis=0)
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
    across = np.cross(ahead, [0.0, 0.0, 1.0])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    above = np.cross(across, ahead)
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.cos(angle)[:, None] * across[:, None] + np.sin(angle)[:, None] * above[:, None]
    vertices = (middle[:, None] + radius_m * ring).reshape(-1, 3)
    start = sides * np.arange(len(middle) - 1)[:, None]
    k, after = np.arange(sides), (np.arange(sides) + 1) % sides
    quads = np.stack([start + k, start + after, start + sides + after, start + sides + k], axis=-1).reshape(-1, 4)
    return vertices, np.concatenate([quads[:, [0, 2, 1]], quads[:, [0, 3, 2]]])


def _merged(parts: list[tuple[str, np.ndarray, np.ndarray]], over_m: HeightsOver) -> Bundle:
    """Return one mesh for each kind and tile of the plan; pieces of less than four vertices are dropped."""
    corner = np.min([vertices[:, :2].min(axis=0) for _, vertices, _ in parts], axis=0) if parts else np.zeros(2)
    meshes = {}
    for kind in {kind: None for kind, *_ in parts}:
        least = FURNITURE_ABOVE_M if kind == "bolts" else LINES_ABOVE_M
        pieces = [(points, faces) for k, points, faces in parts if k == kind]
        starts = np.cumsum([0, *(len(points) for points, _ in pieces)])[:-1]
        lowest = np.minimum.reduceat(over_m(np.concatenate([points for points, _ in pieces])), starts)
        pieces = [piece for piece, kept in zip(pieces, (lowest >= least).tolist(), strict=True) if kept]
        if not pieces:
            continue
        vertices = np.concatenate([points for points, _ in pieces])
        first = np.cumsum([0, *(len(points) for points, _ in pieces)])[:-1]
        faces = np.concatenate([faces + number for (_, faces), number in zip(pieces, first, strict=True)])
        middle = vertices[faces].mean(axis=1)[:, :2]
        tiles = np.floor((middle - corner) / _TILE_M).astype(int)
        triangles = vertices[faces]
        found, of_face = np.unique(tiles, axis=0, return_inverse=True)
        order = np.argsort(of_face, kind="stable")
        ends = np.cumsum(np.bincount(of_face, minlength=len(found)))[:-1]
        for (col, row), of_tile in zip(found.tolist(), np.split(order, ends), strict=True):
            meshes[chunk_mesh(kind, col, row)] = _joined(triangles[of_tile])
    return {name: encode_msh(mesh) for name, mesh in sorted(meshes.items()) if len(mesh.vertices) >= 4}


def _joined(triangles: np.ndarray) -> TriangleMesh:
    points, index = np.unique(triangles.reshape(-1, 3).round(4), axis=0, return_inverse=True)
    return TriangleMesh(points, index.reshape(-1, 3), np.zeros((0, 2)), np.zeros((0, 3)))
