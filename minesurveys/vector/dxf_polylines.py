"""What a DXF file states beside the points of its polylines: which are the frame of a curve, and which ways close."""

from __future__ import annotations

from pathlib import Path

from ezdxf.document import Drawing
from ezdxf.entities.polyline import Polyline, Polymesh
from ezdxf.render.mesh import MeshBuilder
from ezdxf.units import unit_name

from minesurveys.frames import Unit
from minesurveys.remarks import warn_user

_FRAME_POINT = 16  # flag of a vertex: it controls a fitted curve or surface, and lies beside it
_UNITS: dict[int, Unit] = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 21: "ft", 22: "in"}  # $INSUNITS; the US survey
# foot and inch are longer by 2e-6, 2 cm in the 10 km that a survey may reach
_IN_INCHES = (3, 4)  # of $LUNITS, engineering and architectural: the drawing's unit is an inch
_ENGLISH = ("ft", "in")


def drop_frame_points(drawing: Drawing) -> None:
    """Take the points that only control a fitted curve or surface out of all polylines and polygon meshes.

    References
    ----------
    Autodesk, DXF Reference, VERTEX: group code 70, flag 16 (spline frame control point); POLYLINE: 73 and 74
    """
    for block in drawing.blocks:
        for entity in block:
            if isinstance(entity, Polyline):
                _drop_frame_points(entity)


def _drop_frame_points(polyline: Polyline) -> None:
    kept = [vertex for vertex in polyline.vertices if not vertex.dxf.flags & _FRAME_POINT]
    if not kept or len(kept) == len(polyline.vertices):  # the frame alone is all that there is
        return
    polyline.vertices[:] = kept
    if polyline.is_polygon_mesh:
        polyline.dxf.m_count, polyline.dxf.n_count = polyline.dxf.m_smooth_density, polyline.dxf.n_smooth_density


def mesh_of_polygon_mesh(entity: Polymesh) -> MeshBuilder:
    """Return the faces between the rows and columns of a polygon mesh, and those that close it along M and N.

    ezdxf leaves out the latter: findings/ezdxf-closed-polygon-mesh-left-open.sh.
    """
    rows, columns = entity.dxf.m_count, entity.dxf.n_count
    mesh = MeshBuilder()
    mesh.vertices = [vertex.dxf.location for vertex in entity.vertices]
    mesh.faces = [
        (i * columns + j, i * columns + b, a * columns + b, a * columns + j)
        for i, a in _next(rows, entity.is_m_closed)
        for j, b in _next(columns, entity.is_n_closed)
    ]
    return mesh


def _next(count: int, is_closed: bool) -> list[tuple[int, int]]:
    return [(k, (k + 1) % count) for k in range(count if is_closed else count - 1)]


def unit_of(path: Path, drawing: Drawing) -> Unit | None:
    """Return the unit that a drawing states, None if it states none or one that is not read, with a warning."""
    if drawing.modelspace().get_geodata() is not None:
        warn_user(
            "states its place on the Earth (GEODATA), which is not read; coordinates are the drawing's", of=path.name
        )
    code = int(drawing.header.get("$INSUNITS", 0))
    if code and code not in _UNITS:
        warn_user(
            f"states its unit as {unit_name(code)} ($INSUNITS = {code}), which is not read; scale it "
            "to metres in CAD, or --unit states m, cm, mm, ft or in",
            of=path.name,
            option="--unit",
        )
    unit = _UNITS.get(code)
    shown = int(drawing.header.get("$LUNITS", 2))
    what, way = "", "in"
    if shown in _IN_INCHES and unit not in _ENGLISH:
        what = f"shows lengths in feet and inches ($LUNITS = {shown})"
    elif code == 0 and int(drawing.header.get("$MEASUREMENT", 1)) == 0:
        what, way = "is drawn in English units ($MEASUREMENT = 0)", "ft"
    if what:
        stated = f"the unit {unit}" if unit else "no unit ($INSUNITS)"
        warn_user(
            f"states {stated} and {what}, which changes nothing; --unit {way} reads it so",
            of=path.name,
            option="--unit",
        )
    return unit
