"""Reader of DXF drawings: polylines, lines, arcs and splines. Blocks are resolved."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import shapely
from ezdxf import disassemble
from ezdxf.document import Drawing
from ezdxf.entities.dxfentity import DXFEntity
from ezdxf.entities.insert import Insert
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.entities.mtext import MText
from ezdxf.entities.polyline import Polyline
from ezdxf.entities.text import Text
from ezdxf.filemanagement import readfile
from ezdxf.lldxf.const import DXFError
from ezdxf.math import Vec3
from ezdxf.path import Path as DrawnPath
from ezdxf.path import make_path
from shapely import LineString, Point

from minesurveys.coordinates.strays import require_together
from minesurveys.errors import InputError
from minesurveys.frames import METRES
from minesurveys.guard.plain_file import read_text_bytes, require_at_most
from minesurveys.guard.plain_number import plain_number
from minesurveys.limits import FILE, reader_limits
from minesurveys.remarks import warn_user
from minesurveys.vector.dxf_blocks import absent_drawings, count_kinds, mend_blocks, shown
from minesurveys.vector.dxf_polylines import drop_frame_points, unit_of
from minesurveys.vector.other_kinds import XREF
from minesurveys.vector.shapes import LARGEST, REACH_M, Shapes, require_size

_SMALLEST = "mm"  # unit of drawings
_CHORD_SHARE = 1e-4  # largest distance between a curve and its chords, as a share of the drawing's size
_BEZIERS = 16  # of a turn, at least: one for a quarter is off (findings/ezdxf-arcs-off-whatever-the-distance.sh)
_ENTITY = re.compile(rb"^[ \t]*0[ \t]*\r?$", re.MULTILINE)  # each entity begins with group code 0
_POINT = re.compile(rb"^[ \t]*10[ \t]*\r?$", re.MULTILINE)  # a point begins with group code 10
_HEIGHT = re.compile(r"\s*([-+]?\d{1,6}[.,]\d{1,6})\s*m?\s*", re.ASCII)  # a label; whole numbers name stations
_DRAWN = ("LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE")
_RELEASE = re.compile(rb"\$ACADVER\s+1\s+([\w.]{1,12})")
_RELEASES = {"AC1004": "9", "AC1006": "10", "AC1009": "12", "AC1012": "13", "AC1014": "14", "AC1015": "2000"}
READING_ERRORS = (
    DXFError,
    ValueError,
    TypeError,
    KeyError,
    IndexError,
    AttributeError,
    RecursionError,
    ArithmeticError,
    StopIteration,
    RuntimeError,  # an iterator of ezdxf that ends within another
)


def read_dxf(path: Path, layers: list[str] | None, with_heights: bool = False) -> Shapes:
    """Read the lines of the given layers; None reads all that are shown, neither off nor frozen.

    `with_heights` adds the points of all layers, and a point at each text that is a decimal number, its height.

    Returns
    -------
    Shapes
        Lines in drawing units. The unit is `$INSUNITS` if it is in, ft, mm, cm or m, else None. Of curves that were
        fitted to a polyline the points of the curve are read, not those of its frame.

    Raises
    ------
    InputError
        If the file is not DXF, exceeds a limit on entities, blocks or points, or a layer is unknown. The message lists
        the layers.
    """
    data = read_text_bytes(path)
    require_at_most(path, len(_ENTITY.findall(data)), "dxf_entities", "entities and tables")
    require_at_most(path, len(_POINT.findall(data)), "points", "points or more")
    try:
        drawing = readfile(path)
        _require_block_size(path, drawing)
        existing = {layer.dxf.name for layer in drawing.layers} | {e.dxf.layer for e in drawing.modelspace()}
        found = _lines(path, drawing, layers)
        heights = _heights(path, drawing) if with_heights else []
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: not a DXF drawing; does it begin with the section HEADER or ENTITIES?") from error
    except READING_ERRORS as error:
        raise InputError(f"{path}: {_unreadable(data)}") from error
    unknown, lines = sorted(set(layers or []) - existing), found.lines
    if unknown and not lines:
        raise InputError(f"{path}: no layer {', '.join(unknown)}; there are {', '.join(sorted(existing))}")
    unit = unit_of(path, drawing)
    points = shapely.get_coordinates([line for line, _ in lines])
    cure = "erase what lies there, or choose layers by --layer NAME"
    require_together(path, points, REACH_M / METRES[unit or _SMALLEST], "points", cure)
    layer_of = [layer for _, layer in lines] + [""] * len(heights)
    return Shapes([*(line for line, _ in lines), *heights], unit, layer_of=layer_of, others=found.others)


def _heights(path: Path, drawing: Drawing) -> list[Point]:
    """Return the points of a drawing, and its texts that are decimal numbers: each the height at its insertion point.

    A decimal comma counts as a point. `InputError` if a coordinate is absurd.
    """
    found: list[Point] = []
    for entity in islice(disassemble.recursive_decompose(drawing.modelspace()), reader_limits().dxf_entities):
        if entity.dxftype() not in ("POINT", "TEXT", "MTEXT"):
            continue
        _require_plain_numbers(path, entity)
        if entity.dxftype() == "POINT":
            found.append(Point(tuple(entity.dxf.location)))
        elif isinstance(entity, Text | MText) and (number := _HEIGHT.fullmatch(str(entity.plain_text()))):
            x, y = entity.dxf.insert.vec2
            found.append(Point(x, y, plain_number(number[1].replace(",", "."))))
    return found


def _unreadable(data: bytes) -> str:
    """Return why a drawing is refused that the library cannot read."""
    found = _RELEASE.search(data[:100_000])
    version = found[1].decode() if found else ""
    release = f", of release {_RELEASES.get(version, version)}" if version else ""
    return (
        f"not a readable DXF drawing{release}: its entities or blocks are damaged, or of a kind that no other program "
        "writes; open it in a CAD program, audit it, and save it as DXF of release 2007 or later"
    )


def _require_plain_numbers(path: Path, entity: DXFEntity) -> None:
    """Refuse an entity with a coordinate, radius or angle that is absurd or not finite."""
    for name, value in entity.dxfattribs().items():
        numbers = value if isinstance(value, Vec3 | tuple) else (value,) if isinstance(value, float) else ()
        if not all(abs(number) < LARGEST for number in numbers):
            raise InputError(f"{path}: {name} = {value} of a {entity.dxftype()}, expected numbers below {LARGEST:g}")


def _require_block_size(path: Path, drawing: Drawing) -> None:
    """Refuse blocks that contain themselves, are nested too deep, or hold too many entities once resolved.

    The entities are counted from the references, because resolving nested empty blocks can take for ever.
    """
    most, deepest = reader_limits().dxf_entities, reader_limits().dxf_block_depth
    sizes: dict[str, int] = {}

    def size_of(name: str, outer: tuple[str, ...]) -> int:
        name = name.lower()  # names differ in more than case
        if name in outer:
            raise InputError(f"{path}: block {name[:60]!r} contains itself")
        if len(outer) > deepest:
            raise InputError(
                f"{path}: blocks are nested more than {deepest} deep, the limit (dxf_block_depth in {FILE})"
            )
        if name not in sizes:
            inner = (times * (1 + size_of(block, (*outer, name))) for block, times in references(name))
            sizes[name] = len(drawing.blocks.get(name)) + sum(inner)
        return sizes[name]

    def references(name: str) -> Iterator[tuple[str, int]]:
        for entity in drawing.blocks.get(name):
            if isinstance(entity, Insert):
                block, times = entity.dxf.get("name", ""), max(1, entity.mcount)
            else:
                block, times = entity.dxf.get("geometry", "") if entity.dxf.is_supported("geometry") else "", 1
            if isinstance(block, str) and block in drawing.blocks:
                yield block, times

    size = size_of("*model_space", ())
    if size > most:
        raise InputError(
            f"{path}: {size} entities with blocks resolved, the limit is {most} (dxf_entities in {FILE}); "
            "save only the plan's layers"
        )


@dataclass(frozen=True)
class _Content:
    """The lines of a drawing with their layers, and how many entities of each other kind there are."""

    lines: list[tuple[LineString, str]]
    others: dict[str, int]


def _lines(path: Path, drawing: Drawing, layers: list[str] | None) -> _Content:
    """Return the lines with their layers, and what else is there."""
    most = reader_limits().dxf_entities
    annotations = mend_blocks(path, drawing)
    drop_frame_points(drawing)
    entities = list(islice(disassemble.recursive_decompose(drawing.modelspace()), most + 1))
    if len(entities) > most:
        raise InputError(f"{path}: more than {most} entities with blocks resolved (dxf_entities in {FILE})")
    chosen = shown(path, drawing, entities) if layers is None else [e for e in entities if e.dxf.layer in layers]
    kept = [e for e in chosen if e.dxftype() in _DRAWN]
    for entity in kept:
        _require_plain_numbers(path, entity)
    pieces = [(drawn.entity, piece) for drawn in disassemble.to_primitives(kept) if (piece := _piece(drawn))]
    wide = sum(isinstance(entity, LWPolyline | Polyline) and entity.has_width for entity, _ in pieces)
    if wide:
        way, option = "--half-width takes them as the middles of drifts", "--half-width"
        warn_user("polylines have a width, which is not read", of=path.name, count=wide, option=option, advice=way)
    read = {id(entity) for entity, _ in pieces}
    others = count_kinds([e for e in chosen if id(e) not in read]) | annotations
    if not pieces:  # what is missing is then the plan
        others |= {f"{XREF} {name}": 1 for name in absent_drawings(drawing)}
    return _Content(_flattened(path, [(piece, str(entity.dxf.layer)) for entity, piece in pieces]), others)


def _piece(primitive: disassemble.Primitive) -> DrawnPath | None:
    """Return the path of a line or a curve; the library takes a polyline with a width for an area, which has none."""
    entity = primitive.entity
    is_flat = isinstance(entity, LWPolyline) or (isinstance(entity, Polyline) and entity.is_2d_polyline)
    if primitive.path is None and not is_flat:
        return None
    piece = make_path(entity, segments=_BEZIERS)
    return piece if len(piece) else None


def _flattened(path: Path, paths: list[tuple[DrawnPath, str]]) -> list[tuple[LineString, str]]:
    """Return lines and curves as chords, with their layers."""
    vertices = [point for p, _ in paths for point in p.control_vertices()]
    if not vertices:
        return []
    size = max(max(v[k] for v in vertices) - min(v[k] for v in vertices) for k in (0, 1))
    rises = len({v.z for v in vertices}) > 1  # else it is a plan, at whatever elevation
    lines: list[tuple[LineString, str]] = []
    count, limit = 0, reader_limits().points
    for p, layer in paths:
        chords = p.flattening(max(size * _CHORD_SHARE, 1e-9), segments=4)
        points = [(v.x, v.y, v.z) if rises else (v.x, v.y) for v in islice(chords, limit + 1 - count)]
        count += len(points)
        require_size(path, count)
        if len(set(points)) > 1:
            lines.append((LineString(points), layer))
    return lines
