"""One change of every kind of field of a world, and random changes of fields, elements, bytes and files.

A change keeps the hashes of before.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable, Iterator
from typing import Any

import cv2
import numpy as np

from minexplore.bundle import (
    MADE_BY,
    MODEL,
    RECORD,
    TriangleMesh,
    decode_msh,
    encode_msh,
)

Files = dict[str, bytes]
NUMBER = re.compile(r"-?\d+\.?\d*(?:e-?\d+)?")
_SEALED = ("files", "world_sha256")
# Attributes and elements that MuJoCo knows and the builder does not write there.
_FOREIGN = """margin="0.2"|gap="0.1"|solref="0.5 0.1"|solimp="0 0 1"|condim="1"|contype="0"|conaffinity="0"|priority="5"
friction="0.01 0 0"|group="1"|mass="3"|density="1"|rgba="1 0 0 0"|euler="0 0 0.1"|axisangle="1 0 0 0.01"
quat="0.99 0.1 0 0"|pos="1 1 1"|size="1 1 1"|type="sphere"|class="rock"|gravcomp="1"|mocap="true"|childclass="rock"
scale="2 2 2"|maxhullvert="4"|active="false"|mode="track"|user="1"|fluidshape="ellipsoid"|material="ground_mud"
mesh="rock_0001"|shellinertia="true\"""".replace("\n", "|").split("|")
_ELEMENTS = """<option gravity="0 0 -3.7"/>|<option timestep="0.05" cone="elliptic"/>|<keyframe/>|<custom/>|<contact/>
<option><flag contact="disable"/></option>|<size njmax="1"/>|<include file="more.xml"/>|<geom type="box" size="1 1 1"/>
<geom name="floor_more" type="box" size="1 1 1" pos="9 2 0" group="0"/>|<site name="s"/>|<joint type="slide"/>
<body name="b"><freejoint/><geom size="1"/></body>|<freejoint/>|<camera name="c"/>|<frame pos="0 0 1"/>|<tendon/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>|<light name="spot_77" pos="1 1 1"/>|<material name="ground_more"/>
<mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>|<texture name="t" type="2d" builtin="flat" width="4" height="4"/>
<numeric name="n" data="1"/>|<default class="more"/>""".replace("\n", "|").split("|")
_IMPLIED = ("texture", "name")  # without it MuJoCo takes the name of the file, which is the same
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
            value = f"{float(at[0]) + 1:.6g}"
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
            if np.array_equal(array, own):
                continue
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
            if key != _IMPLIED:
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


def random_change(files: Files, seed: int) -> tuple[str, Files]:
    """Return what is changed, and the changed files.

    Half of the changes are those of `every_change` to one file; the others are what MuJoCo knows and no builder writes,
    elements that are repeated, dropped or moved, corners of collision parts, bytes, and whole files.
    """
    rng = np.random.default_rng(seed)
    if rng.random() < 0.5:
        name = _one(rng, [name for name in sorted(files) if name != MADE_BY])
        changes = list(_changes(name, files[name]))
        if changes:
            what, data = _one(rng, changes)
            return f"{name}: {what}", {**files, name: data}
    changed: tuple[str, Files] = _one(rng, _RANDOM)(files, rng)
    return changed


def _one(rng: np.random.Generator, items: list) -> Any:
    return items[int(rng.integers(len(items)))]


def _foreign(files: Files, rng: np.random.Generator) -> tuple[str, Files]:
    """Add an attribute or an element that MuJoCo knows."""
    text = files[MODEL].decode()
    if rng.random() < 0.5:
        at, more = _one(rng, list(re.finditer(r"<[a-z]+(?= |/?>)", text))).end(), f" {_one(rng, _FOREIGN)}"
    else:
        at, more = _one(rng, [m.end() for m in re.finditer(r">\n", text)][:-1]), f"{_one(rng, _ELEMENTS)}\n"
    return f"{MODEL}: {more.strip()[:60]} added", {**files, MODEL: (text[:at] + more + text[at:]).encode()}


def _element(files: Files, rng: np.random.Generator) -> tuple[str, Files]:
    """Repeat, drop or move an element."""
    lines = files[MODEL].decode().splitlines(keepends=True)
    own = [k for k, line in enumerate(lines) if line.strip().endswith("/>")]
    at, to, kind = _one(rng, own), _one(rng, own), int(rng.integers(3))
    moved = lines[at]
    rest = lines if kind == 0 else lines[:at] + lines[at + 1 :]
    rest = rest if kind == 1 else [*rest[:to], moved, *rest[to:]]
    return f"{MODEL}: {moved.strip()[:50]} {('repeated', 'dropped', 'moved')[kind]}", {
        **files,
        MODEL: "".join(rest).encode(),
    }


def _corner(files: Files, rng: np.random.Generator) -> tuple[str, Files]:
    """Move a corner of a collision part."""
    text = files[MODEL].decode()
    at = _one(rng, list(re.finditer(r'vertex="([^"]*)"', text)))
    numbers = at[1].split(" ")
    number = int(rng.integers(len(numbers)))
    numbers[number] = f"{float(numbers[number]) + float(rng.choice([-3, -0.3, -0.05, 0.05, 0.3, 3])):.6g}"
    changed = (text[: at.start(1)] + " ".join(numbers) + text[at.end(1) :]).encode()
    return f"{MODEL}: coordinate {number} of a collision part -> {numbers[number]}", {**files, MODEL: changed}


def _byte(files: Files, rng: np.random.Generator) -> tuple[str, Files]:
    """Flip a bit of a file, cut it, or put bytes into it."""
    name, kind = _one(rng, sorted(files)), int(rng.integers(3))
    data = files[name]
    at = int(rng.integers(len(data)))
    flipped = data[:at] + bytes([data[at] ^ 1 << int(rng.integers(8))]) + data[at + 1 :]
    changed = (flipped, data[:at], data[:at] + rng.bytes(4) + data[at:])[kind]
    return f"{name}: bytes changed at {at}, kind {kind}", {**files, name: changed}


def _file(files: Files, rng: np.random.Generator) -> tuple[str, Files]:
    """Remove a file, replace it by another one, or copy it to a new name."""
    names = sorted(set(files) - {RECORD})
    name, other, kind = _one(rng, names), _one(rng, names), int(rng.integers(3))
    if kind == 0:
        return f"{name} removed", {key: data for key, data in files.items() if key != name}
    target = other if kind == 1 else _one(rng, ["more.xml", "meshes/walls_77_77.msh", "plugin.so", "textures/more.png"])
    return f"{name} copied to {target}", {**files, target: files[name]}


_RANDOM: list[Callable[[Files, np.random.Generator], tuple[str, Files]]] = [_foreign, _element, _corner, _byte, _file]
