"""Draw a mine as a drawing office does: walls or fill on paper with title block, legend, grid, labels and more.

The truth is known: the workings of a generated mine. Everything on it is chosen at random from its seed.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import shapely
from shapely import MultiPolygon, Polygon, affinity
from shapely.ops import substring

from minexplore.splits import STYLES
from pipeline.geometry.generated.generate import generate_workings
from pipeline.geometry.network.skeleton import trace_network
from pipeline.geometry.rasterize import fill_polygon
from pipeline.types import Frame, Image, Mask

WALLS = ("filled", "outlined fill", "hatched", "double lines", "double lines with gaps")
FURNITURE = {  # share of the drawings that have it
    "frame": 0.7,
    "title block": 0.7,
    "legend": 0.5,
    "logo": 0.4,
    "grid": 0.4,
    "north arrow": 0.6,
    "dimensions": 0.4,
    "labels": 0.6,
    "survey lines": 0.4,
    "rock hatching": 0.2,
    "scale bar": 0.9,
    "light on dark": 0.1,
    "JPEG": 0.3,
}
_LEVELS_SHARE = 0.06  # of drawings that show two or three levels
_BARS_M = (10, 20, 25, 50, 100)
_SHAPE = {"loops": 0.3, "dead_ends": 0.4, "rib_noise_m": 0.15, "pillar_m": 9.0, "spacing_m": 24.0, "wander": 0.5}
_FONTS = (cv2.FONT_HERSHEY_SIMPLEX, cv2.FONT_HERSHEY_DUPLEX, cv2.FONT_HERSHEY_COMPLEX)
_INK = (0, 0, 0)


@dataclass(frozen=True)
class PaperDrawing:
    """A drawing, the workings of each level in it (rows, cols), and what it shows."""

    picture: Image
    levels: list[Mask]
    px_per_m: float
    bar_m: int | None
    style: str
    walls: str
    furniture: list[str]


def draw_on_paper(seed: int) -> PaperDrawing:
    """Draw the mine of a seed on paper; styles and kinds of wall take turns."""
    rng = np.random.default_rng(seed)
    style, walls = STYLES[seed % len(STYLES)], WALLS[seed // len(STYLES) % len(WALLS)]
    shown = [name for name, share in FURNITURE.items() if rng.random() < share]
    count = int(rng.integers(2, 4)) if rng.random() < _LEVELS_SHARE else 1
    per_m = float(rng.uniform(5.0, 9.0))
    mines = [_mine(style, rng, 60.0 if count > 1 else 90.0) for _ in range(count)]
    pen = _Pen(rng, mines, per_m)
    if "grid" in shown:
        pen.draw_grid()
    if "rock hatching" in shown:
        pen.hatch_rock()
    for mine in pen.mines:
        pen.draw_mine(mine, walls)
    for name, draw in (
        ("survey lines", pen.draw_survey_lines),
        ("labels", pen.write_labels),
        ("dimensions", pen.draw_dimensions),
        ("north arrow", pen.draw_north),
        ("legend", lambda: pen.draw_legend(walls)),
        ("title block", lambda: pen.draw_title("logo" in shown)),
        ("frame", pen.draw_frame),
    ):
        if name in shown:
            draw()
    if count > 1:
        pen.caption_levels()
    bar_m = pen.draw_bar() if "scale bar" in shown else None
    picture = 255 - pen.paper if "light on dark" in shown else pen.paper
    if "JPEG" in shown:
        picture = np.asarray(
            cv2.imdecode(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 85])[1], cv2.IMREAD_COLOR)
        )
    levels = [fill_polygon(mine, pen.frame) for mine in pen.mines]
    return PaperDrawing(picture, levels, per_m, bar_m, style, walls, shown)


def _mine(style: str, rng: np.random.Generator, side_m: float) -> Polygon:
    width = float(rng.uniform(3.5, 5.5))
    shape = _SHAPE | {"loops": float(rng.uniform(0.0, 0.6))}
    mine = generate_workings(style, rng, (0.8 * side_m, 1.2 * side_m), (width - 0.5, width + 0.5), **shape)
    return max(mine.geoms, key=lambda part: part.area)


class _Pen:
    """Draws on paper: the mines stand side by side; a strip below them and one to their right hold the rest."""

    def __init__(self, rng: np.random.Generator, mines: list[Polygon], per_m: float) -> None:
        self.rng, self.per_m = rng, per_m
        gap, self.mines, east = 14.0, [], 0.0
        for mine in mines:
            west, south, right, _ = mine.bounds
            self.mines.append(affinity.translate(mine, east - west, -south))
            east += right - west + gap
        self.all = MultiPolygon(self.mines)
        _, _, east, north = self.all.bounds
        self.edge, self.strip, self.column = 46, 150, 190
        width = int(east * per_m) + 2 * self.edge + self.column
        height = int(north * per_m) + 2 * self.edge + self.strip
        self.frame = Frame(per_m, self.edge, height - self.edge - self.strip, max(width, 640), height)
        self.paper = np.full((self.frame.height_px, self.frame.width_px, 3), 255, np.uint8)
        self.stroke = int(rng.integers(1, 4))
        self.font = _FONTS[rng.integers(len(_FONTS))]
        self.fill = int(rng.integers(40, 200))

    def line(self, points: np.ndarray, colour: tuple = _INK, thick: int = 1, closed: bool = False) -> None:
        """Draw a line through image points, to a sixteenth of a pixel."""
        fixed = np.round((np.asarray(points, float) - 0.5) * 16).astype(np.int32)
        cv2.polylines(self.paper, [fixed], closed, colour, thick, cv2.LINE_AA, shift=4)

    def write(self, text: str, at: tuple[float, float], height_px: float, colour: tuple = _INK) -> None:
        """Write text whose lower left corner is at an image point."""
        scale = cv2.getFontScaleFromHeight(self.font, max(7, round(height_px)))
        cv2.putText(self.paper, text, (round(at[0]), round(at[1])), self.font, scale, colour, 1, cv2.LINE_AA)

    def place(self, xy: np.ndarray) -> np.ndarray:
        """Return image points of points in metres."""
        return self.frame.to_image(np.asarray(xy)[:, :2])

    def draw_mine(self, mine: Polygon, walls: str) -> None:
        """Draw a mine's workings: filled, hatched, or its walls only."""
        inside = fill_polygon(mine, self.frame)
        if walls in ("filled", "outlined fill"):
            self.paper[inside] = self.fill if walls == "filled" else (self.fill + 255) // 2
        if walls == "hatched":
            self._hatch(inside, int(self.rng.integers(5, 9)))
        for ring in (mine.exterior, *mine.interiors):
            points = self.place(np.asarray(ring.coords))
            if walls == "double lines with gaps":
                self._line_with_gaps(points)
            elif walls != "filled":
                self.line(points, thick=self.stroke, closed=True)

    def _hatch(self, inside: Mask, step: int) -> None:
        rows, cols = np.indices(inside.shape)
        side = 1 if self.rng.random() < 0.5 else -1
        self.paper[inside & ((rows + side * cols) % step < 1)] = 60

    def _line_with_gaps(self, points: np.ndarray) -> None:
        """Leave a gap of up to 1 m every 15 m or so."""
        line = shapely.LineString(points)
        at = np.sort(self.rng.uniform(0, line.length, max(1, round(line.length / (15 * self.per_m)))))
        start = 0.0
        for place in at:
            end = place + self.rng.uniform(0.3, 1.0) * self.per_m
            if place > start + 4:
                piece = substring(line, start, place)
                self.line(np.asarray(piece.coords), thick=self.stroke)
            start = end
        if start < line.length:
            self.line(np.asarray(substring(line, start, line.length).coords), thick=self.stroke)

    def draw_grid(self) -> None:
        """Draw grid lines with their coordinates at the margin."""
        step = float(self.rng.choice([20, 25, 50])) * self.per_m
        grey = (int(self.rng.choice([90, 150, 200])),) * 3
        rows, cols = self.paper.shape[:2]
        bottom, right = rows - self.strip - 10, cols - self.column - 10
        left, top = self.edge + self.rng.uniform(0.0, 0.9 * step, 2)
        for k, col in enumerate(np.arange(left, right, step)):
            self.line(np.array([[col, 12], [col, bottom]]), grey)
            self.write(f"{4200 + 50 * k}E", (col + 2, 22), 7)
        for k, row in enumerate(np.arange(top, bottom, step)):
            self.line(np.array([[12, row], [right, row]]), grey)
            self.write(f"{8150 - 50 * k}N", (14, row - 2), 7)

    def hatch_rock(self) -> None:
        """Draw short strokes in the rock near the walls."""
        near = self.all.buffer(4.0).difference(self.all.buffer(1.0))
        points = self.place(_random_points(near, round(near.area / 4), self.rng))
        for point in points:
            self.line(np.array([point, point + np.array([6, -6])]), (120, 120, 120))

    def draw_survey_lines(self) -> None:
        """Draw the survey's legs and stations along the drifts: in colour, or black, dashed or not."""
        colour, dashed = [((0, 0, 220), False), ((200, 60, 0), False), (_INK, True), (_INK, False)][
            self.rng.integers(4)
        ]
        for mine in self.mines:
            for leg in trace_network(mine, 0.5, 2.0, 6.0).legs:
                stations = self.place(np.array(leg.stations_m))
                if dashed:
                    self._dashes(stations)
                else:
                    self.line(stations, colour)
                for col, row in stations[::2]:
                    cv2.circle(self.paper, (round(col), round(row)), 2, colour, 1, cv2.LINE_AA)

    def _dashes(self, points: np.ndarray) -> None:
        line = shapely.LineString(points)
        for at in np.arange(0, line.length - 5, 9):
            self.line(np.asarray(substring(line, at, at + 5).coords))

    def write_labels(self) -> None:
        """Write names into the drifts; some cross a wall."""
        colour = [_INK, (0, 0, 200), (255, 255, 255)][self.rng.integers(3 if self.fill < 120 else 2)]
        for mine in self.mines:
            for k, point in enumerate(self.place(_random_points(mine.buffer(-1.2), 6, self.rng))):
                self.write(f"{self.rng.choice(['DR', 'XC', 'LVL '])}{k + 1}", (point[0] - 10, point[1] + 4), 9, colour)

    def draw_dimensions(self) -> None:
        """Draw dimension lines with arrows and a measure: one along the mine, some across drifts."""
        west, _, east, north = self.all.bounds
        self._dimension(self.place(np.array([[west, north + 3.0], [east, north + 3.0]])), f"{east - west:.1f}")
        for point in _random_points(self.mines[0].buffer(-1.0), 4, self.rng):
            self._dimension(self.place(np.array([point - np.array([6, 0]), point + np.array([6, 0])])), "4.5")

    def _dimension(self, ends: np.ndarray, text: str) -> None:
        self.line(ends)
        for end, side in ((ends[0], 1), (ends[1], -1)):
            self.line(end + np.array([[6 * side, -3], [0, 0], [6 * side, 3]]))
        middle = ends.mean(axis=0)
        self.write(text, (middle[0] - 12, middle[1] - 3), 8)

    def draw_north(self) -> None:
        """Draw an arrow with the letter N in the right column."""
        col, row = self.paper.shape[1] - self.column / 2, 90.0
        cv2.fillPoly(self.paper, [np.array([[col, row - 40], [col - 12, row + 20], [col, row + 8]], np.int32)], _INK)
        self.line(np.array([[col, row - 40], [col + 12, row + 20], [col, row + 8]]), closed=True)
        cv2.circle(self.paper, (round(col), round(row)), 44, _INK, 1, cv2.LINE_AA)
        self.write("N", (col - 6, row - 48), 14)

    def draw_legend(self, walls: str) -> None:
        """Draw a box with samples and words in the right column."""
        col, row = self.paper.shape[1] - self.column + 16, 165
        cv2.rectangle(self.paper, (col, row), (col + 150, row + 120), _INK, 1)
        self.write("LEGEND", (col + 40, row + 18), 10)
        for k, name in enumerate(("workings", "survey leg", "station")):
            top = row + 32 + 28 * k
            box = np.array([[col + 10, top], [col + 40, top], [col + 40, top + 14], [col + 10, top + 14]])
            if k == 0:
                inside = np.zeros(self.paper.shape[:2], bool)
                inside[top : top + 14, col + 10 : col + 40] = True
                if walls in ("filled", "outlined fill"):
                    self.paper[inside] = self.fill if walls == "filled" else (self.fill + 255) // 2
                elif walls == "hatched":
                    self._hatch(inside, 6)
                self.line(box, closed=True)
            elif k == 1:
                self.line(box[[0, 2]])
            else:
                cv2.circle(self.paper, (col + 25, top + 7), 4, _INK, 1, cv2.LINE_AA)
            self.write(name, (col + 50, top + 11), 8)

    def draw_title(self, logo: bool) -> None:
        """Draw a title block at the lower right: a table of words, with a logo."""
        rows, cols = self.paper.shape[:2]
        left, top, right, bottom = cols - 330, rows - 128, cols - 16, rows - 16
        cv2.rectangle(self.paper, (left, top), (right, bottom), _INK, 2)
        for row in (top + 40, top + 76):
            self.line(np.array([[left, row], [right, row]]))
        self.line(np.array([[left + 130, top + 40], [left + 130, bottom]]))
        self.write("MINA EL EJEMPLO S.A.", (left + 70, top + 26), 12)
        for k, text in enumerate(("Plan of workings", "Level 240", "Scale 1:500", "Sheet 3 of 7")):
            self.write(text, (left + 10 + 134 * (k % 2), top + 62 + 36 * (k // 2)), 8)
        if logo:
            cv2.circle(self.paper, (left + 32, top + 20), 15, (150, 60, 0), -1, cv2.LINE_AA)
            cv2.rectangle(self.paper, (left + 24, top + 14), (left + 40, top + 26), (255, 255, 255), -1)

    def draw_frame(self) -> None:
        """Draw a border of one or two lines round the drawing."""
        rows, cols = self.paper.shape[:2]
        for inset, thick in ((6, 2), (11, 1))[: int(self.rng.integers(1, 3))]:
            cv2.rectangle(self.paper, (inset, inset), (cols - 1 - inset, rows - 1 - inset), _INK, thick)

    def caption_levels(self) -> None:
        """Write a caption below each level."""
        for k, mine in enumerate(self.mines):
            west, south, _, _ = mine.bounds
            (col, row), *_ = self.place(np.array([[west, south - 3.0]]))
            self.write(f"LEVEL {k + 1}", (col, row + 12), 12)

    def draw_bar(self) -> int:
        """Draw a scale bar at the lower left, plain or in alternating pieces, with its length beside it."""
        fitting = [m for m in _BARS_M if 60 <= m * self.per_m <= 260] or [20]
        length = int(self.rng.choice(fitting))
        left, top, wide = 40, self.paper.shape[0] - 60, round(length * self.per_m)
        if self.rng.random() < 0.5:
            self.paper[top : top + 7, left : left + wide] = 0
        else:
            cv2.rectangle(self.paper, (left, top), (left + wide - 1, top + 6), _INK, 1)
            for k in range(0, 4, 2):
                self.paper[top : top + 7, left + k * wide // 4 : left + (k + 1) * wide // 4] = 0
        self.write("0", (left - 4, top - 8), 9)
        self.write(f"{length} m", (left + wide - 12, top - 8), 9)
        return length


def _random_points(area: shapely.Geometry, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return `count` points (n, 2) m in an area."""
    west, south, east, north = area.bounds
    found = np.zeros((0, 2))
    while len(found) < count:
        tried = rng.uniform((west, south), (east, north), (4 * count + 50, 2))
        found = np.vstack([found, tried[shapely.contains_xy(area, tried)]])
    return found[:count]
