"""Write and read artifacts; suffix and type choose the format. Pickle is never used."""

from __future__ import annotations

import dataclasses
import io
import json
import math
import zipfile
import zlib
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np
import shapely
from pydantic import ValidationError
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import TriangleMesh, decode_msh, encode_msh
from minexplore.sealed.json_text import read_json
from pipeline.errors import ArtifactError
from pipeline.store.files import adapter_of, describe_field
from pipeline.store.hashing import require_plain
from pipeline.types import Areas, Frame, FreeSpace, Mask, Mesh, Workings

_UNREADABLE = (
    ValueError,
    KeyError,
    TypeError,
    OSError,
    EOFError,
    ValidationError,
    cv2.error,
    zipfile.BadZipFile,
    zlib.error,
    shapely.GEOSException,
    RecursionError,
    OverflowError,
)

_MOST_UNPACKED = 4_000_000_000  # bytes of an archive of arrays; those of a mine of 100 km have 300 MB
_ENCRYPTED = 0x1

_Kind = TypeVar("_Kind")
Meshes = dict[str, Mesh]
Bundle = dict[str, bytes]


def encode(path: Path, value: Any) -> bytes:
    """Return a value as bytes in the format of `path`'s suffix.

    Raises
    ------
    ArtifactError
        If no codec writes the suffix, or OpenCV cannot encode a picture.
    """
    if isinstance(value, bytes):
        return value
    if isinstance(value, str):
        return value.encode()
    match path.suffix:
        case ".png":
            return _encode_png(path, value)
        case ".json":
            return (json.dumps(_plain(value), indent=2, allow_nan=False) + "\n").encode()
        case ".geojson":
            if isinstance(value, Workings):
                return _collection(value.polygons, {})
            return _collection(value.polygon, {k: _plain(v) for k, v in vars(value).items() if k != "polygon"})
        case ".npz":
            return _encode_npz(value)
        case ".msh":
            return _encode_msh(value)
    raise ArtifactError(f"{path}: no codec writes {path.suffix!r} from {type(value).__name__}")


def decode(path: Path, kind: Any) -> Any:
    """Read an artifact as `kind`.

    Raises
    ------
    ArtifactError
        If the file is missing or is not a `kind`; the message names the file.
    """
    if not path.exists():
        raise ArtifactError(f"{path}: missing; run the stage that writes it (`dvc dag` shows which), or `make all`")
    if kind == Bundle:
        return path
    require_plain(path)
    if kind is bytes:
        return path.read_bytes()
    try:
        match path.suffix:
            case ".png":
                picture = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_UNCHANGED)
                if picture is None:
                    raise ValueError("not a PNG picture")
                return picture > 127 if kind is Mask else picture
            case ".json":
                data = path.read_bytes()
                content = read_json(path.name, data)
                return content if kind is dict else adapter_of(kind).validate_json(data, strict=True)
            case ".geojson":
                collection = read_json(path.name, path.read_bytes())
                return _decode_workings(collection) if kind is Workings else _decode_geojson(collection)
            case ".npz":
                return _decode_npz(read_npz(path), kind)
            case ".msh":
                return _decode_msh(path.read_bytes())
            case _:
                raise ValueError(f"no codec reads {path.suffix!r}")
    except _UNREADABLE as error:
        own = describe_field(error) if isinstance(error, ValidationError) else str(error)
        reason = " ".join(own.split())[:300]
        raise ArtifactError(f"{path}: not a readable {getattr(kind, '__name__', kind)}: {reason}") from error


def _plain(value: Any) -> Any:
    return adapter_of(type(value)).dump_python(value, mode="json") if dataclasses.is_dataclass(value) else value


def _encode_png(path: Path, picture: np.ndarray) -> bytes:
    pixels = picture.astype(np.uint8) * 255 if picture.dtype == bool else picture
    done, data = cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 6])
    if not done:
        raise ArtifactError(f"{path}: OpenCV could not encode the picture {picture.shape} {picture.dtype}")
    return data.tobytes()


def _collection(geometry: BaseGeometry, properties: dict[str, Any]) -> bytes:
    feature = {"type": "Feature", "geometry": json.loads(shapely.to_geojson(geometry)), "properties": properties}
    note = "local mine frame: metres, x east, y north; not longitude and latitude"
    collection = {"type": "FeatureCollection", "note": note, "features": [feature]}
    return (json.dumps(collection, allow_nan=False) + "\n").encode()


def _decode_workings(collection: dict) -> Workings:
    (feature,) = collection["features"]
    return Workings(MultiPolygon(shapely.get_parts(shapely.from_geojson(json.dumps(feature["geometry"]))).tolist()))


def _decode_geojson(collection: dict) -> FreeSpace:
    (feature,) = collection["features"]
    polygon, facts = shapely.from_geojson(json.dumps(feature["geometry"])), feature["properties"]
    if not isinstance(polygon, Polygon | MultiPolygon):  # several are pieces
        raise ValueError(f"a {polygon.geom_type}, want a Polygon or a MultiPolygon")
    return FreeSpace(
        polygon,
        _strictly(Areas, facts["areas"]),
        _strictly(float, facts["tolerance_m"]),
        _strictly(Frame, facts["frame"]),
    )


def _strictly(kind: type[_Kind], value: Any) -> _Kind:
    """Return a JSON value as a type; a text is no number."""
    return adapter_of(kind).validate_json(json.dumps(value), strict=True)


def _encode_npz(value: Any) -> bytes:
    arrays = (
        {f"{name}/{k}": v for name, mesh in value.items() for k, v in vars(mesh).items() if v is not None}
        if isinstance(value, dict)
        else {
            f.name: getattr(value, f.name)
            for f in dataclasses.fields(value)
            if not f.metadata.get("optional") or len(getattr(value, f.name))
        }
    )
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, values in arrays.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, np.asarray(values), version=(1, 0), allow_pickle=False)
            # Versions of Python write the header of a streamed member differently, and so does `numpy.savez`.
            entry = zipfile.ZipInfo(f"{name}.npy")
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, member.getvalue())
    return stream.getvalue()


def read_npz(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays of an archive; their sizes and types are read before memory is taken.

    Raises
    ------
    ValueError
        Naming the array that is too large, broken, or not of numbers.
    """
    arrays = {}
    with zipfile.ZipFile(path) as archive:
        size = sum(member.file_size for member in archive.infolist())
        if size > _MOST_UNPACKED:
            raise ValueError(f"{size} bytes when unpacked, want at most {_MOST_UNPACKED}")
        for member in archive.infolist():
            if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) or member.flag_bits & _ENCRYPTED:
                raise ValueError(f"{member.filename[:80]!r} is neither stored nor deflated")
            with archive.open(member) as stream:
                if np.lib.format.read_magic(stream) != (1, 0):
                    raise ValueError(f"{member.filename[:80]!r} is no array of version 1.0")
                shape, _, dtype = np.lib.format.read_array_header_1_0(stream)
                wanted = stream.tell() + math.prod(shape) * dtype.itemsize
            if dtype.kind not in "biuf" or min(shape, default=0) < 0 or wanted != member.file_size:
                raise ValueError(f"{member.filename[:80]!r} states {dtype} {shape}: no numbers, or not its size")
            with archive.open(member) as stream:
                arrays[member.filename.removesuffix(".npy")] = np.lib.format.read_array(stream, allow_pickle=False)
    return arrays


def _decode_npz(arrays: dict[str, np.ndarray], kind: Any) -> Any:
    if kind == Meshes:
        names = sorted({key.partition("/")[0] for key in arrays})
        fields = [f.name for f in dataclasses.fields(Mesh)]
        return {n: Mesh(**{f: arrays[f"{n}/{f}"] for f in fields if f"{n}/{f}" in arrays}) for n in names}
    return kind(**{k: v if v.ndim else v.item() for k, v in arrays.items()})


def _encode_msh(mesh: Mesh) -> bytes:
    # Pictures count rows downwards, texture coordinates upwards.
    flipped = np.column_stack([mesh.texcoords[:, 0], 1.0 - mesh.texcoords[:, 1]])
    normals = np.zeros((0, 3)) if mesh.normals is None else mesh.normals
    return encode_msh(TriangleMesh(mesh.vertices, mesh.faces, flipped, normals))


def _decode_msh(data: bytes) -> Mesh:
    found = decode_msh(data)
    if len(found.normals) not in (0, len(found.vertices)):
        raise ValueError(f"{len(found.normals)} normals for {len(found.vertices)} vertices")
    uv = found.texcoords.astype(np.float64)
    return Mesh(
        found.vertices.astype(np.float64),
        found.faces.astype(np.int32),
        np.column_stack([uv[:, 0], 1.0 - uv[:, 1]]),
        found.normals.astype(np.float64) if len(found.normals) else None,
    )
