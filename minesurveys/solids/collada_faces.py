"""Vertices and triangles of a mesh of a Collada file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import DTypeLike

from minesurveys.errors import InputError
from minesurveys.guard.plain_xml import plain_name
from minesurveys.solids.polygons import triangles_of

Named = Mapping[tuple[str, str], Element]  # by kind and identifier; some programs give two kinds one identifier
_FACES = ("triangles", "polylist", "polygons", "tristrips", "trifans")


def numbers(
    path: Path, text: str | None, what: str, count: int | None = None, dtype: DTypeLike = np.float64
) -> np.ndarray:
    """Return the numbers of a text.

    Raises
    ------
    InputError
        If one is none, or there are not `count` of them.
    """
    words = (text or "").split()
    try:
        found = np.array(words, dtype) if (text or "").isascii() and "_" not in (text or "") else np.zeros(0)
    except (ValueError, OverflowError):
        found = np.zeros(0)
    if len(found) != len(words) or (count is not None and len(found) != count):
        kind = "whole numbers" if dtype is np.int64 else "numbers"
        wanted = kind if count is None else f"{count} {kind}"
        raise InputError(f"{path}: {what} is {' '.join(words)[:60]!r}; want {wanted}")
    return found


def faces_of(path: Path, mesh: Element, by_id: Named) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices (n, 3) and the triangles (m, 3) of a mesh.

    Raises
    ------
    InputError
        If it is broken. The message names the element.
    """
    vertices = next((child for child in mesh if plain_name(child) == "vertices"), None)
    position = _input(vertices, "POSITION")
    source = by_id.get(("source", (position.get("source") or "").removeprefix("#"))) if position is not None else None
    if source is None:
        raise InputError(f"{path}: a mesh whose <vertices> name no POSITION")
    places = _places(path, source)
    found = [_triangles(path, child, places) for child in mesh if plain_name(child) in _FACES]
    faces = np.concatenate([np.zeros((0, 3), np.int64), *found])
    return places, faces


def _input(element: Element | None, semantic: str) -> Element | None:
    return next((child for child in element or () if child.get("semantic") == semantic), None)


def _places(path: Path, source: Element) -> np.ndarray:
    array = next((child for child in source if plain_name(child) == "float_array"), None)
    accessor = next((child for child in source.iter() if plain_name(child) == "accessor"), None)
    if array is None or accessor is None:
        raise InputError(f"{path}: a mesh without coordinates (<float_array>, <accessor>)")
    values = numbers(path, array.text, "<float_array>")
    stride, offset = _whole(path, accessor, "stride", 3), _whole(path, accessor, "offset", 0)
    stated = _whole(path, array, "count", len(values))
    if stated != len(values):
        raise InputError(f"{path}: <float_array> states {stated} numbers and has {len(values)}; it is broken")
    if not (3 <= stride <= max(3, stated) and offset >= 0):
        raise InputError(f"{path}: <accessor> has stride {stride} and offset {offset}; want 3 or more, and 0 or more")
    values = values[offset:]
    return values[: len(values) // stride * stride].reshape(-1, stride)[:, :3]


def _triangles(path: Path, faces: Element, places: np.ndarray) -> np.ndarray:
    """Return the triangles (m, 3) of one list of faces."""
    kind = plain_name(faces)
    inputs = [child for child in faces if plain_name(child) == "input"]
    offsets = [_whole(path, child, "offset", 0) for child in inputs]
    vertex = next((k for k, child in zip(offsets, inputs, strict=True) if child.get("semantic") == "VERTEX"), None)
    if vertex is None:
        raise InputError(f"{path}: <{kind}> without an input VERTEX")
    if any(plain_name(child) == "ph" for child in faces):
        raise InputError(f"{path}: <polygons> with holes (<ph>) are not read; export triangles")
    if min(offsets) < 0:
        raise InputError(f"{path}: <{kind}> has inputs of offsets {offsets}; want 0 or more")
    step = max(offsets) + 1
    listed = [_indices(path, p.text, kind) for p in faces if plain_name(p) == "p"]
    unit = 3 * step if kind == "triangles" else step
    odd = next((len(one) for one in listed if len(one) % unit), None)
    if odd is not None:
        raise InputError(f"{path}: <{kind}> lists {odd} numbers, of {unit} each; it is broken")
    rings = [one[vertex::step] for one in listed]
    corners = np.concatenate([np.zeros(0, np.int64), *rings])
    if len(corners) and not 0 <= corners.min() <= corners.max() < len(places):
        raise InputError(f"{path}: <{kind}> has a corner that the file does not have")
    if kind == "triangles":
        return corners.reshape(-1, 3)
    if kind == "tristrips":
        return np.concatenate([np.zeros((0, 3), np.int64), *(_strip(ring) for ring in rings)])
    if kind == "trifans":
        fans = [
            np.column_stack([np.full(len(ring) - 2, ring[0]), ring[1:-1], ring[2:]]) for ring in rings if len(ring) > 2
        ]
        return np.concatenate([np.zeros((0, 3), np.int64), *fans])
    counts = next((child for child in faces if plain_name(child) == "vcount"), None)
    sizes = np.array([len(ring) for ring in rings]) if counts is None else _indices(path, counts.text, "vcount")
    if sizes.sum() != len(corners) or (len(sizes) and sizes.min() < 0):
        raise InputError(f"{path}: <{kind}> counts {sizes.sum()} corners and lists {len(corners)}")
    return triangles_of(places, corners, sizes)


def _strip(ring: np.ndarray) -> np.ndarray:
    found = np.column_stack([ring[:-2], ring[1:-1], ring[2:]]) if len(ring) > 2 else np.zeros((0, 3), np.int64)
    found[1::2] = found[1::2, [1, 0, 2]]
    return found


def _indices(path: Path, text: str | None, what: str) -> np.ndarray:
    return numbers(path, text, f"<{what}>", dtype=np.int64)


def _whole(path: Path, element: Element, key: str, default: int) -> int:
    """Return a whole number of an element's attribute."""
    name = f"<{plain_name(element)}> {key}"
    return int(numbers(path, element.get(key, str(default)), name, 1, np.int64)[0])
