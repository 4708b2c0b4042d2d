"""Which piece of level workings is built: the largest, or the one at a place that the user states."""

from __future__ import annotations

from pathlib import Path

import shapely
from shapely import MultiPolygon, Point, Polygon
from shapely.geometry.base import BaseGeometry

from minesurveys.errors import InputError, first_few
from minesurveys.remarks import warn_user
from pipeline.geometry.outline.enclosure import as_polygons
from pipeline.survey.passages.pieces import require_near
from pipeline.types import Piece


def choose_flat_piece(path: Path, built: BaseGeometry, piece: Piece | None) -> BaseGeometry:
    """Return the largest connected piece of workings, or the one at a place; a warning lists the others.

    Workings in one piece stay as they are.

    Parameters
    ----------
    path : Path
    built : shapely geometry, m, mine frame
    piece : (float, float, float), str or None
        Easting, northing and elevation, m; the elevation is ignored.

    Raises
    ------
    InputError
        If `piece` is the name of a station, which lines do not have, or no workings are near it.
    """
    if isinstance(piece, str):
        raise InputError(f"{path}: survey.piece = {piece!r:.60}: lines have no names; state a place by --piece E,N,0")
    pieces = sorted(as_polygons(built).geoms, key=lambda part: -part.area)
    if len(pieces) < 2:
        return built
    kept = pieces[0]
    if piece is not None:
        kept = min(pieces, key=lambda part: part.distance(Point(piece[:2])))
        require_near(path, piece, kept.distance(Point(piece[:2])), "the nearest drift")
    others = [part for part in pieces if part is not kept]
    left_m2 = float(sum(shapely.area(others)))
    warn_user(
        f"its lines make {len(pieces)} pieces that do not meet; built is the one of {kept.area:.0f} "
        f"m2 about {_about(kept)}, left out are {left_m2:.0f} m2; --snap M joins ends of lines nearer "
        "than M",
        of=path.name,
        option="--snap",
    )
    listed = first_few([f"{part.area:.0f} m2 about {_about(part)}" for part in others])
    warn_user(f"--piece (survey.piece) builds another piece: {listed}", of=path.name, option="--piece, survey.piece")
    return MultiPolygon([kept])


def _about(part: Polygon) -> str:
    place = part.representative_point()
    return f"{place.x:.1f},{place.y:.1f},0.0"
