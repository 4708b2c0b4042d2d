"""What the arrays of a volume world's bundle hold, in the mine frame (m)."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np
from jaxtyping import Float64, Int32

from pipeline.errors import GeometryError
from pipeline.volume.union import Volume

SPARE_M = 1.0  # between the volume and the edge of the world's box in plan


@dataclass(frozen=True)
class MineVolume:
    """The closed mesh of the free space; normals point out of it.

    `label` is `pipeline.volume.union.Label` of each facet, `leg` the number of the survey's leg that it comes from.
    """

    vertices: Float64[np.ndarray, "n 3"]
    faces: Int32[np.ndarray, "f 3"]
    label: Int32[np.ndarray, " f"]
    leg: Int32[np.ndarray, " f"]

    def measured(self) -> Volume:
        """Return the volume as the measures of `pipeline.volume` take it: a solid with its mesh.

        Raises
        ------
        GeometryError
            If the mesh is not closed, or a facet is turned over.
        """
        solid = manifold3d.Manifold(manifold3d.Mesh64(self.vertices, self.faces.astype(np.uint64))).as_original()
        if solid.status() != manifold3d.Error.NoError:
            raise GeometryError(f"volume: its mesh encloses no space ({solid.status().name})")
        faces = self.faces.astype(np.int64)
        return Volume(solid, self.vertices, faces, self.leg.astype(np.int64), self.label.astype(np.int64), [], {})

    @property
    def world_m(self) -> tuple[float, float, float, float]:
        """Return west, south, east and north, m, of the box round the volume."""
        low, high = self.vertices[:, :2].min(axis=0), self.vertices[:, :2].max(axis=0)
        (west, south), (east, north) = np.floor(low - SPARE_M).tolist(), np.ceil(high + SPARE_M).tolist()
        return west, south, east, north


def in_mine_frame(volume: Volume, offset_m: np.ndarray) -> MineVolume:
    """Return a volume moved by an offset (3,) m, with the number of the leg that each facet comes from."""
    shot = np.array([piece.shot for piece in volume.pieces])
    return MineVolume(
        volume.vertices + offset_m,
        volume.faces.astype(np.int32),
        volume.label.astype(np.int32),
        shot[volume.source].astype(np.int32),
    )


@dataclass(frozen=True)
class LabelledParts:
    """Convex collision parts: part i has the corners `corners[first[i]:first[i + 1]]` and lies behind `label[i]`."""

    corners: Float64[np.ndarray, "c 3"]
    first: Int32[np.ndarray, " parts_plus_one"]
    label: Int32[np.ndarray, " parts"]

    def __len__(self) -> int:
        """Return the number of parts."""
        return len(self.label)

    def __getitem__(self, i: int) -> np.ndarray:
        """Return the corners (k, 3) m of part `i`."""
        if not 0 <= i < len(self):
            raise IndexError(i)
        return self.corners[self.first[i] : self.first[i + 1]]


@dataclass(frozen=True)
class Cells:
    """Floor spans: for each column of the grid every place where free space is over a floor.

    Column `column[i]`, `row[i]` has its centre at `origin_m + (column + 0.5, row + 0.5) * cell_m`. The span reaches
    from `floor_m` to `floor_m + headroom_m`; `clearance_m` is its distance from the next wall, in the middle of a
    robot. `storey` numbers the connected floors, the largest first, so that a column has a storey once; it is -1 where
    the floor is too steep or the roof too low for the robot that the world was made for.
    """

    column: Int32[np.ndarray, " s"]
    row: Int32[np.ndarray, " s"]
    floor_m: Float64[np.ndarray, " s"]
    headroom_m: Float64[np.ndarray, " s"]
    clearance_m: Float64[np.ndarray, " s"]
    storey: Int32[np.ndarray, " s"]
    origin_m: Float64[np.ndarray, " 2"]
    cell_m: float

    @property
    def places_m(self) -> np.ndarray:
        """Return the middles (s, 3) m of the spans' floors."""
        plan = self.origin_m + (np.column_stack([self.column, self.row]) + 0.5) * self.cell_m
        return np.column_stack([plan, self.floor_m])
