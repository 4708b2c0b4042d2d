"""What a vector file holds beside lines and polygons, and the way on where it holds neither."""

from __future__ import annotations

from pathlib import Path

from minesurveys.errors import InputError, first_few, one_line
from minesurveys.remarks import warn_user
from minesurveys.vector.shapes import Shapes

MULTIPATCH, NO_GEOMETRY, POINT = "multipatch (TIN, polyhedral surface)", "shapes without geometry", "points"
XREF = "external reference"  # before its name
_SURFACES = ("3DFACE", "MESH", "polyface mesh", "polygon mesh", MULTIPATCH)
_SOLIDS = ("3DSOLID", "BODY", "REGION", "SURFACE", "EXTRUDEDSURFACE", "LOFTEDSURFACE", "PLANESURFACE", "SWEPTSURFACE")
_FILLS = ("HATCH", "MPOLYGON", "SOLID", "TRACE")
_PICTURES = ("IMAGE", "PDFUNDERLAY", "DGNUNDERLAY", "DWFUNDERLAY", "OLE2FRAME")
_WAYS = (
    (_SURFACES[:-1], "--volume reads them as a solid of the workings"),
    (
        _SURFACES[-1:] + _SOLIDS,
        "these surfaces and solids are not read: save them as triangles (3DFACE, OBJ, STL), or cut them at the height "
        "of the floor in the program that made them, and save the outline as closed lines or polygons",
    ),
    (_FILLS, "areas that are only filled are not read: draw their boundaries (HATCHGENERATEBOUNDARY)"),
    (_PICTURES, "a picture or a PDF on a drawing is not read: give that file to --from"),
    (("ACAD_PROXY_ENTITY",), "objects of a CAD program's extension are not read: explode them there, and save again"),
    ((XREF,), "the drawings that it refers to are not in the file: bind the external references (XREF) in CAD"),
    ((POINT, "POINT"), "points are no walls: --heights FILE reads them as heights of another plan's floor"),
)


def warn_of_others(path: Path, content: Shapes) -> None:
    """Warn of what a file holds beside lines and polygons: it is not read.

    Raises
    ------
    InputError
        If the file holds nothing else; the message lists the kinds, and how such a file becomes lines.
    """
    if content.shapes:
        if content.others:
            warn_user(f"not read, as they are no lines or areas: {_listed(content.others)}", of=path.name)
        return
    if content.others:
        found = {XREF if kind.startswith(XREF) else kind for kind in content.others}
        ways = (way for kinds, way in _WAYS if found & set(kinds))
        way = next(ways, "draw the walls as lines or polygons")
        raise InputError(f"{path}: holds no polygons and no lines, only {_listed(content.others)}; {way}")
    if path.suffix.lower() == ".dxf":
        raise InputError(
            f"{path}: holds no polygons and no lines in the model space and the chosen layers; a plan on a layout "
            "(paper space) is not read: copy it to the model space"
        )


def _listed(others: dict[str, int]) -> str:
    kinds = sorted(others, key=lambda kind: (-others[kind], kind))
    return first_few([f"{others[kind]} {one_line(kind, 40)}" for kind in kinds])
