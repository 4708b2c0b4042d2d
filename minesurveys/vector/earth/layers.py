"""Layers of KML and GPX files in memory, as GDAL (pyogrio) reads them."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import shapely
from shapely.geometry.base import BaseGeometry

from minesurveys.errors import InputError
from minesurveys.guard.plain_file import require_at_most
from minesurveys.guard.plain_xml import plain_name, read_plain_xml
from minesurveys.limits import reader_limits
from minesurveys.vector.level_fields import require_field, text_of
from minesurveys.vector.other_kinds import NO_GEOMETRY
from minesurveys.vector.shapes import Shapes, require_size

Shape = tuple[BaseGeometry, str, dict[str, Any]]  # with its layer and its properties


class MemoryLayers:
    """The layers of files in memory, as GDAL reads them; `only` are those that are looked at."""

    def __init__(
        self, path: Path, files: list[bytes], layers: list[str] | None, level_by: str | None, only: tuple[str, ...] = ()
    ) -> None:
        import pyogrio  # loads pandas, and few surveys are KML or GPX

        self.path, self.level_by = path, level_by
        self.fields: list[str] = []
        self.empty = 0
        existing = [
            (self._name(str(name)), data, number)
            for data in files
            for number, name in enumerate(pyogrio.list_layers(data)[:, 0])
            if not only or name in only
        ]
        names = list(dict.fromkeys(name for name, _, _ in existing))
        unknown = sorted(set(layers or []) - set(names))
        if unknown:
            raise InputError(f"{path}: no layer {', '.join(unknown)}; there are {', '.join(names)}")
        self.layers = [layer for layer in existing if layers is None or layer[0] in layers]

    def _name(self, name: str) -> str:
        """Return a layer's name; a document without one has that of a file in memory, another at each reading."""
        return self.path.stem if name.startswith("pyogrio_") else name

    def shapes(self) -> list[Shape]:
        """Return each shape with its layer and its properties."""
        from pyogrio.errors import DataLayerError, DataSourceError, FeatureError, GeometryError
        from pyogrio.raw import read

        found: list[Shape] = []
        most = reader_limits().shapes + 1
        # GDAL drops elevations of GPX else: findings/gpx-tracks-without-elevations.sh.
        options = {"ELE_AS_25D": "YES"} if self.path.suffix.lower() == ".gpx" else {}
        try:
            for layer, source, number in self.layers:
                meta, _, wkb, columns = read(source, layer=number, max_features=most, **options)
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

    def content(self, shown: list[Shape], others: dict[str, int]) -> Shapes:
        """Return the shapes that are read, with what else there is."""
        if self.empty:
            others = {**others, NO_GEOMETRY: self.empty}
        if self.level_by is not None:
            require_field(self.path, self.level_by, self.fields)
        levels = [layer if self.level_by is None else text_of(values.get(self.level_by)) for _, layer, values in shown]
        return Shapes([shape for shape, _, _ in shown], None, "EPSG:4326", levels, others, self.fields)


def root_of(path: Path, data: bytes, name: str) -> Element:
    """Return the root of a file's XML; one of another name is refused."""
    root = read_plain_xml(path, data)
    if plain_name(root).lower() != name:
        raise InputError(f"{path}: an XML file of {plain_name(root)[:40]!r}, no {name.upper()}")
    return root
