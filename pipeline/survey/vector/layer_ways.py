"""The way on where the layers of a drawing, read as one plan, enclose nothing: which layer does alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pipeline.errors import InputError, first_few
from pipeline.guard.reading_process import one_line
from pipeline.survey.vector.shapes import Shapes, workings_of

_MOUTH_M = 10.0  # the most that --snap joins: ends of walls so near are a drift's end
_TRIED = 40  # layers


def refusal_of_layers(
    path: Path, content: Shapes, shapes: list[BaseGeometry], snap_m: float, error: InputError
) -> InputError:
    """Return the refusal of a drawing whose layers enclose nothing as one plan; it names layers that do alone.

    Parameters
    ----------
    path : Path
    content : Shapes
        With the layer of each shape.
    shapes : list of shapely geometry, m
        The same shapes, as `locate` returns them.
    snap_m : float
    error : InputError
        Why the layers together are refused; it is kept if there is one layer.
    """
    layers = list(dict.fromkeys(content.layer_of))
    if len(layers) < 2:
        return error
    named = first_few([one_line(name, 40) or "no name" for name in layers])
    ways = []
    for layer in layers[:_TRIED]:
        own = [shape for shape, name in zip(shapes, content.layer_of, strict=True) if name == layer]
        for snap in (snap_m, _MOUTH_M):
            try:
                area_m2 = workings_of(path, own, snap, []).area
            except InputError:
                continue
            option = f" --snap {snap:g}" if snap != snap_m else ""
            ways.append(f"--layer {one_line(layer, 40)!r}{option} reads {area_m2:.0f} m2")
            break
    if ways:
        return InputError(f"{path}: its {len(layers)} layers ({named}) enclose nothing as one plan; {first_few(ways)}")
    lengths = shapely.length(shapes)
    sums = {layer: float(lengths[np.array([name == layer for name in content.layer_of])].sum()) for layer in layers}
    listed = [f"{one_line(name, 40)!r} with {sums[name]:.0f} m" for name in sorted(sums, key=lambda k: -sums[k])]
    return InputError(
        f"{path}: none of its {len(layers)} layers encloses an area; --half-width M reads lines as centrelines of "
        "drifts, M metres from the line to either wall, and --layer NAME those of one layer: "
        f"{first_few(listed)}"
    )
