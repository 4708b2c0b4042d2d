"""What real sweeps are replayed in, of a world that is one volume."""

from __future__ import annotations

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
        _Floors(floors, world.record.volume.high_m + _ABOVE_M).height_m,
        world.record.plan_frame,
        world.record.tilt_deg,
    )


def _rock(world: VolumeBundle) -> np.ndarray:
    """Return the triangles (n, 3, 3) m of the visible rock."""
    vertices, faces = join_meshes(world.rock)
    found: np.ndarray = vertices[faces].astype(np.float64)
    return found


class _Floors:
    """Heights of floors, by rays that fall from a height."""

    def __init__(self, floors: np.ndarray, from_m: float) -> None:
        self._rays, self._from_m = RayCaster(floors), from_m

    def height_m(self, places: np.ndarray) -> np.ndarray:
        """Return the height (n,) m of the highest floor under places (n, 2) m; inf where there is none."""
        origins = np.column_stack([places, np.full(len(places), self._from_m)])
        fallen_m = self._rays.cast(origins, np.tile([0.0, 0.0, -1.0], (len(places), 1)))
        return np.where(np.isfinite(fallen_m), self._from_m - fallen_m, np.inf)
