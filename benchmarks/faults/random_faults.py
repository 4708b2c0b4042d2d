"""Random changes to a world: one to three fields, names, vertices, cells, files or bytes, by a seed."""

from __future__ import annotations

import hashlib
import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable

import numpy as np

from benchmarks.faults.random_model_faults import (
    NUMBER,
    Files,
    attribute_added,
    attribute_dropped,
    attribute_value,
    element_added,
    element_moved,
    other_number,
    pick,
    rock_vertex,
    written,
)
from minexplore.bundle import (
    CLEARANCE_GRID,
    FREE_SPACE,
    NAV2_MAP,
    NAV2_PICTURE,
    OCTREE,
    RECORD,
    TOPOLOGY,
    UNSEALED,
    TriangleMesh,
    decode_msh,
    encode_msh,
    world_sha256,
)

Change = Callable[[Files, np.random.Generator], str]  # changes the files in place and says what it did


def random_mutant(files: Files, seed: int) -> tuple[str, Files]:
    """Return what was changed, and the changed files with correct hashes."""
    rng = np.random.default_rng(seed)
    changed = dict(files)
    changes = []
    for _ in range(int(rng.integers(1, 4))):
        change = CHANGES[int(rng.integers(len(CHANGES)))]
        try:
            changes.append(change(changed, rng))
        except (KeyError, ValueError, IndexError, OSError, EOFError, struct.error, zlib.error, zipfile.BadZipFile):
            continue  # an earlier change left nothing that this one could change
    return "; ".join(changes), reseal(changed)


def reseal(files: Files) -> Files:
    """Return the files with the hashes that belong to them, where the record is still one."""
    try:
        record = json.loads(files[RECORD])
        record["files"] = {n: hashlib.sha256(d).hexdigest() for n, d in sorted(files.items()) if n not in UNSEALED}
        record["world_sha256"] = world_sha256(record)
        return {**files, RECORD: (json.dumps(record, indent=2) + "\n").encode()}
    except (KeyError, ValueError, TypeError):
        return files


# --- files of JSON ----------------------------------------------------------------------------------------------------


def _json_value(files: Files, rng: np.random.Generator) -> str:
    name = (RECORD, RECORD, TOPOLOGY, FREE_SPACE)[int(rng.integers(4))]
    content = json.loads(files[name])
    holder: dict | list = content
    path = name
    while True:
        keys = list(holder) if isinstance(holder, dict) else list(range(len(holder)))
        keys = [key for key in keys if key not in ("files", "world_sha256")]
        key = keys[pick(rng, keys)]
        path += f".{key}"
        inner = holder[key]  # type: ignore[index]
        if isinstance(inner, dict | list) and inner and rng.random() < 0.9:
            holder = inner
            continue
        break
    kind = rng.random()
    if kind < 0.7 and isinstance(inner, int | float) and not isinstance(inner, bool):
        new = other_number(inner, rng)
        holder[key] = round(new) if isinstance(inner, int) and rng.random() < 0.7 else new  # type: ignore[index]
    elif kind < 0.8:
        del holder[key]  # type: ignore[arg-type]
    elif kind < 0.9 and isinstance(holder, dict):
        holder[f"{key}_more"] = inner
    else:
        holder[key] = ["x", None, True, [], {}, 7][int(rng.integers(6))]  # type: ignore[index]
    written = json.dumps(content, indent=None if name == FREE_SPACE else 2) + "\n"
    files[name] = written.encode()
    return f"{path[:80]} changed"


# --- meshes, grids, pictures ------------------------------------------------------------------------------------------


def _mesh(files: Files, rng: np.random.Generator) -> str:
    names = sorted(name for name in files if name.startswith("meshes/"))
    name = names[pick(rng, names)]
    mesh = decode_msh(files[name])
    vertices, faces, texcoords = mesh.vertices.copy(), mesh.faces.copy(), mesh.texcoords.copy()
    kind = int(rng.integers(8))
    at = int(rng.integers(len(vertices)))
    if kind == 0:
        vertices[at] += rng.normal(size=3) * rng.choice([0.3, 1.0, 3.0])
    elif kind == 1:
        vertices += rng.normal(size=3).astype(np.float32) * np.float32(rng.choice([0.1, 1.0]))
    elif kind == 2:
        vertices[:, int(rng.integers(3))] *= np.float32(rng.choice([-1, 0, 1.01, 1000]))
    elif kind == 3:
        faces = faces[:, ::-1]
    elif kind == 4:
        faces = np.delete(faces, int(rng.integers(len(faces))), axis=0)
    elif kind == 5:
        faces[int(rng.integers(len(faces))), int(rng.integers(3))] = rng.choice([at, len(vertices), -1])
    elif kind == 6:
        vertices[at, int(rng.integers(3))] = rng.choice([np.nan, np.inf, 1e9])
    else:
        other = names[pick(rng, names)]
        files[name], files[other] = files[other], files[name]
        return f"{name} and {other} exchanged"
    files[name] = encode_msh(TriangleMesh(vertices, faces, texcoords, mesh.normals))
    return f"{name}: change {kind} near vertex {at}"


def _grid(files: Files, rng: np.random.Generator) -> str:
    with np.load(io.BytesIO(files[CLEARANCE_GRID]), allow_pickle=False) as loaded:
        arrays = {key: loaded[key].copy() for key in loaded.files}
    row, col = (int(rng.integers(n)) for n in arrays["free"].shape)
    kind = int(rng.integers(6))
    if kind == 0:
        arrays["free"][row, col] ^= True
    elif kind == 1:
        arrays["clearance_m"][row, col] += np.float32(rng.choice([-0.5, 0.01, 3.0, np.nan]))
    elif kind == 2:
        arrays = {k: np.roll(v, 1, axis=1) if v.ndim == 2 else v for k, v in arrays.items()}
    elif kind == 3:
        arrays["origin_m"] = arrays["origin_m"] + rng.choice([-0.25, 0.01, 5.0], 2)
    elif kind == 4:
        arrays["cell_m"] = np.array(float(arrays["cell_m"]) * rng.choice([0.5, 2.0, -1.0, 0.0]))
    else:
        key = sorted(arrays)[int(rng.integers(len(arrays)))]
        arrays[key] = arrays[key].astype(rng.choice(["f4", "i8", "f2"]))
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    files[CLEARANCE_GRID] = stream.getvalue()
    return f"{CLEARANCE_GRID}: change {kind} at [{row}, {col}]"


def _map_pixel(files: Files, rng: np.random.Generator) -> str:
    """Change a pixel of the map and write the picture with correct checksums."""
    import cv2

    picture = cv2.imdecode(np.frombuffer(files[NAV2_PICTURE], np.uint8), cv2.IMREAD_UNCHANGED)
    if picture is None:
        raise ValueError("not a picture any more")
    row, col = (int(rng.integers(n)) for n in picture.shape[:2])
    picture[row, col] ^= 0xFE
    files[NAV2_PICTURE] = cv2.imencode(".png", picture)[1].tobytes()
    return f"{NAV2_PICTURE}: pixel [{row}, {col}]"


def _map_text(files: Files, rng: np.random.Generator) -> str:
    text = files[NAV2_MAP].decode()
    found = list(NUMBER.finditer(text))
    at = found[pick(rng, found)]
    new = written(other_number(float(at[0]), rng))
    files[NAV2_MAP] = (text[: at.start()] + new + text[at.end() :]).encode()
    return f"{NAV2_MAP}: {at[0]} -> {new}"


# --- files and bytes --------------------------------------------------------------------------------------------------


def _bytes(files: Files, rng: np.random.Generator) -> str:
    names = sorted(files)
    # Half of the changes go to the files that are read by number, not by text.
    name = (
        names[pick(rng, names)] if rng.random() < 0.5 else (OCTREE, CLEARANCE_GRID, NAV2_PICTURE)[int(rng.integers(3))]
    )
    data = bytearray(files[name])
    at = int(rng.integers(len(data)))
    kind = int(rng.integers(4))
    if kind == 0:
        data[at] ^= 1 << int(rng.integers(8))
    elif kind == 1:
        del data[at:]
    elif kind == 2:
        data[at:at] = rng.bytes(int(rng.integers(1, 9)))
    else:
        data += rng.bytes(4)
    files[name] = bytes(data)
    return f"{name}: bytes changed at {at}, kind {kind}"


def _file(files: Files, rng: np.random.Generator) -> str:
    names = sorted(set(files) - {RECORD})
    name, other = names[pick(rng, names)], names[pick(rng, names)]
    kind = int(rng.integers(4))
    if kind == 0:
        del files[name]
        return f"{name} removed"
    if kind == 1:
        files[other] = files[name]
        return f"{other} replaced by {name}"
    more = ("more.xml", "meshes/walls_77_77.msh", "plugin.so", "textures/more.png")[int(rng.integers(4))]
    files[more] = files[name]
    if kind == 2:
        del files[name]
    return f"{name} {'renamed' if kind == 2 else 'copied'} to {more}"


CHANGES: list[Change] = [
    attribute_value, attribute_value, attribute_dropped, attribute_added, element_moved, element_added,
    rock_vertex, rock_vertex, _json_value, _json_value, _json_value, _mesh, _mesh, _mesh, _grid, _grid, _map_pixel,
    _map_text, _bytes, _bytes, _file,
]  # fmt: skip
