"""One change of every kind of field of a world: each key of its JSON, each array, attribute, picture and text."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np

from benchmarks.faults.random_model_faults import NUMBER, Files, written
from minexplore.bundle import MADE_BY, MODEL, TriangleMesh, decode_msh, encode_msh

_SEALED = ("files", "world_sha256")
_ELEMENT = re.compile(r"<([a-z]+)((?: [a-zA-Z_]+=\"[^\"]*\")*) ?/?>")
_ATTRIBUTE = re.compile(r' ([a-zA-Z_]+)="([^"]*)"')


def every_change(files: Files) -> Iterator[tuple[str, Files]]:
    """Yield what is changed, as `FILE: PLACE: HOW`, and the changed files, whose hashes are those of before."""
    for name in sorted(files):
        for what, data in _changes(name, files[name]):
            yield f"{name}: {what}", {**files, name: data}


def _changes(name: str, data: bytes) -> Iterator[tuple[str, bytes]]:
    if name.endswith("json") and name != MADE_BY:
        yield from json_changes(data)
    elif name.endswith(".npz"):
        yield from _array_changes(data)
    elif name.endswith(".msh"):
        yield from mesh_changes(data)
    elif name == MODEL:
        yield from model_changes(data.decode())
    elif name.endswith(".yaml"):
        text = data.decode()
        for at in NUMBER.finditer(text):
            value = written(float(at[0]) + 1)
            yield f"{text[: at.start()].count(chr(10))}: + 1", (text[: at.start()] + value + text[at.end() :]).encode()
    elif name.startswith("map"):
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        assert picture is not None
        picture[tuple(n // 2 for n in picture.shape)] ^= 0xFE
        yield "pixel: other", cv2.imencode(".png", picture)[1].tobytes()
    elif name.endswith(".bt"):
        yield "byte: other", data[:-3] + bytes([data[-3] ^ 4]) + data[-2:]


def json_changes(data: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield changes of each value of a JSON file: of a list, of its first and its last element; and of each list."""
    content = json.loads(data)
    for place in _places(content):
        holder = content
        for key in place[:-1]:
            holder = holder[key]
        own = holder[place[-1]]
        for how, value in _others(own):
            holder[place[-1]] = value
            yield f"{'.'.join(map(str, place))}: {how}", (json.dumps(content, indent=2) + "\n").encode()
        holder[place[-1]] = own
        if isinstance(own, dict) and own.get("start") != own.get("end"):
            own["start"], own["end"] = own["end"], own["start"]
            yield f"{'.'.join(map(str, place))}: ends exchanged", (json.dumps(content, indent=2) + "\n").encode()
            own["start"], own["end"] = own["end"], own["start"]


def _places(value: Any) -> Iterator[tuple[str | int, ...]]:
    inner: list[tuple[str | int, Any]] = []
    if isinstance(value, dict):
        inner = [(key, one) for key, one in value.items() if key not in _SEALED]
    elif isinstance(value, list) and value:
        inner = [(at, value[at]) for at in sorted({0, len(value) - 1})]
    for key, one in inner:
        yield (key,)
        yield from ((key, *rest) for rest in _places(one))


def _others(value: Any) -> Iterator[tuple[str, Any]]:
    """Yield changed values that are as likely as the own one."""
    if isinstance(value, bool) or value is None:
        yield "other", not value
    elif isinstance(value, int):
        yield "+ 1", value + 1
    elif isinstance(value, float):
        yield "+ 0.02", value + 0.02
        yield "x 1.5", 1.5 * value + 1.25
    elif isinstance(value, str):
        yield "other text", f"{value}x"
    elif isinstance(value, list) and value:
        yield "shorter", value[:-1]
        if value != value[::-1]:
            yield "reversed", value[::-1]
    elif isinstance(value, dict) and value:
        yield "shorter", dict(list(value.items())[:-1])


def _array_changes(data: bytes) -> Iterator[tuple[str, bytes]]:
    with np.load(io.BytesIO(data), allow_pickle=False) as loaded:
        arrays = {key: loaded[key].copy() for key in loaded.files}
    for key, own in arrays.items():
        for how, array in other_arrays(own):
            stream = io.BytesIO()
            np.savez_compressed(stream, **{**arrays, key: array})
            yield f"{key}: {how}", stream.getvalue()


def other_arrays(own: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Yield an array with one other number, in the first third, and with all numbers changed or in another order."""
    at = np.unravel_index(own.size // 3, own.shape)
    if own.dtype.kind == "f":
        for by in (0.02, 1.0):
            array = own.copy()
            array[at] += by
            yield f"one + {by:g}", array
        yield "all x 1.001", (own * 1.001).astype(own.dtype)
    else:
        array = own.copy()
        array[at] = not own[at] if own.dtype.kind == "b" else (own[at] + 1) % (own.max() + 1) if own.max() else 1
        yield "one other", array
        if own.dtype.kind != "b":
            yield "exchanged", np.where(own == own.max(), own.min(), np.where(own == own.min(), own.max(), own))
    if own.ndim and not np.array_equal(own, own[::-1]):
        yield "turned round", np.ascontiguousarray(own[::-1])


def mesh_changes(data: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield changes of each array of a mesh."""
    mesh = decode_msh(data)
    arrays = {name: np.array(getattr(mesh, name)) for name in ("vertices", "faces", "texcoords", "normals")}
    changes: list[tuple[str, str, np.ndarray]] = []
    for name, own in arrays.items():
        if len(own):
            one = own.copy()
            k = len(own) // 3
            one[k] = own[k, ::-1] if name == "faces" else -own[k] if name == "normals" else own[k] + 1
            changes += [(name, "one other", one)]
            if name != "faces":  # their order shows nothing
                changes += [(name, "turned round", own[::-1].copy())]
            if name == "normals":
                leant = own.copy()
                leant[k] = own[k] + 0.3 * np.roll(own[k], 1)
                leant[k] /= np.linalg.norm(leant[k])
                changes += [(name, "one leant", leant), (name, "all inverted", -own)]
            if name == "texcoords":
                changes += [(name, "all 0", 0 * own), (name, "all x 50", 50 * own)]
    for name, how, array in changes:
        if not np.array_equal(array, arrays[name]):
            yield f"{name}: {how}", encode_msh(TriangleMesh(**{**arrays, name: array}))
    if len(arrays["normals"]):
        yield "normals: none", encode_msh(TriangleMesh(**{**arrays, "normals": arrays["normals"][:0]}))


def model_changes(text: str) -> Iterator[tuple[str, bytes]]:
    """Yield changes of each attribute of each kind of element: of the first one that has it, and of every camera."""
    seen = set[tuple[str, ...]]()
    for element in _ELEMENT.finditer(text):
        kind = element[1]
        for attribute in _ATTRIBUTE.finditer(element[2]):
            key: tuple[str, ...] = (kind, attribute[1])
            name = re.search(r' name="([^"]*)"', element[2])
            if kind == "camera":
                key = (*key, name[1] if name else "")
            if key in seen:
                continue
            seen.add(key)
            where = element.start(2) + attribute.start(2), element.start(2) + attribute.end(2)
            for how, value in _other_values(attribute[2]):
                yield f"{'.'.join(key)}: {how}", (text[: where[0]] + value + text[where[1] :]).encode()
            out = element.start(2) + attribute.start(), element.start(2) + attribute.end()
            yield f"{'.'.join(key)}: dropped", (text[: out[0]] + text[out[1] :]).encode()
        if kind == "light" and ("light",) not in seen:
            seen.add(("light",))
            yield "light: dropped", (text[: element.start()] + text[element.end() :]).encode()
    cutoff = re.sub(r'cutoff="[^"]*"', 'cutoff="3"', text)
    if cutoff != text:
        yield "light.cutoff: all 3 deg", cutoff.encode()


def _other_values(value: str) -> Iterator[tuple[str, str]]:
    numbers = list(NUMBER.finditer(value))
    if not numbers:
        yield "other", f"{value}x"
        return
    at = numbers[-1]
    for how, new in (("+ 0.02", float(at[0]) + 0.02), ("turned", -float(at[0]) or 1.0)):
        yield how, f"{value[: at.start()]}{new:.9g}{value[at.end() :]}"
