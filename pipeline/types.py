"""The types of the stages' inputs and outputs: frozen records of arrays and polygons in stated frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32, UInt8
from shapely import MultiPolygon, Polygon

from minesurveys.frames import METRIC, Georeference, Heights
from minesurveys.frames import Image as Image
from minesurveys.frames import Mask as Mask
from minesurveys.frames import Points2 as Points2

Points3 = Float64[np.ndarray, "n 3"]
Place = tuple[float, float, float]  # m
Piece = str | Place  # of a survey: the name of a station in it, or a place


@dataclass(frozen=True)
class Frame:
    """The map between the plan's pixels and the mine frame (metres, x east, y north, z up from the floor).

    A pixel (col, row) covers [col, col + 1) x [row, row + 1) of the image plane; rows increase southwards.
    `origin_col`, `origin_row` are the image-plane coordinates of the mine frame's origin.
    """

    px_per_m: float
    origin_col: float
    origin_row: float
    width_px: int
    height_px: int

    def to_mine(self, image_points: np.ndarray) -> Points2:
        """Map (n, 2) image-plane points (col, row) to metres in the mine frame."""
        p = np.asarray(image_points, dtype=np.float64)
        return np.column_stack([p[:, 0] - self.origin_col, self.origin_row - p[:, 1]]) / self.px_per_m

    def to_image(self, mine_points: np.ndarray) -> Points2:
        """Map (n, 2) mine-frame points in metres to the image plane (col, row)."""
        p = np.asarray(mine_points, dtype=np.float64) * self.px_per_m
        return np.column_stack([p[:, 0] + self.origin_col, self.origin_row - p[:, 1]])

    @property
    def extent_m(self) -> tuple[float, float, float, float]:
        """West, south, east and north edge of the plan, m, mine frame."""
        (west, north), (east, south) = self.to_mine(np.array([[0, 0], [self.width_px, self.height_px]]))
        return float(west), float(south), float(east), float(north)

    def resampled(self, width_px: int, px_per_m: float) -> Frame:
        """Return the frame of the same picture resampled to a width, with another scale."""
        ratio = width_px / self.width_px
        return Frame(
            px_per_m, self.origin_col * ratio, self.origin_row * ratio, width_px, round(self.height_px * ratio)
        )


@dataclass(frozen=True)
class Scale:
    """The plan's scale in px/m: the value used, and values from other sources for comparison."""

    px_per_m: float
    source: str
    bar_px_per_m: float | None = None
    poses_px_per_m: float | None = None
    poses_interval_px_per_m: tuple[float, float] | None = None
    stated_px_per_m: float | None = None
    difference_percent: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Workings:
    """Workings seen from above (m, mine frame)."""

    polygons: MultiPolygon


@dataclass(frozen=True)
class Survey:
    """The plan's frame, scale, places and sources; `licences` holds the registered licence of each source.

    Robots start at `entrance_m` in plan, at the height `entrance_z_m` over 0 if that is stated. `heights` are those of
    the floor of a mine that is drawn as a plan; None if it is flat, or has its heights in itself.
    """

    name: str
    kind: str
    frame: Frame
    scale: Scale
    ignore_boxes_px: list[tuple[int, int, int, int]]
    entrance_m: tuple[float, float] | None
    labels_m: dict[str, tuple[float, float]]
    sources: list[str]
    georeference: Georeference = METRIC
    licences: dict[str, str] = field(default_factory=dict)
    heights: Heights | None = None
    entrance_z_m: float | None = None


_TEXT = partial(np.zeros, 0, np.uint8)
_OPTIONAL = {"optional": True}  # an empty array is not stored


@dataclass(frozen=True)
class SurveyedLegs:
    """The legs of a survey, from station to station.

    Leg i has the stations `first[i]` to `first[i + 1]`: `positions_m` in the mine frame (z less `datum_m`), and
    `lrud_m`, the distances left, right, up and down, nan where stage 3 has to choose one. `names` is UTF-8 text, a line
    for each station; `entrances` are those of the stations that are open to the surface.

    `sources` says of each of these distances whether it was measured (`Source`); empty if all that are no nan were.
    `between` is 1 for places between two stations, where splays hit a wall; empty if there is none. `splays_m` has the
    start and the end of each splay.

    `surveyed_m` is the length of all legs of the file. `pieces` and `pieces_m` are a station and the length of each
    piece that shares no station with this one.
    """

    positions_m: Float64[np.ndarray, "n 3"]
    lrud_m: Float64[np.ndarray, "n 4"]
    first: Int32[np.ndarray, " legs_plus_one"]
    names: UInt8[np.ndarray, " bytes"]
    surveyed_m: float
    datum_m: float = 0.0
    entrances: UInt8[np.ndarray, " entrance_bytes"] = field(default_factory=_TEXT, metadata=_OPTIONAL)
    pieces: UInt8[np.ndarray, " piece_bytes"] = field(default_factory=_TEXT, metadata=_OPTIONAL)
    pieces_m: Float64[np.ndarray, " pieces"] = field(default_factory=partial(np.zeros, 0), metadata=_OPTIONAL)
    sources: UInt8[np.ndarray, "n 4"] = field(default_factory=partial(np.zeros, (0, 4), np.uint8), metadata=_OPTIONAL)
    between: UInt8[np.ndarray, " n"] = field(default_factory=_TEXT, metadata=_OPTIONAL)
    splays_m: Float64[np.ndarray, "s 2 3"] = field(default_factory=partial(np.zeros, (0, 2, 3)), metadata=_OPTIONAL)

    def __len__(self) -> int:
        """Return the number of legs."""
        return len(self.first) - 1


def text_array(lines: Sequence[str]) -> np.ndarray:
    """Return lines of text as bytes; an archive of arrays holds no texts."""
    return np.frombuffer("\n".join(lines).encode(), np.uint8)


def lines_of(text: np.ndarray) -> list[str]:
    """Return the lines that `text_array` wrote."""
    return text.tobytes().decode().split("\n") if len(text) else []


@dataclass(frozen=True)
class ClosedMesh:
    """The free space of a survey that is a solid: a closed mesh (m, mine frame) whose normals point out of it.

    Its facets do not cross. `datum_m` is the survey's elevation of height 0.
    `scan_m` are the points of the scan that it was made from, `scan_rgb` their colours: red, green,
    blue, black of a point without one, none if the scan has none. `rays_m` are some of the points with the place of the
    scanner that saw each, before it. Other solids have none of these.
    """

    vertices: Float64[np.ndarray, "n 3"]
    faces: Int32[np.ndarray, "f 3"]
    datum_m: float
    scan_m: Float64[np.ndarray, "p 3"] = field(default_factory=partial(np.zeros, (0, 3)), metadata=_OPTIONAL)
    scan_rgb: UInt8[np.ndarray, "c 3"] = field(default_factory=partial(np.zeros, (0, 3), np.uint8), metadata=_OPTIONAL)
    rays_m: Float64[np.ndarray, "r 2 3"] = field(default_factory=partial(np.zeros, (0, 2, 3)), metadata=_OPTIONAL)

    def __len__(self) -> int:
        """Return the number of faces."""
        return len(self.faces)


@dataclass(frozen=True)
class FloorMesh:
    """The floors of drawn areas with heights, which are built as one volume: triangles in space, m, mine frame.

    Faces are counter-clockwise seen from above. Areas that meet share vertices; floors over each other do not.
    `datum_m` is the survey's elevation of height 0.
    """

    vertices: Float64[np.ndarray, "n 3"]
    faces: Int32[np.ndarray, "f 3"]
    datum_m: float

    def __len__(self) -> int:
        """Return the number of faces."""
        return len(self.faces)

    @property
    def rim(self) -> np.ndarray:
        """Return the edges (k, 2) on walls, from vertex to vertex with the floor on their left."""
        edges = np.stack([self.faces, np.roll(self.faces, -1, axis=1)], axis=-1).reshape(-1, 2).astype(np.int64)
        number = edges @ [len(self.vertices), 1]
        found: np.ndarray = edges[~np.isin(number, edges @ [1, len(self.vertices)])]
        return found

    @property
    def width_m(self) -> float:
        """Return the typical width of its drifts: that of one long drift of the same area and length of walls."""
        a, b, c = np.moveaxis(self.vertices[self.faces][:, :, :2], 1, 0)
        double = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        return float(double.sum() / self.walls_m)

    @property
    def walls_m(self) -> float:
        """Return the length of its walls, seen from above."""
        start, end = self.vertices[self.rim][:, :, :2].transpose(1, 0, 2)
        return float(np.linalg.norm(end - start, axis=1).sum())


@dataclass(frozen=True)
class DrawnPlan:
    """A mine that is drawn as a plan, whose outline stage 2 finds; `legs` are those that it was drawn from."""

    legs: SurveyedLegs | None = None


@dataclass(frozen=True)
class DrawnFloors:
    """A mine as the floors of drawn areas, with the shafts between them as legs."""

    mesh: FloorMesh
    shafts: SurveyedLegs | None = None

    @property
    def datum_m(self) -> float:
        """Return the survey's elevation of height 0."""
        return self.mesh.datum_m


VolumeShape = SurveyedLegs | ClosedMesh | DrawnFloors  # what a mine is that is built as one volume


@dataclass(frozen=True)
class Areas:
    """Areas of the plan; tunnel + islands + outside is the area of the plan's frame.

    `traced_tunnel_m2` is the tunnel before simplification. `unconnected_m2` is the area of drawn pieces of 1 m2 and
    more that are not connected to the workings and do not belong to them.
    """

    tunnel_m2: float
    islands_m2: float
    outside_m2: float
    islands: int
    traced_tunnel_m2: float
    unconnected_m2: float


@dataclass(frozen=True)
class FreeSpace:
    """The traced workings with islands as holes (m, mine frame), simplified by `tolerance_m`.

    Seen from above, the workings of a volume may be several polygons.
    """

    polygon: Polygon | MultiPolygon
    areas: Areas
    tolerance_m: float
    frame: Frame


@dataclass(frozen=True)
class Leg:
    """A drift or crosscut between two nodes, with stations along it (m, mine frame)."""

    name: str
    start: str
    end: str
    length_m: float
    chainage_m: list[float]
    stations_m: list[tuple[float, float]]
    half_width_m: list[float]


@dataclass(frozen=True)
class DriftNetwork:
    """The drift network as a graph: nodes are junctions and dead ends, edges are legs; traced on cells of `cell_m`."""

    nodes_m: dict[str, tuple[float, float]]
    legs: list[Leg]
    junctions: list[str]
    dead_ends: list[str]
    loops: int
    components: int
    total_length_m: float
    main_drift: list[str]
    main_drift_m: list[tuple[float, float]]
    main_drift_length_m: float
    cell_m: float


@dataclass(frozen=True)
class ConvexParts:
    """Convex collision parts: part i is `vertices[offsets[i]:offsets[i + 1]]` (m, mine frame)."""

    vertices: Float64[np.ndarray, "n 3"]
    offsets: Int32[np.ndarray, " parts_plus_one"]

    def __len__(self) -> int:
        """Return the number of parts."""
        return len(self.offsets) - 1

    def __getitem__(self, i: int) -> Points3:
        """Return the (n, 3) vertices of part `i`."""
        if not 0 <= i < len(self):
            raise IndexError(i)
        return self.vertices[self.offsets[i] : self.offsets[i + 1]]


@dataclass(frozen=True)
class Occupancy:
    """A 2-D grid over the world frame; cell [i, j] is centred at origin + (j + 0.5, i + 0.5) * cell (m, mine).

    `free` is true if the cell's centre lies in the workings. `clearance_m` is its distance from rock, 0 in rock. Row 0
    is the south edge.
    """

    free: Bool[np.ndarray, "rows cols"]
    clearance_m: Float32[np.ndarray, "rows cols"]
    origin_m: Float64[np.ndarray, " 2"]
    cell_m: float


@dataclass(frozen=True)
class SolidExtent:
    """The extent of the solid rock: its height above the floor, and its box in plan (west, south, east, north; m)."""

    height_m: float
    world_m: tuple[float, float, float, float]


@dataclass(frozen=True)
class Spawn:
    """Where robots start: the anchor, and the fallback region around the entrance (m, mine frame)."""

    anchor_m: tuple[float, float]
    anchor_clearance_m: float
    centre_m: tuple[float, float]
    radius_m: float
    clearance_m: float


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh with texture coordinates (m, mine frame; faces are counter-clockwise as seen by the viewer).

    `normals` are unit vectors, one a vertex; without them a renderer computes its own from this mesh alone.
    """

    vertices: Float64[np.ndarray, "n 3"]
    faces: Int32[np.ndarray, "m 3"]
    texcoords: Float64[np.ndarray, "n 2"]
    normals: Float64[np.ndarray, "n 3"] | None = None
