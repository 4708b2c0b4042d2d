"""Read a survey of any format: its legs, its outlines, its triangles, its points, its picture or its grid."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from pkgutil import resolve_name

import numpy as np
import shapely

from minesurveys.clouds.cloud_formats import holds_points, read_blocks
from minesurveys.clouds.point_blocks import PointBlock, Wanted
from minesurveys.errors import InputError
from minesurveys.formats import FileKind, format_of, shape_reader
from minesurveys.frames import Image
from minesurveys.grid.nav2 import Nav2Map
from minesurveys.guard.plain_file import read_text_bytes, require_plain_file
from minesurveys.limits import reader_limits
from minesurveys.pictures.georeference import Placement, find_placement
from minesurveys.solids.files import Triangles, read_triangles
from minesurveys.solved.model import SolvedSurvey
from minesurveys.solved_surveys import solve_file
from minesurveys.vector.missing_elevations import fill_elevations
from minesurveys.vector.other_kinds import POINT, warn_of_others
from minesurveys.vector.shapes import Shapes, require_simple

_COLOURED = Wanted(colours=True, times=True)
_MESH_POINTS = 100.0  # on a square unit of a mesh that is read as points


@dataclass(frozen=True)
class PlanPicture:
    """A picture of a plan (rows, cols, 3) uint8 BGR, and where it lies in a map, None if its file does not state it."""

    pixels: Image
    placement: Placement | None


Content = SolvedSurvey | Shapes | Triangles | PointBlock | PlanPicture | Nav2Map


def read(path: Path | str, layers: list[str] | None = None, declination_deg: float | None = None) -> Content:
    """Read a survey.

    Parameters
    ----------
    path : Path or str
        The suffix names the format (`minesurveys.formats.FORMATS`, and those that other distributions register).
    layers : list of str, optional
        Of a drawing or a mesh; None reads all.
    declination_deg : float, optional
        Of a survey that Survex solves, in place of computed ones, degrees east of true north.

    Returns
    -------
    SolvedSurvey
        Of stations: their names and places (m, in the frame `crs`), the legs between them, and cross-sections.
    Shapes
        Of a drawing: lines and polygons in its own coordinates, with their layers, their `unit` and their `crs`, None
        where the file states none. `minesurveys.vector.shapes.locate` brings them to metres.
    Triangles
        Of a solid: vertices, faces and layers, with their `unit`, None where the file states none, and the axis `up`.
    PointBlock
        Of a cloud: points in the file's units, with colours and times where the file has them, and the `system` that
        it states. `minesurveys.clouds.cloud_formats.read_blocks` yields large clouds in parts.
    PlanPicture
        Of a picture or the first page of a PDF: pixels, and where they lie in a map.
    Nav2Map
        Of an occupancy grid: free and occupied cells, with the edge of a cell, m, and the origin.

    Raises
    ------
    InputError
        If the file is missing, broken or larger than a limit of `minesurveys/limits.yaml`, or its format is not read.
        The message names the file, the value and the limit.

    Notes
    -----
    What a reader leaves out or assumes is printed on standard error; `minesurveys.remarks.collect_remarks` collects it.
    A file that you do not trust is best read in a process with limits: `minesurveys.guard.reading_process.run_limited`.
    """
    path = Path(path)
    require_plain_file(path)
    form = format_of(path)
    if holds_points(path):
        return _joined(read_blocks(path, _MESH_POINTS, _COLOURED))
    match form.kind:
        case FileKind.STATIONS:
            return solve_file(path, declination_deg)
        case FileKind.VECTOR:
            return read_shapes(path, layers)
        case FileKind.GRID:
            grid: Nav2Map = resolve_name(form.grid)(path)
            return grid
        case FileKind.PICTURE | FileKind.PDF:
            pixels: Image = resolve_name(form.picture)(path, reader_limits().megapixels)
            return PlanPicture(pixels, find_placement(path) if form.kind is FileKind.PICTURE else None)
    return read_triangles(path, read_text_bytes(path, "file_bytes"), layers)


def _joined(blocks: Iterable[PointBlock]) -> PointBlock:
    """Return the points of all blocks; colours and times where each block has them."""
    parts = list(blocks)
    colours = [part.colours for part in parts if part.colours is not None]
    times = [part.times for part in parts if part.times is not None]
    return PointBlock(
        np.concatenate([part.points for part in parts]),
        np.concatenate(colours) if len(colours) == len(parts) else None,
        np.concatenate(times) if len(times) == len(parts) else None,
        parts[0].system,
    )


def read_shapes(
    path: Path, layers: list[str] | None, level_by: str | None = None, no_elevation: float | None = None
) -> Shapes:
    """Read the lines and polygons of a vector file by the reader of its suffix; a warning counts what else it holds.

    Parameters
    ----------
    path : Path
    layers : list of str or None
    level_by : str or None
        The property that names the level of a shape, which is its layer in the result.
    no_elevation : float or None
        An elevation that stands for none, in the file's unit.

    Raises
    ------
    InputError
        If the format is not supported, or the reader or a limit refuses the file.
    """
    reader = shape_reader(path)
    if level_by is not None and not format_of(path).has_fields:
        raise InputError(f"{path}: --level-by: its lines have no properties, but layers; state --elevation LAYER=M")
    content = require_simple(path, reader(path, layers) if level_by is None else reader(path, layers, level_by))
    drawn = [bool(dimension > 0) for dimension in shapely.get_dimensions(content.shapes)] if content.shapes else []
    points = Counter({POINT: len(drawn) - sum(drawn)})
    content = replace(content.only(drawn), others=dict(+points + Counter(content.others)))
    warn_of_others(path, content)
    return content if no_elevation is None else fill_elevations(path, content, no_elevation)
