"""The free space of a mine as one closed mesh: the boolean union of the hulls of its legs, with labelled facets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import manifold3d
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from minexplore.floors.volume_arrays import FacetLabel
from pipeline.errors import GeometryError
from pipeline.geometry.facets.inside import Inside
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.passages.joints import LOW, joints_at, roof_reach
from pipeline.volume.passages.tubes import Tube, sections_along, sections_between, solids_through
from pipeline.volume.passages.views import with_views

STEEPEST = 0.364  # rise over run of a leg that robots drive on, as today (conf/floors/default.yaml)
_LOW_MOST = 0.95  # of the height, at the most: where the station is higher, walls are as wide as measured up to it
_FLOOR_NZ = -0.7  # of a facet's normal, which points out of the free space
_FOOT_M = 0.6  # of a steep leg, over which its walls are plumb: floors meet it within a ledge's height
_CRUMB_M3 = 1e-9  # of a shell, at least: the volume of a wall of no thickness is rounding
_OVER_STATION_M = 0.1  # that the walls of a steep leg go on over its upper station, at least
_LEAST_RISE_M = 0.1  # between the floors of a steep leg: sections that cross make no solid


@dataclass(frozen=True)
class Solid:
    """A convex piece of the free space, and the floor that it stands on.

    `floor` is (x, y, z) m of a point of the floor and its slope east and north (5,); `shot` is the leg's number, or of
    a hub one of its legs; `footprint` is the floor's corners (k, 2) m.
    """

    sections: np.ndarray  # (n, k, 3), each a ring to the right about the way; a single one is a hull by itself
    floor: np.ndarray
    footprint: np.ndarray
    shot: int
    is_drivable: bool
    is_plumb: bool = False

    @property
    def foot(self) -> np.ndarray:
        """Return the lowest section (k, 3) m of a plumb leg."""
        lowest: np.ndarray = self.sections[self.sections[:, 0, 2].argmin()]
        return lowest


@dataclass(frozen=True)
class Volume:
    """The free space: a closed mesh, and for each of its facets the convex piece it comes from and its label."""

    vertices: np.ndarray
    faces: np.ndarray
    source: np.ndarray  # (f,) number of the piece in `pieces`
    label: np.ndarray  # (f,) of FacetLabel
    pieces: list[Solid]

    @cached_property
    def normals(self) -> np.ndarray:
        """Return twice the area times the normal (f, 3) out of the free space, m2."""
        a, b, c = np.moveaxis(self.vertices[self.faces], 1, 0)
        return np.cross(b - a, c - a)

    @cached_property
    def inside(self) -> Inside:
        """Return what says which places are in the free space; it is indexed when it is first asked for."""
        return Inside(self.vertices, self.faces)

    @cached_property
    def solid(self) -> manifold3d.Manifold:
        """Return the free space as a solid, which is made of the mesh when it is first asked for.

        Raises
        ------
        GeometryError
            If the mesh is not closed, or a facet is turned over.
        """
        solid = manifold3d.Manifold(manifold3d.Mesh64(self.vertices, self.faces.astype(np.uint64))).as_original()
        if solid.status() != manifold3d.Error.NoError:
            raise GeometryError(f"volume: its mesh encloses no space ({solid.status().name})")
        return solid


def unite(network: SurveyNetwork, pieces: list[Solid]) -> Volume:
    """Return the union of the pieces; rock that it encloses on all sides and that touches nothing is free space.

    Legs that share sections are one tube, as solids that only touch are what booleans are worst at.
    """
    numbers: dict[int, int] = {}
    solids = solids_of(network, pieces, numbers)
    union = without_crumbs(manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add))
    union = with_views(union, network, [(one.sections, one.is_drivable) for one in pieces], numbers)
    return label_facets(union, pieces, numbers)


def solids_of(network: SurveyNetwork, pieces: list[Solid], numbers: dict[int, int]) -> list[manifold3d.Manifold]:
    """Return the solids of tubes and single pieces; enter the number of each piece by manifold3d's."""
    tubes, open_tube = list[Tube](), Tube([], [])
    for number, piece in enumerate(pieces):
        if len(piece.sections) == 1:
            continue
        open_tube.sections.append(piece.sections)
        open_tube.shots.append(number)
        if not network.joined[piece.shot, 1]:
            tubes.append(open_tube)
            open_tube = Tube([], [])
    solids = solids_through(tubes, numbers)
    for number, piece in enumerate(pieces):
        if len(piece.sections) == 1:
            solids.append(manifold3d.Manifold.hull_points(piece.sections[0]).as_original())
            numbers[solids[-1].original_id()] = number
    return solids


def label_facets(solid: manifold3d.Manifold, pieces: list[Solid], numbers: dict[int, int]) -> Volume:
    """Return a volume with the labels that its facets' pieces and directions give them."""
    vertices, faces, source = mesh_of(solid, numbers)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normal = np.cross(b - a, c - a)
    z = normal[:, 2] / np.maximum(np.linalg.norm(normal, axis=1), 1e-30)
    drivable = np.array([piece.is_drivable for piece in pieces])[source]
    label = np.where(
        (z < _FLOOR_NZ) & drivable, FacetLabel.FLOOR, np.where(z > -_FLOOR_NZ, FacetLabel.ROOF, FacetLabel.WALL)
    )
    return Volume(vertices, faces, source, label, pieces)


def mesh_of(solid: manifold3d.Manifold, numbers: dict[int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a solid's vertices (v, 3) m and facets (f, 3), and the number (f,) that the facets' source has."""
    mesh = solid.to_mesh64()
    runs = np.diff(np.asarray(mesh.run_index).astype(int)) // 3
    source = np.repeat([numbers.get(int(k), -1) for k in mesh.run_original_id], runs)
    return np.array(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts, np.int64), source


def without_crumbs(
    solid: manifold3d.Manifold,
    least_m3: float = _CRUMB_M3,
    cut_by: list[int] | None = None,
    border: Sequence[int] = (),
    floating_m3: float = np.inf,
) -> manifold3d.Manifold:
    """Return the solid without its shells of a volume up to `least_m3`, m3.

    A shell of rock that floats in the free space has a volume below 0: it is a gap between hulls, and becomes free if
    it is no larger than `floating_m3`.
    With surfaces `cut_by`, by manifold3d's numbers, only shells of free space go that these bound; with those of a
    `border`, only shells that it does not bound.
    """
    mesh = solid.to_mesh64()
    vertices, faces = np.array(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts, np.int64)
    n = len(vertices)
    edges = coo_matrix((np.ones(2 * len(faces)), (faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel())), (n, n))
    count, part = connected_components(edges, directed=False)
    shell = part[faces[:, 0]]
    about = vertices[np.unique(part, return_index=True)[1]][shell]
    a, b, c = np.moveaxis(vertices[faces] - about[:, None], 1, 0)
    volume = np.bincount(shell, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6, count)
    is_kept = (volume > least_m3) | (volume < -floating_m3)
    surface = np.repeat(mesh.run_original_id, np.diff(np.asarray(mesh.run_index).astype(int)) // 3)
    is_kept[shell[np.isin(surface, border)]] = True
    if cut_by is not None:
        others = np.setdiff1d(shell, shell[np.isin(surface, cut_by)])
        is_kept[others] |= volume[others] > _CRUMB_M3
    if count == 1 or is_kept.all():
        return solid
    return _some(mesh, vertices, faces, is_kept[shell])  # `decompose` takes 4 GB in a cave of 13 km


def _some(mesh: manifold3d.Mesh64, vertices: np.ndarray, faces: np.ndarray, kept: np.ndarray) -> manifold3d.Manifold:
    """Return the solid of some facets (f,) of a mesh, with the same numbers of their surfaces."""
    used, corners = np.unique(faces[kept], return_inverse=True)
    ends = np.asarray(mesh.run_index).astype(int) // 3
    size = np.diff(np.append(0, np.cumsum(kept))[ends])
    return manifold3d.Manifold(
        manifold3d.Mesh64(
            vertices[used],
            corners.reshape(-1, 3).astype(np.uint64),
            run_index=3 * np.append(0, np.cumsum(size[size > 0])),
            run_original_id=np.asarray(mesh.run_original_id)[size > 0],
        )
    )


def pieces_of(network: SurveyNetwork) -> list[Solid]:
    """Return a convex piece for each leg, and those at each station where legs meet without a common section."""
    flat = network.grades <= STEEPEST
    pieces = [_leg(network, shot, bool(flat[shot])) for shot in range(len(network.shots))]
    loose: dict[int, list[tuple[int, int]]] = {}
    for shot, ends in enumerate(network.shots.tolist()):
        for end, station in enumerate(ends):
            loose.setdefault(station, []).append((shot, end))
    for station, ends in loose.items():
        drivable = [(shot, end) for shot, end in ends if flat[shot]]
        if len(ends) > 1 and drivable and not all(network.joined[shot, end] for shot, end in ends):
            plumb = [pieces[shot] for shot, _ in ends if pieces[shot].is_plumb]
            place = network.places_m[station, :2]
            feet = [one.foot[:, :2] - place for one in plumb if network.foot_of(one.shot) == station]
            for corners in joints_at(network, station, drivable, feet):
                floor = np.array([*place, corners[0, 0, 2], 0, 0])
                pieces.append(Solid(corners.reshape(1, -1, 3), floor, corners[0, :, :2], drivable[0][0], True))
    return pieces


def _leg(network: SurveyNetwork, shot: int, is_drivable: bool) -> Solid:
    places, lrud, across = network.ends_m[shot], network.lrud_m[shot], network.across[shot]
    step = places[1] - places[0]
    run = float(np.hypot(step[0], step[1]))
    floors = network.floors_m[shot]
    left = np.column_stack([across * lrud[:, :1], [0, 0]])
    right = np.column_stack([-across * lrud[:, 1:2], [0, 0]])
    if min(abs(step[2]), abs(floors[1, 2] - floors[0, 2])) > run:  # stations may be at any height over a floor
        sections = _plumb_sections(places, lrud, across[0])
        return Solid(
            sections_along(sections, lrud), np.array([*places[0], 0, 0]), sections[0, :, :2], shot, False, True
        )
    tall = lrud[:, 2:].sum(axis=1)[:, None] * [0, 0, 1.0]
    low = np.clip(lrud[:, 3] / np.maximum(lrud[:, 2:].sum(axis=1), _LEAST_RISE_M), LOW, _LOW_MOST)[:, None] * tall
    ring = [floors + right + low, *(floors + end + tall for end in _roof_ends(across, lrud))]
    ring += [floors + left + low, floors + left, network.ways_m[shot], floors + right]
    sections = sections_between(np.stack(ring, axis=1), lrud)
    slope = step[:2] * (floors[1, 2] - floors[0, 2]) / max(run, 1e-9) ** 2
    footprint = np.concatenate([(floors + left)[:, :2], (floors + right)[::-1, :2]])
    return Solid(sections, np.array([*floors[0], *slope]), footprint, shot, is_drivable)


def _roof_ends(across: np.ndarray, lrud: np.ndarray) -> list[np.ndarray]:
    """Return where flat roofs end, to the right and left, (2, 3) m from the stations; `across` (2, 2) is left."""
    reach = -np.asarray(roof_reach(lrud[:, 1], lrud[:, 0])), np.asarray(roof_reach(lrud[:, 0], lrud[:, 1]))
    return [np.column_stack([across * side[:, None], [0, 0]]) for side in reach]


def _plumb_sections(places: np.ndarray, lrud: np.ndarray, left: np.ndarray) -> np.ndarray:
    """Return the sections (4, 8, 3) of a steep leg, level ones: the lower floor, its foot, the upper floor, over that.

    Its walls are plumb about the lower floor, so that no wall hangs over where another floor meets it, and from the
    upper floor half-way to the roof. Between them they follow the line from floor to floor: a leg that leans goes out
    of its foot on the side that it leans to.
    """
    ahead = np.array([left[1], -left[0]])
    floors = places - lrud[:, 3:] * [0, 0, 1.0]
    lower = int(floors[:, 2].argmin())
    around = [(1, 0.5), (0.5, 1), (-0.5, 1), (-1, 0.5), (-1, -0.5), (-0.5, -1), (0.5, -1), (1, -0.5)]
    rings = []
    for end in (0, 1):
        half = max(lrud[end, :2].sum() / 2, 0.05)
        ring = [t * ahead * half + a * left * lrud[end, 0 if a > 0 else 1] for t, a in around[:: 1 if lower else -1]]
        rings.append(np.array(ring))
    floors[1 - lower, 2] = max(floors[1 - lower, 2], floors[lower, 2] + _LEAST_RISE_M)
    rise = floors[1 - lower] - floors[lower]
    for end in (0, 1):  # the line between the stations is behind that between the floors, at one height
        behind = -rise[:2] / rise[2] * lrud[end, 3]
        rings[end] = np.where((rings[end] @ behind > 0)[:, None], rings[end] + behind, rings[end])
    share = min(_FOOT_M / rise[2], 0.5)
    leans = (rings[lower] @ rise[:2] > 0)[:, None]
    foot = np.where(leans, rings[lower] + share * rise[:2], rings[lower])
    upper = floors[1 - lower]
    over = max(lrud[1 - lower, 2:].sum() / 2, lrud[1 - lower, 3] + min(_OVER_STATION_M, lrud[1 - lower, 2]))
    sections = [
        _level(foot + floors[lower, :2], floors[lower, 2]),
        _level(foot + floors[lower, :2], floors[lower, 2] + share * rise[2]),
        _level(rings[1 - lower] + upper[:2], upper[2]),
        _level(rings[1 - lower] + upper[:2], upper[2] + over),
    ]
    return np.array(sections[::-1] if lower else sections)


def _level(ring: np.ndarray, height_m: float) -> np.ndarray:
    """Return the corners (k, 3) m of a level ring (k, 2)."""
    return np.column_stack([ring, np.full(len(ring), height_m)])
