"""Read a solid of workings: its triangles in the mine frame, closed, and simplified where they are many."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import manifold3d
import numpy as np
import trimesh
from shapely import MultiPolygon, Polygon
from shapely.geometry.polygon import orient

from minesurveys.coordinates.origin import origin_of
from minesurveys.coordinates.precision import require_fine, steps_seen
from minesurveys.coordinates.strays import require_together
from minesurveys.errors import InputError, first_few
from minesurveys.frames import METRES, Georeference
from minesurveys.guard.plain_file import read_text_bytes, require_at_most
from minesurveys.remarks import warn_user
from minesurveys.solids.files import read_triangles
from minesurveys.vector.shapes import REACH_M
from pipeline.params.survey import SolidSurveyParams
from pipeline.scans.meshes.uncrossed import UncrossedMesh, arrays_of, uncrossed
from pipeline.survey.solids.closing import ClosedPieces, close_pieces
from pipeline.survey.solids.decimate import EXACT, decimated, distances
from pipeline.survey.solids.free_space import PARTED_M, PiecedSpace, Place, free_space_of
from pipeline.types import ClosedMesh

MOST_FACETS = 20_000  # parts of the rock, of which MuJoCo reads 1,000 a second
KEPT_M = 0.001  # of a mesh that is simplified by no more no corner is farther off; a scan's may be
_SCANNED_M = 0.03  # of meshes with more facets than a world has: scanners make them, with noise of as much
_SAMPLES = 200_000  # points on such a mesh, which the world is compared with
_LEAST_M2 = 0.01  # of a part of the plan view


@dataclass(frozen=True)
class SolidReading:
    """A closed mesh (m, mine frame), its view from above, where the frame lies, and how far it was simplified, m.

    Metres and z are guesses where neither the file, nor its format, nor an option states a unit or the upright axis.
    """

    solid: ClosedMesh
    workings: MultiPolygon
    georeference: Georeference
    simplify_m: float
    unit_is_guess: bool
    up_is_guess: bool


def read_solid(params: SolidSurveyParams, is_stated: bool = True) -> SolidReading:
    """Read a solid and close it.

    A mesh of up to 20,000 facets keeps its place, unless `simplify_m` is over 1 mm; of a larger one no corner moves by
    more than that, if 20,000 facets are enough. Beyond 1 mm a mesh is reduced as scans are, and is compared with points
    on the file's triangles. Without `is_stated` meshes for which they are not are simplified by 3 cm, and warnings list
    what was done.

    Raises
    ------
    InputError
        If the file is no mesh, is too large, encloses no space, has a hole wider than `close_m`, or crosses itself
        wherever it is found again. The message names the file and the option.
    """
    path = Path(params.file)
    data = read_text_bytes(path, "file_bytes")
    read = read_triangles(path, data, params.layers)
    require_at_most(path, len(read.faces), "solid_facets", "triangles")
    up = params.up or read.up
    vertices = read.vertices[:, [0, 2, 1]] * [1, -1, 1] if up == "y" else read.vertices
    unit = params.unit or read.unit or "m"
    cure = "delete what they belong to, or --unit states its unit"
    require_together(path, read.vertices, REACH_M / METRES[unit], "corners", cure)
    is_sure = bool(read.steps.any())
    require_fine(path, (read.steps if is_sure else steps_seen(read.vertices)) * METRES[unit], is_sure)
    origin = np.array(params.origin or origin_of(vertices, METRES[unit]))
    vertices = (vertices - origin) * METRES[unit]
    if np.abs(vertices).max() > REACH_M:
        raise InputError(f"{path}: reaches {np.abs(vertices).max():.6g} m far, beyond {REACH_M:g} m; --unit states it")
    try:
        pieces = close_pieces(vertices, read.faces, params.weld_m, params.close_m)
        free = free_space_of(pieces, params.weld_m)
        corners, faces, moved_m, tolerance = _simplified(free.solid, params.simplify_m, is_stated)
        apart = uncrossed(corners, faces)
    except InputError as error:
        doubt = "" if params.unit or read.unit else "; the file states no unit and is read in metres (--unit)"
        raise InputError(f"{path}: {error}{doubt}") from error
    points = np.zeros((0, 3))
    if tolerance > KEPT_M or apart.crossed:
        points = trimesh.sample.sample_surface(trimesh.Trimesh(vertices, read.faces, process=False), _SAMPLES, seed=0)[
            0
        ]
    if not is_stated:
        _warn(path, pieces, free, params)
        if tolerance > KEPT_M:
            warn_user(
                f"triangles are simplified to {len(faces):,}, of which four fifths move by at most "
                f"{max(tolerance, round(moved_m, 3)):g} m",
                of=path.name,
                count=f"{free.solid.num_tri():,}",
                option="--simplify",
                advice="--simplify M",
            )
        elif moved_m:
            warn_user(
                f"{path.name}: {free.solid.num_tri():,} triangles are simplified to {len(faces):,}; no corner moves by "
                f"more than {1e3 * moved_m:.2g} mm; --simplify M"
            )
        warn_of_crossed(path, apart)
    solid = ClosedMesh(apart.vertices, apart.faces.astype(np.int32), float(origin[2]) * METRES[unit], points)
    place = Georeference(unit, METRES[unit], (float(origin[0]), float(origin[1])))
    unit_is_guess, up_is_guess = not (params.unit or read.unit), params.up is None and read.up == "z"
    return SolidReading(solid, view_from_above(free.solid), place, tolerance, unit_is_guess, up_is_guess)


def _simplified(
    solid: manifold3d.Manifold, tolerance_m: float, is_stated: bool
) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Return a mesh (n, 3) m, (m, 3), how far it moved, m, and the tolerance, m: 3 cm if 1 mm leaves too many facets.

    Up to 1 mm, no corner of one mesh is farther from the other; beyond, four fifths are not.
    """
    vertices, faces = arrays_of(solid)
    if tolerance_m <= KEPT_M:
        if len(faces) <= MOST_FACETS:
            return vertices, faces, 0.0, tolerance_m
        # Not `simplify` of manifold3d, which moves corners by more than it is asked for:
        # findings/manifold3d-simplify-beyond-its-tolerance.sh.
        fewer, fewer_faces, moved_m = decimated(vertices, faces, tolerance_m, MOST_FACETS, within=EXACT)
        moved_m = max(moved_m, float(distances(fewer, vertices, faces).max()))
        if moved_m <= tolerance_m:
            return fewer, fewer_faces, moved_m, tolerance_m
        if is_stated:
            return vertices, faces, 0.0, tolerance_m
    tolerance_m = tolerance_m if is_stated else max(tolerance_m, _SCANNED_M)
    return *decimated(vertices, faces, tolerance_m, MOST_FACETS), tolerance_m


def view_from_above(solid: manifold3d.Manifold) -> MultiPolygon:
    """Return the polygons that a solid covers in plan, m."""
    rings = [np.asarray(ring) for ring in solid.project().to_polygons()]
    area = [float(np.cross(ring, np.roll(ring, -1, axis=0)).sum() / 2) for ring in rings]
    holes = [ring for ring, a in zip(rings, area, strict=True) if a < -_LEAST_M2]
    found = []
    for ring, a in zip(rings, area, strict=True):
        if a > _LEAST_M2:
            outer = Polygon(ring)
            own = [hole for hole in holes if outer.contains(Polygon(hole).representative_point())]
            found.append(orient(Polygon(ring, own)))
    return MultiPolygon(found)


def _warn(path: Path, pieces: ClosedPieces, free: PiecedSpace, params: SolidSurveyParams) -> None:
    """Warn of what was closed, turned, left out, taken for rock, and of what only touches."""
    say = partial(warn_user, of=path.name)
    if pieces.holes:
        widest = sorted(pieces.holes, key=lambda hole: -hole.edge_m)
        sizes = first_few([f"{hole.edge_m / np.pi:.2f} m at {_at(hole.middle_m)}" for hole in widest])
        say(
            f"holes are closed: {sizes}; the widest allowed is {params.close_m:g} m (--close M)",
            count=len(widest),
            option="--close",
        )
    if free.rock:
        largest = max(free.rock, key=lambda rock: rock.volume_m3)
        say(
            "pieces are rock in the workings, as their normals point the other way: "
            f"{sum(rock.volume_m3 for rock in free.rock):.4g} m3, the largest {largest.volume_m3:.4g} "
            f"m3 at {_at(largest.middle_m)}",
            count=f"{len(free.rock)} of {len(pieces.solids)}",
        )
    if free.turned:
        say(f"the normals of {free.turned} of {len(pieces.solids)} pieces point into the workings; they are turned")
    if free.touching:
        say(
            f"pairs of spaces touch at an edge or a point alone, the first at {_at(free.touching[0])}; "
            f"{PARTED_M:g} m of rock part them",
            count=len(free.touching),
        )
    if pieces.flipped:
        say("triangles are turned the way of their neighbours", count=pieces.flipped)
    if pieces.dropped:
        say(
            f"pieces of {pieces.dropped_m2:.2g} m2 in all enclose less than a litre and are left out",
            count=pieces.dropped,
        )


def warn_of_crossed(path: Path, apart: UncrossedMesh) -> None:
    """Warn of facets that crossed others, where the surface was found again."""
    if apart.crossed:
        warn_user(
            f"triangles crossed others; at {apart.places} places the surface is found again, to "
            f"{apart.cell_m:.2f} m; --voxel M finds all of it again",
            of=path.name,
            count=apart.crossed,
            option="--voxel",
        )


def _at(place: Place) -> str:
    return f"({place[0]:.1f}, {place[1]:.1f}, {place[2]:.1f})"
