"""Reader of KML, KMZ and GPX by GDAL (pyogrio): lines and areas in degrees, with elevations where the file has them."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pipeline.errors import InputError
from pipeline.guard.plain_file import read_text_bytes, require_at_most
from pipeline.guard.plain_xml import plain_name, read_plain_xml
from pipeline.guard.reading_process import warn_user
from pipeline.params.reader_limits import FILE, reader_limits
from pipeline.survey.vector.level_fields import require_field, text_of
from pipeline.survey.vector.other_kinds import NO_GEOMETRY
from pipeline.survey.vector.shapes import Shapes, require_size

_LINES_OF_GPX = {"routes": ("rte", "rtept"), "tracks": ("trk", "trkpt")}  # their points are layers of GDAL's too
_MODE, _SHOWN = "altitudeMode", "visibility"
_HIDDEN = "shapes that are not visible (--layer NAME reads them)"
_ELSEWHERE = ("NetworkLink", "GroundOverlay", "Model", "PhotoOverlay")
_MOST_MEMBERS = 10_000
_Shape = tuple[BaseGeometry, str, dict[str, Any]]  # with its layer and its properties


def read_kml(path: Path, layers: list[str] | None, level_by: str | None = None) -> Shapes:
    """Read the lines and areas of a KML or KMZ file, a folder a layer; None reads all.

    Elevations count only where a shape's altitude mode is `absolute`: in the others they are heights above the ground,
    or none. A shape that is not visible is read if its layer is named.

    Raises
    ------
    InputError
        If it is no KML, a layer or the property is unknown, or its shapes are in files that it names.

    References
    ----------
    OGC 12-007r2, "KML 2.3", altitudeMode and visibility.
    """
    data = _main_kml(path) if path.suffix.lower() == ".kmz" else read_text_bytes(path)
    root = _root(path, data, "kml")
    found, modes = _Layers(path, data, layers, level_by), 0
    shown: list[_Shape] = []
    others: dict[str, int] = {}
    for shape, layer, values in found.shapes():
        if values.get(_SHOWN) == 0 and layers is None:
            others[_HIDDEN] = others.get(_HIDDEN, 0) + 1
            continue
        if shape.has_z and values.get(_MODE) != "absolute":
            modes += int(np.any(shapely.get_coordinates(shape, include_z=True)[:, 2] != 0))
            shape = shapely.force_2d(shape)
        shown.append((shape, layer, values))
    if modes:
        warn_user(
            f"{path.name}: {modes} shapes have heights that are no elevations (altitudeMode is not absolute); they are "
            "not read"
        )
    elements = [plain_name(element) for element in root.iter()]
    others |= {name: elements.count(name) for name in _ELSEWHERE if name in elements}
    return found.content(shown, others)


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
    root = _root(path, data, "gpx")
    found, shown, flat = _Layers(path, data, layers, level_by, only=tuple(_LINES_OF_GPX)), [], 0
    measured = {layer: iter(_have_elevations(root, *names)) for layer, names in _LINES_OF_GPX.items()}
    for shape, layer, values in found.shapes():
        has_elevations = next(measured[layer], False)
        flat += not has_elevations
        shown.append((shape if has_elevations else shapely.force_2d(shape), layer, values))
    if flat and flat < len(shown):
        warn_user(
            f"{path.name}: {flat} of {len(shown)} lines have points without an elevation; they are read without any"
        )
    waypoints = sum(plain_name(child) == "wpt" for child in root)
    return found.content(shown, {"waypoints": waypoints} if waypoints else {})


class _Layers:
    """The layers of a file in memory, as GDAL reads them."""

    def __init__(
        self, path: Path, data: bytes, layers: list[str] | None, level_by: str | None, only: tuple[str, ...] = ()
    ) -> None:
        import pyogrio  # loads pandas, and few surveys are KML or GPX

        self.path, self.data, self.level_by = path, data, level_by
        self.fields: list[str] = []
        self.empty = 0
        existing = [str(name) for name in pyogrio.list_layers(data)[:, 0]]
        existing = [name for name in existing if not only or name in only]
        unknown = sorted(set(layers or []) - set(existing))
        if unknown:
            raise InputError(f"{path}: no layer {', '.join(unknown)}; there are {', '.join(existing)}")
        self.layers = layers or existing

    def shapes(self) -> list[_Shape]:
        """Return each shape with its layer and its properties."""
        from pyogrio.errors import DataLayerError, DataSourceError, FeatureError, GeometryError
        from pyogrio.raw import read

        found: list[_Shape] = []
        most = reader_limits().shapes + 1
        options = {"ELE_AS_25D": "YES"} if self.path.suffix.lower() == ".gpx" else {}  # else GDAL drops elevations
        try:
            for layer in self.layers:
                meta, _, wkb, columns = read(self.data, layer=layer, max_features=most, **options)
                names = [str(name) for name in meta["fields"]]
                self.fields += [name for name in names if name not in self.fields]
                require_at_most(self.path, len(found) + len(wkb), "shapes", "shapes or more")
                for row, data in enumerate(wkb):
                    values = {name: column[row] for name, column in zip(names, columns, strict=True)}
                    self.empty += data is None
                    if data is not None:
                        found.append((shapely.from_wkb(data), layer, values))
        except (DataSourceError, DataLayerError, FeatureError, GeometryError, shapely.GEOSException) as error:
            raise InputError(f"{self.path}: GDAL cannot read it; save it again in the program that made it") from error
        require_size(self.path, int(shapely.get_num_coordinates([shape for shape, _, _ in found]).sum()))
        return found

    def content(self, shown: list[_Shape], others: dict[str, int]) -> Shapes:
        """Return the shapes that are read, with what else there is."""
        if self.empty:
            others = {**others, NO_GEOMETRY: self.empty}
        if self.level_by is not None:
            require_field(self.path, self.level_by, self.fields)
        levels = [layer if self.level_by is None else text_of(values.get(self.level_by)) for _, layer, values in shown]
        return Shapes([shape for shape, _, _ in shown], None, "EPSG:4326", levels, others, self.fields)


def _have_elevations(root: Element, line: str, point: str) -> list[bool]:
    """Return whether all points of each line have an elevation."""
    lines = [element for element in root if plain_name(element) == line]
    points = [[child for child in element.iter() if plain_name(child) == point] for element in lines]
    return [all(any(plain_name(value) == "ele" for value in one) for one in own) for own in points]


def _root(path: Path, data: bytes, name: str) -> Element:
    root = read_plain_xml(path, data)
    if plain_name(root).lower() != name:
        raise InputError(f"{path}: an XML file of {plain_name(root)[:40]!r}, no {name.upper()}")
    return root


def _main_kml(path: Path) -> bytes:
    """Return the KML in a KMZ file: `doc.kml`, or the first one."""
    most = reader_limits().text_bytes
    try:
        with zipfile.ZipFile(path) as archive:
            members = [
                member for member in archive.infolist()[:_MOST_MEMBERS] if member.filename.lower().endswith(".kml")
            ]
            if not members:
                raise InputError(f"{path}: has no KML in it")
            main = next((member for member in members if member.filename.lower() == "doc.kml"), members[0])
            with archive.open(main) as stream:
                data = stream.read(most + 1)
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise InputError(f"{path}: cannot be read as KMZ; it is broken, cut off or encrypted") from error
    if len(data) > most:
        raise InputError(
            f"{path}: {main.filename[:80]} is larger than {most:,} bytes, the limit (text_bytes in {FILE})"
        )
    if len(members) > 1:
        warn_user(
            f"{path.name}: {main.filename[:80]} is read; it holds {len(members) - 1} other KML files, which are not"
        )
    return data
