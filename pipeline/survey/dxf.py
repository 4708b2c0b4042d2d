"""Reader of DXF drawings: polylines, lines, arcs and splines. Blocks are resolved."""

from __future__ import annotations

import re
from itertools import islice
from pathlib import Path

from ezdxf import disassemble
from ezdxf.document import Drawing
from ezdxf.filemanagement import readfile
from ezdxf.lldxf.const import DXFError
from shapely import LineString

from pipeline.errors import InputError
from pipeline.survey.shapes import Shapes, read_text_bytes

_UNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m"}  # $INSUNITS
_CHORD_SHARE = 1e-4  # largest distance between a curve and its chords, as a share of the drawing's size
_MAX_ENTITIES = 100_000
_ENTITY = re.compile(rb"^[ \t]*0[ \t]*\r?$", re.MULTILINE)  # each entity begins with group code 0
_DRAWN = ("LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE")


def read_dxf(path: Path, layers: list[str] | None) -> Shapes:
    """Read the lines of the given layers; None reads all layers.

    Returns
    -------
    Shapes
        Lines in drawing units. The unit is `$INSUNITS` if it is in, ft, mm, cm or m, else None.

    Raises
    ------
    InputError
        If the file is not DXF, holds more than 100,000 entities, or a layer is unknown. The message lists the layers.
    """
    count = len(_ENTITY.findall(read_text_bytes(path)))
    if count > _MAX_ENTITIES:
        raise InputError(
            f"{path}: {count} entities and tables, the limit is {_MAX_ENTITIES}; save only the plan's layers"
        )
    try:
        drawing = readfile(path)
        existing = {layer.dxf.name for layer in drawing.layers} | {e.dxf.layer for e in drawing.modelspace()}
        lines = _lines(path, drawing, layers)
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: not a DXF drawing ({error.strerror or error})") from error
    except (
        DXFError,
        ValueError,
        TypeError,
        KeyError,
        IndexError,
        AttributeError,
        RecursionError,
        ArithmeticError,
        StopIteration,
    ) as error:
        raise InputError(f"{path}: not a readable DXF drawing ({type(error).__name__}: {str(error)[:120]})") from error
    unknown = sorted(set(layers or []) - existing)
    if unknown and not lines:
        raise InputError(f"{path}: no layer {', '.join(unknown)}; there are {', '.join(sorted(existing))}")
    return Shapes(list(lines), _UNITS.get(int(drawing.header.get("$INSUNITS", 0))))


def _lines(path: Path, drawing: Drawing, layers: list[str] | None) -> list[LineString]:
    entities = list(islice(disassemble.recursive_decompose(drawing.modelspace()), _MAX_ENTITIES + 1))
    if len(entities) > _MAX_ENTITIES:
        raise InputError(f"{path}: more than {_MAX_ENTITIES} entities with blocks resolved")
    kept = [e for e in entities if e.dxftype() in _DRAWN and (layers is None or e.dxf.layer in layers)]
    paths = [p.path for p in disassemble.to_primitives(kept) if p.path is not None and len(p.path)]
    vertices = [point for p in paths for point in p.control_vertices()]
    if not vertices:
        return []
    size = max(max(v[k] for v in vertices) - min(v[k] for v in vertices) for k in (0, 1))
    lines = []
    for p in paths:
        points = [(v.x, v.y) for v in p.flattening(max(size * _CHORD_SHARE, 1e-9), segments=4)]
        if len(set(points)) > 1:
            lines.append(LineString(points))
    return lines
