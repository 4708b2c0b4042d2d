"""Reader of KML and KMZ by GDAL (pyogrio): lines and areas in degrees, with elevations where these are some."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path

import numpy as np
import shapely

from minesurveys.errors import InputError
from minesurveys.guard.plain_file import read_text_bytes
from minesurveys.guard.plain_xml import plain_name
from minesurveys.limits import FILE, reader_limits
from minesurveys.remarks import warn_user
from minesurveys.vector.earth.layers import MemoryLayers, Shape, root_of
from minesurveys.vector.shapes import Shapes

_MODE, _SHOWN = "altitudeMode", "visibility"
_HIDDEN = "shapes that are not visible (--layer NAME reads them)"
_LINK = "NetworkLink"  # of KMZ mostly to another file in it, which is read
_ELSEWHERE = (_LINK, "GroundOverlay", "Model", "PhotoOverlay")
_MOST_MEMBERS = 10_000


def read_kml(path: Path, layers: list[str] | None, level_by: str | None = None) -> Shapes:
    """Read the lines and areas of a KML or KMZ file, a folder a layer; None reads all.

    Elevations count only where a shape's altitude mode is `absolute`: in the others they are heights above the ground,
    or none. GDAL gives them all: findings/kml-altitudes-that-do-not-count.sh. A shape that is not visible is read if
    its layer is named.

    Raises
    ------
    InputError
        If it is no KML, a layer or the property is unknown, or its shapes are in files that it names.

    References
    ----------
    OGC 12-007r2, "KML 2.3", altitudeMode and visibility.
    """
    is_zip = path.suffix.lower() == ".kmz"
    files = _kml_files(path) if is_zip else [read_text_bytes(path)]
    roots = [root_of(path, data, "kml") for data in files]
    found, modes = MemoryLayers(path, files, layers, level_by), 0
    shown: list[Shape] = []
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
            "shapes have heights that are no elevations (altitudeMode is not absolute); they are not read",
            of=path.name,
            count=modes,
        )
    elements = [plain_name(element) for root in roots for element in root.iter()]
    named = [name for name in _ELSEWHERE if name in elements and not (len(files) > 1 and name == _LINK)]
    others |= {name: elements.count(name) for name in named}
    return found.content(shown, others)


def _kml_files(path: Path) -> list[bytes]:
    """Return the KML files in a KMZ file, which may link to each other: findings/kmz-document-without-shapes.sh."""
    most, found, size = reader_limits().text_bytes, [], 0
    try:
        with zipfile.ZipFile(path) as archive:
            members = [one for one in archive.infolist()[:_MOST_MEMBERS] if one.filename.lower().endswith(".kml")]
            for member in members[: reader_limits().survex_files]:
                with archive.open(member) as stream:
                    found.append(stream.read(most - size + 1))
                size += len(found[-1])
                if size > most:
                    raise InputError(f"{path}: its KML is larger than {most:,} bytes, the limit (text_bytes in {FILE})")
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise InputError(f"{path}: cannot be read as KMZ; it is broken, cut off or encrypted") from error
    if not found:
        raise InputError(f"{path}: has no KML in it")
    return found
