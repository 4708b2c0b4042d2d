"""The floor of a mine: a triangle mesh in plan with a height at each vertex, which folds the plan into space.

Everything in a world is made in the plan, with z measured from the floor. Folding adds the floor's height. Where
workings pass over each other, the plan is drawn by level: each sheet, a piece of floor that is single-valued in plan,
is moved aside by its offset, and folding moves it back. A flat mine has a floor without triangles, which folds nothing.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from minexplore.floors.stretch import KNEE_M, lower_m, raise_m
from minexplore.tiles import Tile, group_by_tile, tiles_at

_TILE_M = 4.0  # faces are looked up by square tiles of the plan
_SEAM_M = 12.0  # edges of two sheets that are nearer than this belong to one seam
_BETWEEN_M = 2.5  # a point whose height above a sheet is so far from the expected one is not the sheet's
_SURE_M = 1.0  # one that is nearer than this is: floors over each other are farther apart than twice that
_SLIVER_M = 0.05  # a sliver is thinner and rises less
_COVER_SHARE = 1e-9  # of a face's size: so far beyond its edge a place is still on it
_CHUNK = 2_000_000  # pairs of a place and a triangle that are tried at once


@dataclass(frozen=True)
class Floor:
    """A floor: `vertices` (n, 3) m, plan; `faces` (m, 3), counter-clockwise in plan; the sheet of each face.

    `offset_m` (sheets, 2) is how far each sheet is moved aside in plan; the first is not moved. `stretch` (n,) is how
    much the plan is stretched upwards at each vertex, above `KNEE_M`; without it the roof is level with the floor.
    """

    vertices: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    faces: np.ndarray = field(default_factory=lambda: np.zeros((0, 3), np.int32))
    sheet: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))
    offset_m: np.ndarray = field(default_factory=lambda: np.zeros((1, 2)))
    stretch: np.ndarray = field(default_factory=lambda: np.zeros(0), metadata={"optional": True})

    @property
    def is_flat(self) -> bool:
        """Return whether the floor is the plane of the plan."""
        return not len(self.faces)

    @functools.cached_property
    def planes(self) -> np.ndarray:
        """Return each face's plane (m, 3): z = a x + b y + c."""
        return self.planes_of(self.vertices[:, 2])

    def planes_of(self, values: np.ndarray) -> np.ndarray:
        """Return the plane (m, 3) over each face of values (n,) at the vertices."""
        places = np.concatenate([self.vertices[self.faces][:, :, :2], np.ones((len(self.faces), 3, 1))], axis=2)
        return np.linalg.solve(places, values[self.faces][:, :, None])[:, :, 0]

    @property
    def is_stretched(self) -> bool:
        """Return whether the roof has heights of its own."""
        return bool(len(self.stretch))

    def raised(self, above_m: float) -> Floor:
        """Return what is at a height above the floor in the plan, such as the roof, as a floor."""
        if self.is_flat:
            return self
        lift = raise_m(above_m, self.stretch) if self.is_stretched else above_m
        return replace(
            self, vertices=self.vertices + np.column_stack(np.broadcast_arrays(0.0, 0.0, lift)), stretch=np.zeros(0)
        )

    def filled(self, outlines_m: Iterable[np.ndarray]) -> Floor:
        """Return the floor with faces over convex holes (k, 2) m, plan, whose corners are vertices of it.

        Faces keep their numbers; those over holes come last.
        """
        faces, sheets = [self.faces], [self.sheet]
        for outline in outlines_m:
            corners = [int(np.abs(self.vertices[:, :2] - corner).max(axis=1).argmin()) for corner in outline]
            made = np.array([(corners[0], b, c) for b, c in itertools.pairwise(corners[1:])], self.faces.dtype)
            faces.append(made)
            sheets.append(np.full(len(made), self.sheets_at(np.mean(outline, axis=0)[None])[0], self.sheet.dtype))
        return self if len(faces) == 1 else replace(self, faces=np.concatenate(faces), sheet=np.concatenate(sheets))

    def lifts_m(self, height_m: float) -> np.ndarray:
        """Return how much higher (n,) m over each vertex the roof is than `height_m`, at which the plan has it."""
        return (height_m - KNEE_M) * (self.stretch - 1) if self.is_stretched else np.zeros(len(self.vertices))

    def lifts_at(self, places_m: np.ndarray, height_m: float) -> np.ndarray:
        """Return how much higher (k,) m over the floor the roof is than `height_m` at places (k, 2) m of the plan."""
        return (height_m - KNEE_M) * (self.stretch_at(places_m) - 1)

    def stretch_at(self, places_m: np.ndarray) -> np.ndarray:
        """Return how much (k,) the plan is stretched at places (k, 2) m of the plan; 1 if it is not."""
        if self.is_flat or not self.is_stretched:
            return np.ones(len(places_m))
        return self._stretch_on(self.faces_at(places_m), places_m)

    @functools.cached_property
    def _stretches(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the plane (m, 3) of each face's stretch, and its least and its most."""
        corners = self.stretch[self.faces]
        return self.planes_of(self.stretch), corners.min(axis=1), corners.max(axis=1)

    def _stretch_on(self, faces: np.ndarray, places_m: np.ndarray) -> np.ndarray:
        """Return how much (k,) the plan is stretched over faces (k,) at places (k, 2) m."""
        planes, low, high = self._stretches
        a, b, c = planes[faces].T
        return np.clip(a * places_m[:, 0] + b * places_m[:, 1] + c, low[faces], high[faces])

    def _above(self, faces: np.ndarray, places_m: np.ndarray, z_m: np.ndarray) -> np.ndarray:
        """Return how high (k,) m over faces points at heights (k,) m of the mine frame are in the plan."""
        above = z_m - self._heights_on(faces, places_m)
        return lower_m(above, self._stretch_on(faces, places_m)) if self.is_stretched else above

    def steepness_deg(self) -> np.ndarray:
        """Return the angle (m,) deg between each face and the level; 0 for slivers, which a robot does not notice."""
        corners = self.vertices[self.faces]
        sides = (np.roll(corners, -1, axis=1) - corners)[:, :, :2]
        twice_m2 = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
        thin = twice_m2 < _SLIVER_M * np.linalg.norm(sides, axis=2).max(axis=1)
        steep = np.degrees(np.arctan(np.hypot(self.planes[:, 0], self.planes[:, 1])))
        return np.where(thin & (np.ptp(corners[:, :, 2], axis=1) < _SLIVER_M), 0.0, steep)

    @functools.cached_property
    def _to_barycentric(self) -> np.ndarray:
        corners = self.vertices[self.faces]
        places = np.concatenate([corners[:, :, :2], np.ones((len(corners), 3, 1))], axis=2)
        return np.linalg.inv(np.swapaxes(places, 1, 2))

    @functools.cached_property
    def _corner_heights_m(self) -> np.ndarray:
        return self.vertices[self.faces, 2]

    @functools.cached_property
    def _near(self) -> dict[Tile, np.ndarray]:
        return {}

    @functools.cached_property
    def _boxes(self) -> tuple[np.ndarray, np.ndarray]:
        corners = self.vertices[self.faces, :2]
        return corners.min(axis=1), corners.max(axis=1)

    @functools.cached_property
    def levels_m(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the lowest and the highest corner (m,) m of each face."""
        corners = self.vertices[self.faces, 2]
        return corners.min(axis=1), corners.max(axis=1)

    @functools.cached_property
    def _middles(self) -> np.ndarray:
        return self.vertices[self.faces].mean(axis=1)[:, :2]

    def _faces_near(self, tile: Tile) -> np.ndarray:
        """Return the faces whose boxes meet a tile."""
        if tile not in self._near:
            low = np.array(tile) * _TILE_M
            axis, order, starts, longest = self._along
            first = np.searchsorted(starts, low[axis] - longest)
            some = order[first : np.searchsorted(starts, low[axis] + _TILE_M, side="right")]
            least, most = (box[some] for box in self._boxes)
            self._near[tile] = np.sort(some[((least <= low + _TILE_M) & (most >= low)).all(axis=1)])
        return self._near[tile]

    @functools.cached_property
    def _along(self) -> tuple[int, np.ndarray, np.ndarray, float]:
        """Return the longer axis of the plan, the faces by their boxes along it, the boxes' starts, and the longest."""
        least, most = self._boxes
        axis = int(np.ptp(least, axis=0).argmax())
        order = np.argsort(least[:, axis], kind="stable")
        return axis, order, least[order, axis], float((most - least)[:, axis].max())

    def faces_at(self, places_m: np.ndarray) -> np.ndarray:
        """Return the number of the face (k,) at each place (k, 2) m of the plan, or of one near it if none is there."""
        found = np.zeros(len(places_m), dtype=int)
        for tile, rows in group_by_tile(tiles_at(places_m, _TILE_M)):
            faces = self._faces_near(tile)
            if not len(faces):  # far from the floor
                for some in _chunks(len(rows), len(self.faces)):
                    apart = np.abs(self._middles[None] - places_m[rows[some]][:, None]).sum(axis=2)
                    found[rows[some]] = apart.argmin(axis=1)
                continue
            places = np.column_stack([places_m[rows], np.ones(len(rows))])
            for some in _chunks(len(rows), len(faces)):
                weights = np.einsum("fij,kj->ikf", self._to_barycentric[faces], places[some])
                found[rows[some]] = faces[np.minimum(np.minimum(*weights[:2]), weights[2]).argmax(axis=1)]
        return found

    def heights_at(self, places_m: np.ndarray) -> np.ndarray:
        """Return the floor's height (k,) m at places (k, 2) m of the plan; zero on a flat floor.

        Beside the floor it is between the heights of the corners of a face nearby.
        """
        return np.zeros(len(places_m)) if self.is_flat else self._heights_on(self.faces_at(places_m), places_m)

    def _heights_on(self, faces: np.ndarray, places_m: np.ndarray) -> np.ndarray:
        """Return the heights (k,) m of faces (k,) at places (k, 2) m, between those of their corners."""
        a, b, c = self.planes[faces].T
        low, high = self.levels_m
        return np.clip(a * places_m[:, 0] + b * places_m[:, 1] + c, low[faces], high[faces])

    def heights_within(self, low_m: np.ndarray, high_m: np.ndarray) -> np.ndarray:
        """Return the heights of all corners of faces that meet a box of the plan, or of the face nearest to it."""
        least, most = self._boxes
        faces = np.flatnonzero(((least <= high_m) & (most >= low_m)).all(axis=1))
        faces = faces if len(faces) else self.faces_at((low_m + high_m)[None] / 2)
        return self.vertices[np.unique(self.faces[faces]), 2]

    def frame_at(self, place_m: np.ndarray) -> np.ndarray:
        """Return axes (3, 3), as columns, on the floor at a place (2,) m: along x, left of it, the floor's normal."""
        if self.is_flat:
            return np.eye(3)
        a, b, _ = self.planes[self.faces_at(place_m[None])[0]]
        normal = np.array([-a, -b, 1.0]) / np.sqrt(a * a + b * b + 1)
        ahead = np.array([1.0, 0.0, a]) / np.sqrt(1 + a * a)
        return np.column_stack([ahead, np.cross(normal, ahead), normal])

    @functools.cached_property
    def spans_m(self) -> np.ndarray:
        """Return the lowest and the highest floor (sheets, 2) m of each sheet."""
        levels = [self.vertices[self.faces[self.sheet == k].ravel(), 2] for k in range(len(self.offset_m))]
        return np.array([(level.min(), level.max()) for level in levels])

    def box_of(self, sheet: int, origin_m: np.ndarray, cell_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the first cell and that behind the last (2,) east and north of a box about a sheet, in a grid's cells.

        The grid begins at `origin_m`; the box has a cell or two round the sheet.
        """
        cells = (self.vertices[self.faces[self.sheet == sheet].ravel(), :2] - origin_m) / cell_m
        return np.floor(cells.min(axis=0)).astype(int) - 1, np.ceil(cells.max(axis=0)).astype(int) + 1

    def offsets_at(self, places_m: np.ndarray) -> np.ndarray:
        """Return how far (k, 2) m the sheets at places (k, 2) m of the plan are moved aside."""
        return self.offset_m[self.sheets_at(places_m)]

    def sheets_at(self, places_m: np.ndarray) -> np.ndarray:
        """Return the number of the sheet (k,) about each place (k, 2) m of the plan."""
        row_of = np.searchsorted(self._borders[0], places_m[:, 1])
        found = np.zeros(len(places_m), dtype=np.int64)
        for number, (row, borders) in enumerate(zip(self.rows, self._borders[1], strict=True)):
            own = row_of == number
            found[own] = row.start + np.searchsorted(borders, places_m[own, 0])
        return found

    def places_at(self, places_m: np.ndarray) -> np.ndarray:
        """Return which sheet of its row and which row (k, 2) is about each place (k, 2) m of the plan, from 0."""
        sheet, starts = self.sheets_at(places_m), np.array([row.start for row in self.rows])
        row = np.searchsorted(starts, sheet, side="right") - 1
        return np.column_stack([sheet - starts[row], row])

    @functools.cached_property
    def boxes_m(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the south-west and the north-east corner (sheets, 2) m of the box about each sheet in plan."""
        low, high = np.full((len(self.offset_m), 2), np.inf), np.full((len(self.offset_m), 2), -np.inf)
        corners, sheet = self.vertices[self.faces.ravel(), :2], np.repeat(self.sheet, 3)
        np.minimum.at(low, sheet, corners)
        np.maximum.at(high, sheet, corners)
        return low, high

    @functools.cached_property
    def rows(self) -> list[range]:
        """Return the numbers of the sheets in each row, from the south; in a row they lie from west to east."""
        low, high = self.boxes_m
        starts = [0, *(np.flatnonzero(low[1:, 0] <= high[:-1, 0]) + 1).tolist(), len(self.offset_m)]
        return [range(a, b) for a, b in itertools.pairwise(starts)]

    @functools.cached_property
    def _borders(self) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return the northings half-way between neighbouring rows, and each row's eastings between its sheets, m."""
        low, high = self.boxes_m
        between = [(high[list(a), 1].max() + low[list(b), 1].min()) / 2 for a, b in itertools.pairwise(self.rows)]
        return np.array(between), [(high[row[:-1], 0] + low[row[1:], 0]) / 2 for row in map(np.array, self.rows)]

    @functools.cached_property
    def edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners (3 m, 2) of each face's edges, and the edge (3 m,) of the face beyond it, -1 at a wall.

        Edge k is of face k % m. Edges that two sheets share lie beyond each other.
        """
        edges = np.concatenate([self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]]).astype(np.int64)
        number, count = self._joined[edges], len(self.vertices)
        own, turned = (number[:, k] * count + number[:, 1 - k] for k in (0, 1))
        order = np.argsort(own, kind="stable")
        other = order[np.searchsorted(own[order], turned, side="right") - 1]
        return edges, np.where(own[other] == turned, other, -1)

    def wall_edges(self) -> list[tuple[int, tuple[int, int]]]:
        """Return the face and the corners of each edge on the boundary; edges that two sheets share are none."""
        edges, beyond = self.edges
        return [
            (k % len(self.faces), (int(edges[k, 0]), int(edges[k, 1]))) for k in np.flatnonzero(beyond < 0).tolist()
        ]

    @functools.cached_property
    def _joined(self) -> np.ndarray:
        """Return a number (n,) for each vertex, the same for those of two sheets at one place of the mine frame.

        Ends of seams have four decimals and their middles may have a fifth, 5. Moving them by a quarter of a step keeps
        both off the borders of rounding, where the last bit of a subtraction would part them.
        """
        if len(self.offset_m) == 1:
            return np.arange(len(self.vertices))
        sheet = np.zeros(len(self.vertices), dtype=int)
        sheet[self.faces.ravel()] = np.repeat(self.sheet, 3)
        places = self.vertices.copy()
        places[:, :2] -= self.offset_m[sheet]
        return np.unique((places + 2.5e-5).round(4), axis=0, return_inverse=True)[1].reshape(-1)

    def seam_edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the two sheets (k, 2) of each edge that two share, and its corners in both plans (k, 2, 2, 2) m."""
        (edges, beyond), sheet = self.edges, np.tile(self.sheet, 3)
        one = np.flatnonzero((beyond >= 0) & (sheet[beyond] > sheet))
        two = beyond[one]
        corners = np.stack([self.vertices[edges[one], :2], self.vertices[edges[two][:, ::-1], :2]], axis=1)
        return np.column_stack([sheet[one], sheet[two]]), corners

    def seams(self) -> np.ndarray:
        """Return the middle of each seam (k, 2, 2) m in the plan of both its sheets."""
        middles: dict[tuple[int, int, int], list[np.ndarray]] = {}
        for number, ((one, two), corners) in enumerate(zip(*self.seam_edges(), strict=True)):
            pair = corners.mean(axis=1)
            for key, found in middles.items():  # the edges of one seam lie on one line, end to end
                if key[:2] == (one, two) and any(np.hypot(*(f[0] - pair[0])) < _SEAM_M for f in found):
                    found.append(pair)
                    break
            else:
                middles[int(one), int(two), number] = [pair]
        return np.array([np.mean(found, axis=0) for found in middles.values()]).reshape(-1, 2, 2)

    def wall_segments(self) -> np.ndarray:
        """Return the walls (k, 2, 2) m in plan; the seams between sheets are none."""
        return np.array([self.vertices[list(edge), :2] for _, edge in self.wall_edges()])

    def fold(self, points_m: np.ndarray) -> np.ndarray:
        """Return points (k, 3) m of the plan, z from the floor, in the mine frame."""
        if self.is_flat:
            return points_m
        places, above = points_m[:, :2], points_m[:, 2]
        if self.is_stretched:
            above = raise_m(above, self.stretch_at(places))
        return np.column_stack([places - self.offsets_at(places), above + self.heights_at(places)])

    def unfold(self, points_m: np.ndarray, about_m: float = 1.0) -> np.ndarray:
        """Return points (k, 3) m of the mine frame in the plan, z from the floor.

        Of the sheets above and below a point, it belongs to the one whose floor is most nearly `about_m` below it.
        """
        if self.is_flat:
            return points_m
        if len(self.offset_m) == 1:
            return np.column_stack([points_m[:, :2], self._above_at(points_m[:, :2], points_m[:, 2])])
        best = np.full((len(points_m), 3), np.inf)
        z, found = points_m[:, 2], np.zeros(len(points_m), dtype=bool)
        for number, (offset, (low, high)) in enumerate(zip(self.offset_m, self._spans_about(about_m), strict=True)):
            rows = np.flatnonzero((z > low) & (z < high) & ~found)
            if not len(rows):
                continue
            places = points_m[rows, :2] + offset
            faces = self.faces_at(places)
            above = self._above(faces, places, z[rows])
            off = np.abs(above - about_m)
            nearer = (off < np.minimum(np.abs(best[rows, 2] - about_m), _BETWEEN_M)) & (self.sheet[faces] == number)
            nearer &= self._covers(faces, places)
            best[rows[nearer]] = np.column_stack([places, above])[nearer]
            found[rows[nearer & (off < _SURE_M)]] = True
        lost = np.flatnonzero(~np.isfinite(best[:, 2]))
        if len(lost):  # beside the floor: of the sheet with the nearest corner
            corners = self.raised(about_m).vertices[self.faces[:, 0]]
            corners[:, :2] -= self.offset_m[self.sheet]
            for k in lost.tolist():
                nearest = np.square(corners - points_m[k]).sum(axis=1).argmin()
                place = points_m[k, :2] + self.offset_m[self.sheet[nearest]]
                best[k] = *place, self._above_at(place[None], points_m[k, 2:])[0]
        return best

    def _above_at(self, places_m: np.ndarray, z_m: np.ndarray) -> np.ndarray:
        return z_m if self.is_flat else self._above(self.faces_at(places_m), places_m, z_m)

    def _spans_about(self, about_m: float) -> np.ndarray:
        """Return from where to where (sheets, 2) m a sheet's points at about a height above it can be."""
        ends_m = about_m + np.array([-_BETWEEN_M, _BETWEEN_M])
        if self.is_stretched:
            ends_m = raise_m(ends_m, np.array([self.stretch.min(), self.stretch.max()]))
        return np.asarray(self.spans_m + ends_m)

    def follow(self, points_m: np.ndarray, faces: np.ndarray, about_m: float) -> np.ndarray:
        """Return the places (k, 2) m in plan of points (k, 3) m that move; see `unfold`.

        `faces` (k,) are those under the points before. A point that is still over its face is not looked for; the
        others' faces are brought up to date.
        """
        places = points_m[:, :2] + self.offset_m[self.sheet[faces]]
        lost = np.flatnonzero(~self._are_on(faces, places, points_m[:, 2], about_m))
        if len(lost):  # most often over the next face of the same sheet
            before, faces[lost] = self.sheet[faces[lost]], self.faces_at(places[lost])
            found = self._are_on(faces[lost], places[lost], points_m[lost, 2], about_m)
            lost = lost[~found | (self.sheet[faces[lost]] != before)]
        if len(lost):
            places[lost] = self.unfold(points_m[lost], about_m)[:, :2]
            faces[lost] = self.faces_at(places[lost])
        return places

    def _are_on(self, faces: np.ndarray, places_m: np.ndarray, z_m: np.ndarray, about_m: float) -> np.ndarray:
        """Return whether faces (k,) cover places (k, 2) m, and heights (k,) m are about so high above them."""
        shares = self._shares(faces, places_m)
        above = z_m - (shares * self._corner_heights_m[faces]).sum(axis=1)
        if self.is_stretched:
            above = lower_m(above, self._stretch_on(faces, places_m))
        return np.asarray((shares.min(axis=1) > -_COVER_SHARE) & (np.abs(above - about_m) < _SURE_M))

    def unfold_bodies(self, bodies_m: list[np.ndarray], about_m: float = 1.0) -> list[np.ndarray]:
        """Return the points (k, 3) m of each body in the plan of the sheet that its middle belongs to."""
        if not bodies_m:
            return []
        middles, count = np.array([points.mean(axis=0) for points in bodies_m]), [len(points) for points in bodies_m]
        moved = np.repeat((self.unfold(middles, about_m) - middles)[:, :2], count, axis=0)
        points = np.concatenate(bodies_m)
        places = points[:, :2] + moved
        unfolded = np.column_stack([places, self._above_at(places, points[:, 2])])
        return np.split(unfolded, np.cumsum(count)[:-1])

    def covers(self, places_m: np.ndarray) -> np.ndarray:
        """Return whether there is floor (k,) at places (k, 2) m of the plan, to a centimetre or so."""
        return self._covers(self.faces_at(places_m), places_m, 0.01)

    def _covers(self, faces: np.ndarray, places_m: np.ndarray, slack: float = _COVER_SHARE) -> np.ndarray:
        """Return whether faces (k,) cover places (k, 2) m, to a share of their size."""
        return np.asarray(self._shares(faces, places_m).min(axis=1) > -slack)

    def _shares(self, faces: np.ndarray, places_m: np.ndarray) -> np.ndarray:
        """Return the barycentric coordinates (k, 3) in faces (k,) of places (k, 2) m of the plan."""
        to = self._to_barycentric[faces]
        return np.asarray(to[:, :, 0] * places_m[:, :1] + to[:, :, 1] * places_m[:, 1:] + to[:, :, 2])


def _chunks(places: int, faces: int) -> list[slice]:
    """Return slices of so many places that, together with all faces, make about `_CHUNK` pairs."""
    step = _CHUNK // faces + 1
    return [slice(start, start + step) for start in range(0, places, step)]
