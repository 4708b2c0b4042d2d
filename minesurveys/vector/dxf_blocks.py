"""What a DXF drawing hides or states wrongly: layers that are off, scales of 0, clips, external references."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from ezdxf.document import Drawing
from ezdxf.entities.dxfentity import DXFEntity
from ezdxf.entities.insert import Insert
from ezdxf.entities.polyline import Polyline
from ezdxf.xclip import XClip

from minesurveys.errors import first_few, one_line
from minesurveys.remarks import warn_user

_SCALES = ("xscale", "yscale", "zscale")
_ANNOTATIONS = ("DIMENSION", "ARC_DIMENSION", "LARGE_RADIAL_DIMENSION", "LEADER", "MULTILEADER", "ACAD_TABLE")


def mend_blocks(path: Path, drawing: Drawing) -> dict[str, int]:
    """Make a drawing's block references readable, warn of what they hide, and take out dimensions, leaders and tables.

    A scale of 0, which some CAD programs write for z, counts as 1. The lines of dimensions, leaders and tables are no
    walls.

    Returns
    -------
    dict of str to int
        How many entities of each type were taken out.
    """
    references = list(_references(drawing))
    flat = [insert for insert in references if any(insert.dxf.get(scale) == 0 for scale in _SCALES)]
    for insert in flat:
        for scale in _SCALES:
            if insert.dxf.get(scale) == 0:
                insert.dxf.set(scale, 1.0)
    if flat:
        x, y = flat[0].dxf.insert.vec2
        warn_user(
            f"block references have a scale of 0, read as 1; the first is {_name(flat[0])} at ({x:.1f}, {y:.1f})",
            of=path.name,
            count=len(flat),
        )
    clipped = [insert for insert in references if XClip(insert).is_clipping_enabled]
    if clipped:
        x, y = clipped[0].dxf.insert.vec2
        warn_user(
            f"block references are clipped, and are read whole; the first is {_name(clipped[0])} at ({x:.1f}, "
            f"{y:.1f}); explode and trim them in CAD, or choose layers by --layer",
            of=path.name,
            count=len(clipped),
            option="--layer",
        )
    absent = absent_drawings(drawing)
    if absent:
        warn_user(
            "drawings that it refers to are not in the file, and are not read: "
            f"{first_few(absent)}; bind the external references in CAD",
            of=path.name,
            count=len(absent),
        )
    return _without_annotations(drawing)


def absent_drawings(drawing: Drawing) -> list[str]:
    """Return the names of the external references whose drawings are not in the file."""
    return sorted({_name(insert) for insert in _references(drawing) if _is_external(drawing, insert)})


def shown(path: Path, drawing: Drawing, entities: list[DXFEntity]) -> list[DXFEntity]:
    """Return the entities on layers that are neither off nor frozen, with a remark on the others; all if none is."""
    hidden = {layer.dxf.name.lower() for layer in drawing.layers if layer.is_off() or layer.is_frozen()}
    kept = [entity for entity in entities if str(entity.dxf.layer).lower() not in hidden]
    if not kept or len(kept) == len(entities):
        return entities
    names = sorted({one_line(str(e.dxf.layer), 40) for e in entities if str(e.dxf.layer).lower() in hidden})
    warn_user(
        f"entities on layers that are off or frozen are not read: {first_few(names)}; --layer NAME reads a layer",
        of=path.name,
        count=len(entities) - len(kept),
        option="--layer",
    )
    return kept


def count_kinds(entities: Iterable[DXFEntity]) -> dict[str, int]:
    """Return how many entities there are of each type; a mesh, which is stored as a polyline, has a name of its own."""
    return dict(Counter(map(_kind, entities)))


def _kind(entity: DXFEntity) -> str:
    if isinstance(entity, Polyline) and entity.is_poly_face_mesh:
        return "polyface mesh"
    if isinstance(entity, Polyline) and entity.is_polygon_mesh:
        return "polygon mesh"
    return entity.dxftype()


def _references(drawing: Drawing) -> Iterator[Insert]:
    for block in drawing.blocks:  # the model space is one
        for entity in block:
            if isinstance(entity, Insert):
                yield entity


def _is_external(drawing: Drawing, insert: Insert) -> bool:
    block = drawing.blocks.get(str(insert.dxf.get("name", "")))
    return block is not None and block.block is not None and block.block.is_xref


def _name(insert: Insert) -> str:
    return one_line(str(insert.dxf.get("name", "")), 40)


def _without_annotations(drawing: Drawing) -> dict[str, int]:
    """Take dimensions, leaders and tables out of all blocks; return how many of each the model space has."""
    counts: dict[str, int] = {}
    for block in drawing.blocks:
        for entity in [entity for entity in block if entity.dxftype() in _ANNOTATIONS]:
            block.unlink_entity(entity)
            if block.name.lower() == "*model_space":
                counts[entity.dxftype()] = counts.get(entity.dxftype(), 0) + 1
    return counts
