"""A graph explorer's network on disk: plain arrays as safetensors, with the network's layers in the metadata."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from baselines.base.errors import BaselineError
from baselines.graph.features import NAMES
from baselines.graph.network import Shape, array_shapes
from minexplore import FAMILY

FORMAT = "minexplore-graph/1"
_MOST_BYTES = 64_000_000


def format_of(path: Path) -> str | None:
    """Return the format that a checkpoint's metadata state; None if it states none or cannot be read."""
    try:
        if not path.is_file() or path.stat().st_size > _MOST_BYTES:
            return None
        with safe_open(str(path), framework="numpy") as file:
            return (file.metadata() or {}).get("format")
    except (SafetensorError, OSError, ValueError):
        return None


def write_network(path: Path, arrays: dict[str, np.ndarray], shape: Shape, seed: int, reached: dict[str, Any]) -> None:
    """Write a network beside the file's place, then move it there."""
    about = {
        "format": FORMAT,
        "env": FAMILY,
        "features": ",".join(NAMES),
        "network": shape.model_dump_json(),
        "seed": str(seed),
        "reached": json.dumps(reached),
    }
    part = path.with_suffix(".part")
    save_file({name: np.ascontiguousarray(array) for name, array in arrays.items()}, str(part), metadata=about)
    part.rename(path)


def read_network(path: Path) -> tuple[dict[str, np.ndarray], Shape]:
    """Return a network's arrays and layers.

    Raises
    ------
    BaselineError
        If it is no network's file, or not one for the features of this version.
    """
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise BaselineError(f"{path}: {path.stat().st_size:,} bytes, a network's file has at most {_MOST_BYTES:,}")
        with safe_open(str(path), framework="numpy") as file:
            about, arrays = file.metadata() or {}, {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        if about.get("format") != FORMAT:
            raise BaselineError(f"{path}: format {about.get('format')!r}, this version reads {FORMAT!r}")
        if about["features"] != ",".join(NAMES):
            raise BaselineError(f"{path}: its features are not those of this version")
        shape = Shape.model_validate_json(about["network"])
    except FileNotFoundError:
        raise BaselineError(f"{path}: no such file") from None
    except (SafetensorError, KeyError, ValueError, TypeError, ValidationError, OSError, RecursionError) as error:
        said = str(error)[:200].encode("unicode_escape").decode()
        raise BaselineError(f"{path}: not a network's file ({said})") from error
    _check(path, arrays, shape)
    return arrays, shape


def _check(path: Path, arrays: dict[str, np.ndarray], shape: Shape) -> None:
    """Refuse arrays that do not make the layers that the file names."""
    if shape.width % shape.heads:
        raise BaselineError(f"{path}: width {shape.width} is no multiple of {shape.heads} heads")
    for name, wanted in array_shapes(shape).items():
        found = arrays.get(name)
        if found is None:
            raise BaselineError(f"{path}: {name} is absent")
        if found.shape != wanted:
            raise BaselineError(f"{path}: {name} has shape {found.shape}, its layers want {wanted}")
        if found.dtype.kind != "f" or not np.isfinite(found).all():
            raise BaselineError(f"{path}: {name}: want finite numbers")
