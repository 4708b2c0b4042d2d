"""The shapes of a vector file that may be workings: lines and polygons, within limits, with what else there is."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import shapely

from minesurveys.errors import InputError
from minesurveys.formats import FORMATS, shape_reader
from minesurveys.vector.missing_elevations import fill_elevations
from minesurveys.vector.other_kinds import POINT, warn_of_others
from minesurveys.vector.shapes import Shapes, require_simple


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
    if level_by is not None and not FORMATS[path.suffix.lower()].has_fields:
        raise InputError(f"{path}: --level-by: its lines have no properties, but layers; state --elevation LAYER=M")
    content = require_simple(path, reader(path, layers) if level_by is None else reader(path, layers, level_by))
    drawn = [bool(dimension > 0) for dimension in shapely.get_dimensions(content.shapes)] if content.shapes else []
    points = Counter({POINT: len(drawn) - sum(drawn)})
    content = replace(content.only(drawn), others=dict(+points + Counter(content.others)))
    warn_of_others(path, content)
    return content if no_elevation is None else fill_elevations(path, content, no_elevation)
