"""The meshes of a volume's visible floor: muck, the water on level floors, and the floor again that shades hollows."""

from __future__ import annotations

import numpy as np

from minexplore.bundle import SHADE_MESH, puddle_geom
from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from pipeline.mjcf.floor.cover import cover_floor, cut_by_zones
from pipeline.mjcf.scene import ZoneStrip
from pipeline.params.fittings import FloorParams
from pipeline.types import Mesh
from pipeline.volume.world.floor.grid import LEVEL, slopes_of, volume_grid
from pipeline.volume.world.topology import LegNetwork

_LEAST_CORNERS = 4  # of a mesh in MuJoCo


def lay_floor(params: FloorParams, volume: VolumeFacets, legs: LegNetwork, zones: list[ZoneStrip]) -> dict[str, Mesh]:
    """Return the meshes of the visible floor by name, m, mine frame; nothing of them collides.

    Muck is that of `cover_floor`. Bare floors are the floor itself; MuJoCo shows them as high as water and shade are.
    Water stands where a floor is level, in the flooded zones; on a slope it runs off.

    Parameters
    ----------
    params : FloorParams
    volume : VolumeFacets
    legs : LegNetwork
        Ruts follow them.
    zones : list of ZoneStrip
    """
    return cover_floor(params, volume_grid(params, volume, legs), zones) | _bare_floors(params, volume, zones)


def _bare_floors(params: FloorParams, volume: VolumeFacets, zones: list[ZoneStrip]) -> dict[str, Mesh]:
    """Return floors as they are, seen from above: all of them, and the level ones of each flooded zone."""
    floors = volume.label == FacetLabel.FLOOR
    faces, slope = volume.faces[floors][:, ::-1], np.abs(slopes_of(volume)[floors]).max(axis=1)
    found = {SHADE_MESH: _mesh(volume.vertices, faces)}
    vertices, wet, zone = cut_by_zones(volume.vertices, faces[slope <= LEVEL], zones, 0.0)
    for number, one in enumerate(zones):
        if one.name in params.puddles:
            found[puddle_geom(one.name)] = _mesh(vertices, wet[zone == number])
    return {name: mesh for name, mesh in found.items() if len(mesh.vertices) >= _LEAST_CORNERS}


def _mesh(vertices: np.ndarray, faces: np.ndarray) -> Mesh:
    used, faces = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used].round(4), faces.reshape(-1, 3).astype(np.int32), np.zeros((0, 2)))
