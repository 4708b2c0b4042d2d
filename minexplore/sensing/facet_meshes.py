"""What beams end on in a world that is one volume."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from minexplore.bundle import (
    MESHES,
    fitting_geom,
    has_visible_rock,
    is_fitting,
    mesh_file,
    mesh_of,
    stops_beams,
    surface_geom,
)
from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from minexplore.tiles import group_by_tile, tiles_at
from minexplore.world import World

Meshes = dict[str, tuple[np.ndarray, np.ndarray]]
_PIECE_M = 10.0  # of the plan
_FACETS = {FacetLabel.FLOOR: "floor", FacetLabel.WALL: "rock", FacetLabel.ROOF: "roof"}  # names of the meshes


def facet_meshes(facets: VolumeFacets, labels: Iterable[FacetLabel] = FacetLabel) -> Meshes:
    """Return the facets of some labels, cut into pieces that lie in one square of the plan; see `surface_meshes`."""
    meshes: Meshes = {}
    for label in labels:
        own = facets.faces[facets.label == label]
        middles = facets.vertices[own].mean(axis=1)[:, :2]
        for tile, rows in group_by_tile(tiles_at(middles, _PIECE_M)) if len(own) else ():
            used, faces = np.unique(own[rows], return_inverse=True)
            meshes[f"{_FACETS[label]} {tile}"] = facets.vertices[used], faces.reshape(-1, 3).astype(np.int32)
    return meshes


def volume_meshes(world: World, facets: VolumeFacets) -> Meshes:
    """Return what beams end on in a world that is one volume: its floors with rock and furniture, or all its facets."""
    if not has_visible_rock(world.record):
        return facet_meshes(facets)
    names = [mesh_of(name) for name in world.record["files"] if name.startswith(MESHES)]
    seen = {name: world.mesh(mesh_file(name)) for name in names if stops_beams(name)}
    geoms = {name: fitting_geom(name) if is_fitting(name) else surface_geom(name) for name in seen}
    rock = {geoms[name]: (mesh.vertices, mesh.faces) for name, mesh in seen.items()}
    return rock | facet_meshes(facets, [FacetLabel.FLOOR])
