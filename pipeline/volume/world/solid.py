"""The volume of a survey that is a solid: its labelled mesh, and the legs along its floors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely
from scipy.ndimage import minimum_filter1d
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from shapely import Polygon

from minexplore.floors.volume_arrays import FacetLabel, FloorSpans, VolumeFacets
from pipeline.errors import GeometryError
from pipeline.geometry.network.skeleton import trace_network
from pipeline.scans.meshes.uncrossed import arrays_of, manifold_of
from pipeline.types import ClosedMesh, DriftNetwork, SurveyedLegs, text_array
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.union import Volume
from pipeline.volume.world.reach import RobotSize, components_of, neighbours_of

_SPACING_M = 1.0  # of stations along a leg
_SHORTEST_M = 1.0  # of a leg with a dead end
_SHAFT_M = 2.0  # along a leg: what is so high for less is a shaft over a station, not its passage
_JOIN_M = 0.02  # cells that touch in a corner are joined by so much
_LEAST_M2 = 1.0  # of a floor with a leg of its own
_SIGHT_M = 1.0  # of a station over the floor, at most half-way to the roof


def labels_of(vertices: np.ndarray, faces: np.ndarray, steepest: float) -> np.ndarray:
    """Return the label (f,) of each facet: floors are no steeper than a rise over run."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normal = np.cross(b - a, c - a)
    size = np.maximum(np.linalg.norm(normal, axis=1), 1e-30)
    floor = np.hypot(normal[:, 0], normal[:, 1]) <= -normal[:, 2] * steepest
    return np.where(
        floor, FacetLabel.FLOOR, np.where(normal[:, 2] > np.sqrt(0.5) * size, FacetLabel.ROOF, FacetLabel.WALL)
    )


def volume_of_solid(mesh: ClosedMesh, steepest: float) -> Volume:
    """Return a solid as the shell and the measures take it; all facets are of one piece.

    Raises
    ------
    GeometryError
        If its mesh is not closed.
    """
    solid = manifold_of(mesh.vertices, mesh.faces)
    if solid.is_empty():
        raise GeometryError(f"compile3d: the solid's mesh encloses no space ({solid.status().name})")
    vertices, faces = arrays_of(solid.as_original())
    return Volume(vertices, faces, np.zeros(len(faces), np.int64), labels_of(vertices, faces, steepest), [])


def legs_on_floors(cells: FloorSpans, robot: RobotSize, datum_m: float) -> SurveyedLegs:
    """Return legs along the middles of all floors of 1 m2 and more; their length is not known yet (0).

    Each storey's floor is thinned in plan; stations are a metre apart. Storeys that meet are joined by a leg between
    their nearest stations.

    Parameters
    ----------
    cells : FloorSpans
    robot : RobotSize
        That the cells are of.
    datum_m : float
        Elevation of height 0.

    Raises
    ------
    GeometryError
        If no floor is so large. The message names the floors' areas, and what overrules the robot's limits.
    """
    pairs = neighbours_of(cells, robot)
    places, walls, names, first, storey_of = [], [], [], [0], []
    for storey in range(int(cells.storey.max(initial=-1)) + 1):
        own = np.flatnonzero(cells.storey == storey)
        tree = cKDTree(cells.places_m[own, :2])
        for number, network in enumerate(_networks(cells, own)):
            for leg in network.legs:
                plan = np.array(leg.stations_m)
                span = own[tree.query(plan)[1]]
                places.append(np.column_stack([plan, cells.floor_m[span]]))
                headroom = minimum_filter1d(
                    cells.headroom_m[span], 1 + 2 * round(_SHAFT_M / _SPACING_M), mode="nearest"
                )
                walls.append(np.column_stack([leg.half_width_m, leg.half_width_m, headroom]))
                inner = [f"{leg.name}.{k}" for k in range(1, len(plan) - 1)]
                names += [f"{storey}.{number}.{name}" for name in (leg.start, *inner, leg.end)]
                first.append(len(names))
                storey_of += [storey] * len(plan)
    if not places:
        raise GeometryError(_without_floor(cells, robot))
    floors, sides = np.concatenate(places), np.concatenate(walls)
    rows, breaks = np.arange(len(names)), first
    for a, b in _joints(cells, pairs, floors, np.array(storey_of)):
        rows, breaks = np.concatenate([rows, [a, b]]), [*breaks, breaks[-1] + 2]
    floors, sides = floors[rows], sides[rows]
    down = np.minimum(_SIGHT_M, sides[:, 2] / 2)
    lrud = np.column_stack([sides[:, :2], sides[:, 2] - down, down])
    return SurveyedLegs(
        positions_m=floors + np.column_stack([np.zeros((len(rows), 2)), down]),
        lrud_m=lrud,
        first=np.array(breaks, np.int32),
        names=text_array([names[row] for row in rows]),
        surveyed_m=0.0,
        datum_m=datum_m,
    )


def _without_floor(cells: FloorSpans, robot: RobotSize) -> str:
    """Return how much of the floors is high and flat enough, and which parameters overrule these limits.

    Of floors that are smaller than a leg's, however high and flat they are, it is the largest one.
    """
    number = components_of(len(cells.storey), neighbours_of(cells, replace(robot, height_m=0.0)), cells.headroom_m > 0)
    largest_m2 = float((number == 0).sum()) * cells.cell_m**2
    if largest_m2 < _LEAST_M2:
        return (
            f"compile3d: its largest floor, however low and steep, has {largest_m2:.1f} m2, and a robot needs "
            f"{_LEAST_M2:g} m2; is the scale right (--unit)?"
        )
    fits = (np.ones(len(cells.storey), bool), cells.headroom_m >= robot.height_m, cells.storey >= 0)
    floors, high, flat = (f"{fit.sum() * cells.cell_m**2:.1f} m2" for fit in fits)
    return (
        f"compile3d: no floor of {_LEAST_M2:g} m2 is flat and high enough for a robot: of {floors} of floors {high} "
        f"are {robot.height_m:g} m high (compile3d.volume.robot_height_m=M states another robot), and of these {flat} "
        f"no steeper than {robot.steepest:g} (compile3d.volume.steepest=S)"
    )


def _networks(cells: FloorSpans, own: np.ndarray) -> list[DriftNetwork]:
    """Return the network of each connected floor of some spans, seen from above."""
    own = own[np.lexsort((cells.column[own], cells.row[own]))]
    own = own[~_meets_itself(cells, own)]
    column, row = cells.column[own], cells.row[own]
    starts = np.flatnonzero(np.append(True, (np.diff(row) != 0) | (np.diff(column) != 1)))  # of cells side by side
    ends = np.append(starts[1:], len(own)) - 1
    low = cells.origin_m + np.column_stack([column[starts], row[starts]]) * cells.cell_m
    high = cells.origin_m + np.column_stack([column[ends], row[ends]]) * cells.cell_m + cells.cell_m
    boxes = shapely.box(*(low - _JOIN_M).T, *(high + _JOIN_M).T)
    outlines = [part for part in shapely.get_parts(shapely.union_all(boxes)) if part.area >= _LEAST_M2]
    return [trace_network(_without_gaps(part), cells.cell_m / 2, _SHORTEST_M, _SPACING_M) for part in outlines]


def _meets_itself(cells: FloorSpans, own: np.ndarray) -> np.ndarray:
    """Return which spans (n,) of a storey, by row and column, are beside one of it that lies over or under rock.

    A helix is cut into storeys where it would lie over itself, and its cut ends are beside each other in plan.
    """
    wide = int(cells.column[own].max(initial=0)) + 2
    key = cells.row[own].astype(np.int64) * wide + cells.column[own]
    floor, roof = cells.floor_m[own], cells.floor_m[own] + cells.headroom_m[own]
    found = np.zeros(len(own), bool)
    for step in (1, wide - 1, wide, wide + 1):
        at = np.minimum(np.searchsorted(key, key + step), len(own) - 1)
        here = np.flatnonzero(key[at] == key + step)
        there = at[here]
        apart = (floor[here] >= roof[there]) | (floor[there] >= roof[here])
        found[here[apart]] = found[there[apart]] = True
    return found


def _without_gaps(outline: Polygon) -> Polygon:
    """Return a floor without holes that no robot has to go round."""
    return Polygon(outline.exterior, [ring for ring in outline.interiors if Polygon(ring).area >= _LEAST_M2])


def _joints(cells: FloorSpans, pairs: np.ndarray, floors: np.ndarray, storey_of: np.ndarray) -> list[tuple[int, int]]:
    """Return two stations for each place where storeys meet: the nearest of either."""
    storey = cells.storey[pairs]
    meets = pairs[(storey >= 0).all(axis=1) & (storey[:, 0] != storey[:, 1])]
    if not len(meets):
        return []
    key = np.sort(cells.storey[meets], axis=1)
    places = cells.places_m[meets].mean(axis=1)
    near = cKDTree(places).query_pairs(3 * cells.cell_m, output_type="ndarray")
    near = near[(key[near[:, 0]] == key[near[:, 1]]).all(axis=1)]
    part = connected_components(coo_matrix((np.ones(len(near)), near.T), (len(meets),) * 2), directed=False)[1]
    found = []
    for number in range(part.max() + 1):
        rows = np.flatnonzero(part == number)
        middle = places[rows].mean(axis=0)
        ends = []
        for one in key[rows[0]].tolist():
            stations = np.flatnonzero(storey_of == one)
            if len(stations):
                ends.append(int(stations[np.linalg.norm(floors[stations] - middle, axis=1).argmin()]))
        if len(ends) == 2:
            found.append((ends[0], ends[1]))
    return found


def nearest_leg(volume: Volume, network: SurveyNetwork) -> np.ndarray:
    """Return for each facet (f,) the number of the leg that its middle is nearest to the middle of, in one frame."""
    middles = network.ends_m.mean(axis=1)
    return np.asarray(cKDTree(middles).query(volume.vertices[volume.faces].mean(axis=1))[1])


def mine_volume(volume: Volume, leg: np.ndarray) -> VolumeFacets:
    """Return a solid's volume with the leg of each facet."""
    return VolumeFacets(
        volume.vertices, volume.faces.astype(np.int32), volume.label.astype(np.int32), leg.astype(np.int32)
    )
