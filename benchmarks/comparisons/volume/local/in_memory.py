"""A volume and its shell as a world, without files: what the environment's local models need of one."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from minexplore.floors.floor_zones import FloorZone
from minexplore.floors.volume_arrays import WAYS, FloorSpans, Parts, VolumeArrays, VolumeFacets
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from minexplore.volume.choice import PlaneChooser
from minexplore.volume.columns import FloorColumns
from minexplore.volume.creases import Creases
from minexplore.volume.models import EXACT_TILE_M, VolumeModels
from minexplore.volume.planes import TOLERANCE_M, FloorPlanes
from minexplore.world import World
from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Volume

_DRY = FloorZone("dry", -np.inf, np.inf, 1.0, 1.0, 0.0)
_NO_SPANS = FloorSpans(
    *(np.zeros(0, np.int32),) * 2,
    *(np.zeros(0),) * 3,
    np.zeros(0, np.int32),
    np.zeros((0, 3), np.float32),
    np.zeros((0, len(WAYS)), np.float32),
    np.zeros(2),
    0.25,
)


def world_of(volume: Volume, parts: list[ShellPart]) -> World:
    """Return a world of one dry zone in the volume's own frame; it has no cells."""
    first = np.cumsum([0, *(len(part.corners) for part in parts)]).astype(np.int32)
    size = np.linalg.norm(volume.normals, axis=1)
    label = volume.label[[max(part.facets, key=lambda k: float(size[k])) for part in parts]]
    rock = Parts(np.concatenate([part.corners for part in parts]), first, label.astype(np.int32))
    faces = volume.faces.astype(np.int32)
    facets = VolumeFacets(volume.vertices, faces, volume.label.astype(np.int32), np.zeros(len(faces), np.int32))
    arrays = VolumeArrays(facets, rock, _NO_SPANS)
    record = {"rock_friction": 1.0}
    return World(Path(), record, np.eye(4), np.zeros((1, 1)), np.zeros(2), 0.25, [_DRY], volume=arrays)


class VolumeStepping:
    """The local models of a volume, and what chooses one for a control step."""

    def __init__(
        self,
        volume: Volume,
        parts: list[ShellPart],
        task: TaskParams | None = None,
        tolerance_m: float = TOLERANCE_M,
        exact_tile_m: tuple[float, float] = EXACT_TILE_M,
    ) -> None:
        """Index the floors; `tolerance_m` is how far they may be from the planes that stand for them."""
        world = world_of(volume, parts)
        assert world.volume is not None
        self.models = VolumeModels(world, task or TaskParams(), RobotParams(), exact_tile_m=exact_tile_m)
        self.columns = FloorColumns(world.volume.facets)
        self.planes = FloorPlanes(self.columns, Creases(world.volume.facets))
        self.chooser = PlaneChooser(self.models, self.planes, tolerance_m)

    def floors_under(self, places_m: np.ndarray) -> np.ndarray:
        """Return the height (n,) m of the first floor at or under places (n, 3) m, NaN where there is none."""
        return self.columns.heights_on(self.columns.facets_under(places_m), places_m[:, :2])
