"""What real sweeps are replayed in, of a world that is one volume."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import shapely

from minexplore.bundle import MODEL, GeomGroup
from minexplore.floors.volume_arrays import FacetLabel
from pipeline.geometry.raycast import RayCaster
from pipeline.mjcf.bundle import geom_triangles
from pipeline.mjcf.loading import read_spec
from pipeline.mjcf.visible import compile_with
from pipeline.proof.lidar.swept import SweptWorld
from pipeline.surface.mesh.mesh_checks import join_meshes
from pipeline.volume.world.proof.certificate import VolumeBundle

_PARTS = (GeomGroup.FLOOR, GeomGroup.COLLISION, GeomGroup.ROOF)
_ABOVE_M = 1.0  # of the volume: rays down to the floors begin there


def swept_volume(folder: Path, world: VolumeBundle) -> SweptWorld:
    """Return what is replayed in of the bundle of a volume world in a folder.

    A level ray can meet floors and roofs as well as walls, so all parts count, and floors beside the visible rock.
    Where floors lie over one another, a scanner stands on the highest.

    Raises
    ------
    ArtifactError
        If MuJoCo refuses the model.
    """
    model = compile_with(read_spec(folder / MODEL), folder / MODEL)
    parts = np.concatenate([geom_triangles(model, group) for group in _PARTS])
    floors = world.mine.vertices[world.mine.faces[world.mine.label == FacetLabel.FLOOR]]
    return SweptWorld(
        RayCaster(parts),
        RayCaster(np.concatenate([_rock(world), floors])) if world.rock else None,
        shapely.union_all(shapely.polygons(floors[:, :, :2])),
        _heights_of(floors, world.record.volume.high_m + _ABOVE_M),
        world.record.plan_frame,
        world.record.tilt_deg,
    )


def _rock(world: VolumeBundle) -> np.ndarray:
    """Return the triangles (n, 3, 3) m of the visible rock."""
    vertices, faces = join_meshes(world.rock)
    found: np.ndarray = vertices[faces].astype(np.float64)
    return found


def _heights_of(floors: np.ndarray, from_m: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return what gives heights of floors, triangles (n, 3, 3) m, by rays that fall from a height."""
    rays = RayCaster(floors)

    def floor_m(places: np.ndarray) -> np.ndarray:
        origins = np.column_stack([places, np.full(len(places), from_m)])
        fallen_m = rays.cast(origins, np.tile([0.0, 0.0, -1.0], (len(places), 1)))
        return np.where(np.isfinite(fallen_m), from_m - fallen_m, np.inf)

    return floor_m
