"""Reader of GPX by GDAL (pyogrio): routes and tracks in degrees, with their elevations."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element

import shapely

from minesurveys.guard.plain_file import read_text_bytes
from minesurveys.guard.plain_xml import plain_name
from minesurveys.remarks import warn_user
from minesurveys.vector.earth.layers import MemoryLayers, root_of
from minesurveys.vector.shapes import Shapes

_LINES_OF_GPX = {"routes": ("rte", "rtept"), "tracks": ("trk", "trkpt")}  # their points are layers of GDAL's too


def read_gpx(path: Path, layers: list[str] | None, level_by: str | None = None) -> Shapes:
    """Read the routes and tracks of a GPX file with their elevations.

    A line with a point that has none is read without. Waypoints are counted.

    Raises
    ------
    InputError
        If it is no GPX, or a layer or the property is unknown.

    References
    ----------
    Topografix, "GPX 1.1 Schema": ele is in metres.
    """
    data = read_text_bytes(path)
    root = root_of(path, data, "gpx")
    found, shown, flat = MemoryLayers(path, [data], layers, level_by, only=tuple(_LINES_OF_GPX)), [], 0
    measured = {layer: iter(_have_elevations(root, *names)) for layer, names in _LINES_OF_GPX.items()}
    for shape, layer, values in found.shapes():
        has_elevations = next(measured[layer], False)
        flat += not has_elevations
        shown.append((shape if has_elevations else shapely.force_2d(shape), layer, values))
    if flat and flat < len(shown):
        warn_user(
            "lines have points without an elevation; they are read without any",
            of=path.name,
            count=f"{flat} of {len(shown)}",
        )
    waypoints = sum(plain_name(child) == "wpt" for child in root)
    return found.content(shown, {"waypoints": waypoints} if waypoints else {})


def _have_elevations(root: Element, line: str, point: str) -> list[bool]:
    """Return whether all points of each line have an elevation."""
    lines = [element for element in root if plain_name(element) == line]
    points = [[child for child in element.iter() if plain_name(child) == point] for element in lines]
    return [all(any(plain_name(value) == "ele" for value in one) for one in own) for own in points]
