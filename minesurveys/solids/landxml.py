"""Reader of LandXML: the triangulated surfaces of survey and civil engineering programs.

No library reads them; the format has two lists a surface, points and faces.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from minesurveys.errors import InputError
from minesurveys.guard.plain_number import plain_number
from minesurveys.guard.plain_xml import plain_name, read_plain_xml
from minesurveys.remarks import warn_user
from minesurveys.solids.polygons import triangles_of
from minesurveys.solids.stated_metres import LayerMesh, StatedMeshes

LANDXML = (".xml", ".landxml")
_LENGTHS_M = {
    "millimeter": 0.001, "centimeter": 0.01, "meter": 1.0, "kilometer": 1000.0, "inch": 0.0254, "foot": 0.3048,
    "USSurveyFoot": 1200 / 3937, "mile": 1609.344,
}  # fmt: skip
_HEIGHTS_M = {"meter": 1.0, "kilometer": 1000.0, "miles": 1609.344}
_FEET = (_LENGTHS_M["foot"], _LENGTHS_M["USSurveyFoot"])
_NOT_READ = {"CgPoints", "Alignments", "Parcels", "PipeNetworks", "PlanFeatures", "Roadways", "Survey"}


def read_landxml(path: Path, data: bytes) -> StatedMeshes:
    """Read the surfaces of a LandXML file, each a layer by its name.

    Coordinates are northing, easting and elevation, in the unit that the file states for lengths; elevations have the
    unit that it states for them. Faces that are marked invisible (`i="1"`) close the outline of a triangulation and are
    no part of the surface.

    Raises
    ------
    InputError
        If the file is no LandXML, has no surface with faces or only such as close no space, or a point or a face is
        broken.

    References
    ----------
    LandXML-1.2, elements Units, Surface, Definition, Pnts, P, Faces and F.
    """
    found, metres = _surfaces(path, data)
    if all(_faces_one_way(mesh) for mesh in found):
        raise InputError(
            f"{path}: its surfaces are those of a floor or a terrain, and close no space; --heights reads it with a "
            "plan in the same coordinates"
        )
    return StatedMeshes(found, metres)


def read_landxml_floor(path: Path, data: bytes) -> tuple[np.ndarray, np.ndarray, float | None]:
    """Return the corners (n, 3) and triangles (m, 3) of all surfaces, in the unit of lengths, and metres a unit.

    The last is None if the file states no unit.

    Raises
    ------
    InputError
        As `read_landxml`; a floor is read.
    """
    found, metres = _surfaces(path, data)
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in found)])
    faces = [start + mesh.faces for start, mesh in zip(starts, found, strict=False)]
    return np.concatenate([mesh.vertices for mesh in found]), np.concatenate(faces), metres


def _surfaces(path: Path, data: bytes) -> tuple[list[LayerMesh], float | None]:
    """Return the surfaces with faces, in the unit of lengths, and metres a unit if stated."""
    root = read_plain_xml(path, data)
    if plain_name(root) != "LandXML":
        raise InputError(f"{path}: an XML file of {plain_name(root)[:40]!r}; of XML LandXML alone is read")
    metres, up_metres = _units(path, root)
    found, hidden = [], 0
    for surface in (element for element in root.iter() if plain_name(element) == "Surface"):
        mesh, left_out = _surface(path, surface, up_metres / (metres or 1.0))
        hidden += left_out
        found += [mesh] if mesh is not None else []
    if not found:
        raise InputError(f"{path}: has no surface with faces (<Surface>, <Faces>); export the surface, not its points")
    if hidden:
        warn_user("faces are marked invisible and are left out", of=path.name, count=hidden)
    others = sorted({plain_name(child) for child in root} & _NOT_READ)
    if others:
        warn_user(f"its surfaces are read; {', '.join(others)} are not", of=path.name)
    return found, metres


def _faces_one_way(mesh: LayerMesh) -> bool:
    """Return whether all faces of a mesh show upwards, or all downwards, as those of a floor do."""
    corners = mesh.vertices[mesh.faces]
    up = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    return bool((up > 0).all() or (up < 0).all())


def _units(path: Path, root: Element) -> tuple[float | None, float]:
    """Return metres a unit of lengths, None if none is stated, and of elevations."""
    units = next((child for element in root if plain_name(element) == "Units" for child in element), None)
    if units is None:
        return None, 1.0
    stated = units.get("linearUnit", "")
    if stated not in _LENGTHS_M:
        raise InputError(f"{path}: <Units> states linearUnit={stated[:40]!r}; want {', '.join(_LENGTHS_M)}")
    metres, of_heights = _LENGTHS_M[stated], units.get("elevationUnit", "")
    if not of_heights or (of_heights == "feet" and metres in _FEET):  # programs write "feet" beside either foot
        return metres, metres
    up_metres = {**_HEIGHTS_M, "feet": _LENGTHS_M["foot"]}.get(of_heights)
    if up_metres is None:
        raise InputError(
            f"{path}: <Units> states elevationUnit={of_heights[:40]!r}; want feet, {', '.join(_HEIGHTS_M)}"
        )
    if up_metres != metres:
        warn_user(f"lengths are in {stated}, elevations in {of_heights}; each axis has its own unit", of=path.name)
    return metres, up_metres


def _surface(path: Path, surface: Element, up_scale: float) -> tuple[LayerMesh | None, int]:
    """Return the mesh of a surface, None if it has no faces, and how many faces are invisible."""
    name = (surface.get("name") or "surface")[:200]
    points = [element for element in surface.iter() if plain_name(element) == "P"]
    faces = [element for element in surface.iter() if plain_name(element) == "F"]
    shown = [face for face in faces if face.get("i") != "1"]
    if not shown:
        return None, len(faces)
    places = [_numbers(path, name, point, 3) for point in points]
    vertices = np.array(places, np.float64).reshape(-1, 3)[:, [1, 0, 2]] * [1, 1, up_scale]
    row = {(point.get("id") or "").strip(): number for number, point in enumerate(points)}
    if len(row) < len(points):
        raise InputError(f"{path}: surface {name!r}: two points have one id, or a point has none")
    rings = [(face.text or "").split() for face in shown]
    unknown = next((corner for ring in rings for corner in ring if corner not in row), None)
    if unknown is not None:
        raise InputError(f"{path}: surface {name!r}: a face of point {unknown[:20]!r}, which it does not have")
    corners = np.array([row[corner] for ring in rings for corner in ring], np.int64)
    triangles = triangles_of(vertices, corners, np.array([len(ring) for ring in rings]))
    return LayerMesh(name, vertices, triangles), len(faces) - len(shown)


def _numbers(path: Path, name: str, element: Element, count: int) -> list[float]:
    words = (element.text or "").split()
    try:
        numbers = [plain_number(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) != count:
        where = f"{path}: surface {name!r}: point {element.get('id', '')[:20]!r}"
        raise InputError(f"{where}: {' '.join(words)[:60]!r} is no northing, easting and elevation")
    return numbers
