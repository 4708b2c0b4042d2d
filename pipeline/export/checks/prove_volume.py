"""The proof of an exported volume: what the format's own loader reads of it, held against the bundle's arrays."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from minexplore.floors.volume_arrays import FacetLabel, VolumeArrays
from pipeline.export.checks.pieces import match_labels, pieces_of_scene
from pipeline.export.checks.prove import SEED, Count, Proof, same_frictions
from pipeline.export.checks.rays import RayTest, cast_at, starts_on_spans
from pipeline.export.labels import FLOOR_SURFACE
from pipeline.export.scene import ConvexPart, ExportScene, ReadScene, hull_triangles
from pipeline.params.validation import Limit, VolumeProofParams
from pipeline.proof.certificate import Certificate, certify

_LIMITS = {
    "parts.off_mm": Limit(min=None, max=0.05),  # 32 bits at 300 m, or five decimals of a metre
    "parts.unlike": Limit(min=None, max=0),
}


def prove_volume(arrays: VolumeArrays, scene: ExportScene, read: ReadScene, params: VolumeProofParams) -> Proof:
    """Hold what was read back from an export against the bundle.

    The bundle's certificate is of parts of the same names that are as near as `parts.off_mm`; nothing of it is measured
    again.

    Parameters
    ----------
    arrays : VolumeArrays
        Of the bundle. Its facets are what rays end on.
    scene : ExportScene
        What was written; its visible rock, frictions and lights are compared.
    read : ReadScene
    params : VolumeProofParams
    """
    facets, draw = arrays.facets, starts_on_spans(arrays.spans)
    touched = RayTest(draw, cast_at(facets.vertices[facets.faces]))
    rays = {"touched": touched.compare(np.concatenate([np.zeros((0, 3, 3)), *map(hull_triangles, read.parts)]), SEED)}
    floor = facets.vertices[facets.faces[facets.label == FacetLabel.FLOOR]]
    shown = [s.triangles_m for s in scene.surfaces if scene.texture and not s.name.startswith(FLOOR_SURFACE)]
    seen = RayTest(draw, cast_at(np.concatenate([floor, *shown])) if shown else cast_at(facets.vertices[facets.faces]))
    surfaces = np.concatenate([np.zeros((0, 3, 3)), *(surface.triangles_m for surface in read.surfaces)])
    rays["seen"] = seen.compare(surfaces, SEED)
    lights = None if read.lights is None else Count(len(scene.lights), read.lights)
    certificate = compare_parts(scene, read)
    labels = match_labels(pieces_of_scene(scene), read)
    return Proof(rays, labels, certificate, sorted(params.limits), same_frictions(scene, read), lights)


def compare_parts(scene: ExportScene, read: ReadScene) -> Certificate:
    """Return how many parts of the file are not those of the world, and how far, mm, others reach beyond each other."""
    wanted, found = ({part.name: part for part in parts} for parts in (scene.parts, read.parts))
    shared = wanted.keys() & found.keys()
    unlike = len(wanted.keys() ^ found.keys()) + len(read.parts) - len(found)
    unlike += sum((wanted[name].label, wanted[name].zone) != (found[name].label, found[name].zone) for name in shared)
    off_m = max((_apart_m(wanted[name], found[name]) for name in shared), default=0.0)
    figures = {"parts.off_mm": round(1e3 * off_m, 6), "parts.unlike": unlike}
    return certify(scene.facts.world_sha256, figures, _LIMITS)


def _apart_m(one: ConvexPart, other: ConvexPart) -> float:
    """Return how far a corner of either part is beyond a face of the other; corners within a face may be left out."""
    return max(_beyond_m(one, other), _beyond_m(other, one))


def _beyond_m(one: ConvexPart, other: ConvexPart) -> float:
    planes = ConvexHull(other.corners_m).equations
    away = (one.vertices_m - other.centre_m) @ planes[:, :3].T + planes[:, 3]
    return float(away.max())
