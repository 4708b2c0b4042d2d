"""Files of shapes, written by pyogrio (GDAL)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyogrio.raw
import shapely
from shapely.geometry.base import BaseGeometry


def write_shapes(path: Path, shapes: Sequence[BaseGeometry], crs: str | None = "EPSG:32719", **options: Any) -> Path:
    """Write shapes of the first one's kind, as a layer `a` if `options` name no other, and return the path."""
    kind = shapes[0].geom_type + " Z" * shapes[0].has_z
    wkb = np.array([shapely.to_wkb(shape, output_dimension=2 + shapes[0].has_z) for shape in shapes], object)
    pyogrio.raw.write(path, wkb, [], [], **{"geometry_type": kind, "crs": crs, "layer": "a", **options})
    return path
