"""How far a scan's points are from the world's surface, seen from above and as colours of the 3D view."""

from __future__ import annotations

import cv2
import numpy as np
import trimesh
from scipy.spatial import cKDTree

from minexplore.bundle import ROOF
from pipeline.report.figures.scene import coloured
from pipeline.types import Frame, Image

DEVIATION = "deviation"  # in the names of the meshes that the 3D view shows in place of the others
_MOST_M = 0.1  # of the colours' scale
_GREY, _RED, _BLUE = np.array([200, 200, 200]), np.array([200, 30, 30]), np.array([30, 80, 200])  # RGB
_UNSEEN = np.array([235, 190, 40])
_LONGER, _SHORTER = np.array([220, 0, 220]), np.array([0, 0, 0])  # rays
_STRAY_M = 0.3  # by which a ray's range differs that is drawn
_BANDS = 5  # of colours to either side of none
_EDGE_M, _MOST_TRIANGLES = 0.5, 150_000  # of the 3D view
_DIM = 0.45  # of the colours: the lights of the 3D view are bright
_POINTS = 6  # whose mean colours a triangle
_LINE_PX, _LEAST_PX = 24, 800  # of the headline, and of the picture's width
_WHITE = 255
_ROOF = 2  # label of facets


def colours_of(off_m: np.ndarray) -> np.ndarray:
    """Return the colours (n, 3) RGB of deviations (n,) m: red in the rock, blue in the free space, grey at 0."""
    share = np.clip(off_m / _MOST_M, -1, 1)[:, None]
    return np.asarray(_GREY + np.where(share > 0, share * (_RED - _GREY), -share * (_BLUE - _GREY)))


def draw_deviation(
    points_m: np.ndarray,
    off_m: np.ndarray,
    unseen_m: np.ndarray,
    frame: Frame,
    figures: dict[str, float],
    rays: tuple[np.ndarray, np.ndarray, dict[str, float]] | None = None,
) -> Image:
    """Return the largest deviation of each place of the plan, and yellow where the surface was not seen.

    Ends of the scanner's rays are magenta where these are longer in the world by 30 cm, black where they are shorter.

    Parameters
    ----------
    points_m : (n, 3) float64, m, mine frame
    off_m : (n,) float64, m
        Positive in the rock.
    unseen_m : (k, 3) float64, m, mine frame
        Places on the surface far from all points.
    frame : Frame
        Of the plan.
    figures : dict
        Of `measure_scan`, for the headline.
    rays : (ends (r, 3) m, how much longer in the world (r,) m, figures of `measure_rays`), optional
    """
    picture = np.full((frame.height_px, frame.width_px, 3), _WHITE, np.uint8)
    _mark(picture, unseen_m, np.tile(_UNSEEN, (len(unseen_m), 1)), frame)
    order = np.argsort(np.abs(off_m))  # the largest is drawn last
    _mark(picture, points_m[order], colours_of(off_m[order]), frame)
    if rays is not None:
        ends, longer, _ = rays
        for stray, colour in ((longer > _STRAY_M, _LONGER), (longer < -_STRAY_M, _SHORTER)):
            _mark(picture, ends[stray], np.tile(colour, (int(stray.sum()), 1)), frame)
    times = -(-_LEAST_PX // frame.width_px)  # a small mine is enlarged
    picture = np.repeat(np.repeat(picture, times, axis=0), times, axis=1)
    lines = [
        f"red {100 * _MOST_M:.0f} cm in the rock, blue {100 * _MOST_M:.0f} cm in the free space, yellow not seen",
        f"points: {_shares(figures)}; mean {figures['mean_mm']:+.0f} mm; {100 * figures['seen_share']:.1f} % of the "
        "surface seen",
    ]
    if rays is not None:
        lines += _lines_of_rays(rays[2])
    head = np.full(((len(lines) + 1) * _LINE_PX, picture.shape[1], 3), _WHITE, np.uint8)
    for k, text in enumerate(lines, start=1):
        place = (_LINE_PX // 2, _LINE_PX * k)
        cv2.putText(head, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
    return np.concatenate([head, picture])


def _lines_of_rays(figures: dict[str, float]) -> list[str]:
    longer, shorter = (f"{100 * figures[name]:.2f} %" for name in ("through_share", "short_share"))
    lines = [
        f"rays of the scanner: {_shares(figures)}",
        f"longer by 30 cm, magenta: {longer}; shorter, black: {shorter}",
    ]
    if "worst_within_10cm" in figures:
        place = ", ".join(f"{figures[f'worst_{axis}_m']:.1f}" for axis in "xyz")
        lines[1] += f"; at worst {100 * figures['worst_within_10cm']:.1f} % within 10 cm, from near ({place})"
    return lines


def _shares(figures: dict[str, float]) -> str:
    return ", ".join(f"{100 * figures[f'within_{cm}cm']:.1f} % within {cm} cm" for cm in (5, 10, 30))


def _mark(picture: Image, points_m: np.ndarray, colours: np.ndarray, frame: Frame) -> None:
    """Colour (n, 3) RGB the pixels of points (n, 3) m, four for each."""
    places = np.floor(frame.to_image(points_m[:, :2])).astype(int)
    within = ((places >= 0) & (places < [frame.width_px, frame.height_px])).all(axis=1)
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        col = np.minimum(places[within, 0] + dx, frame.width_px - 1)
        row = np.minimum(places[within, 1] + dy, frame.height_px - 1)
        picture[row, col] = colours[within, ::-1].astype(np.uint8)


def add_deviation(
    scene: trimesh.Scene,
    vertices: np.ndarray,
    faces: np.ndarray,
    label: np.ndarray,
    points_m: np.ndarray,
    off_m: np.ndarray,
) -> None:
    """Add a volume's facets (f, 3) to a scene in its frame, in colours of the deviation of points (n, 3) m beside them.

    Facets are divided into triangles of half a metre, more in a large mine. One with no point within its size is
    yellow.
    """
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    edge = max(_EDGE_M, float(2 * np.sqrt(area / _MOST_TRIANGLES)))
    fine, triangles, of_facet = trimesh.remesh.subdivide_to_size(vertices, faces, edge, max_iter=20, return_index=True)
    corners = fine[triangles]
    far, near = cKDTree(points_m).query(corners.mean(axis=1), min(_POINTS, len(points_m)), distance_upper_bound=edge)
    found = np.isfinite(far.reshape(len(corners), -1))
    values = np.append(off_m, 0.0)[near.reshape(len(corners), -1)]
    mean = (values * found).sum(axis=1) / np.maximum(found.sum(axis=1), 1)
    band = np.round(_BANDS * np.clip(mean / _MOST_M, -1, 1)).astype(int)
    band[~found.any(axis=1)] = _BANDS + 1
    is_roof = label[of_facet] == _ROOF
    for k in np.unique(band).tolist():
        rgb = _DIM * (_UNSEEN if k > _BANDS else colours_of(np.array([k * _MOST_M / _BANDS]))[0])
        for own, name in ((~is_roof, DEVIATION), (is_roof, f"{ROOF}_{DEVIATION}")):
            some = corners[own & (band == k)].reshape(-1, 3)
            if len(some):
                mesh = coloured(some, np.arange(len(some)).reshape(-1, 3), tuple(np.round(rgb).astype(int).tolist()))
                scene.add_geometry(mesh, node_name=f"{name}_{k}", geom_name=f"{name}_{k}")
