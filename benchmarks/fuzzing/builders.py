"""Build hostile files for the fuzzer: headers that lie, bombs, deep nesting and paths out of the folder."""

from __future__ import annotations

import json
import sqlite3
import struct
import tempfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from minexplore.bundle import FORMAT

Files = dict[str, bytes]
Named = dict[str, Callable[[], Files]]
LAUGHS = b"a: &a [x, x, x, x, x, x, x, x, x]\n" + b"".join(
    b"%c: &%c [%s]\n" % (98 + i, 98 + i, b", ".join([b"*%c" % (97 + i)] * 9)) for i in range(9)
)


def saved(name: str, write: Callable[[Path], Any]) -> Files:
    """Return the file of a name that a function writes, and behind it the files that it writes beside it."""
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / name)
        return {p.name: p.read_bytes() for p in sorted(Path(folder).iterdir(), key=lambda p: p.name != name)}


def png(
    width: int, height: int, depth: int = 8, colour: int = 0, more: bytes = b"", pixels: bytes | None = None
) -> bytes:
    """Return a PNG whose header states a size; `more` are chunks before the pixels."""
    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[colour]
    row = 1 + (width * channels * depth + 7) // 8
    if pixels is None:
        pixels = zlib.compress(bytes(min(row * height, 700_000_000)), 9)
    head = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + more + chunk(b"IDAT", pixels) + chunk(b"IEND", b"")


def chunk(kind: bytes, data: bytes) -> bytes:
    """Return a chunk of a PNG."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def tiff(tags: list[tuple[int, int, int, int]], data: bytes = b"", big: bool = False) -> bytes:
    """Return a TIFF of one directory; a tag is (tag, type, count, value)."""
    entry = "<HHQQ" if big else "<HHII"
    head = b"II" + (struct.pack("<HHHQ", 43, 8, 0, 16) if big else struct.pack("<HI", 42, 8))
    count = struct.pack("<Q" if big else "<H", len(tags))
    return head + count + b"".join(struct.pack(entry, *tag) for tag in tags) + bytes(8) + data


def grey_tiff(width: int, height: int, **more: int) -> bytes:
    """Return a grey TIFF of one compressed strip; `t277=3` replaces the tag 277."""
    values = {256: width, 257: height, 258: 8, 259: 8, 262: 1, 273: 512, 277: 1, 278: height, 279: 100_000}
    values |= {int(key[1:]): value for key, value in more.items()}
    data = zlib.compress(bytes(100_000_000), 9)
    tags = [(tag, 4, 1, value) for tag, value in sorted(values.items())]
    return tiff(tags).ljust(512, b"\0") + data


def pdf(content: bytes, box: str = "0 0 300 200", resources: bytes = b"<<>>", objects: tuple[bytes, ...] = ()) -> bytes:
    """Return a PDF of one page; `objects` are numbered from 5."""
    stream = b"<</Length %d /Filter /FlateDecode>>\nstream\n" % len(zlib.compress(content, 9))
    parts = [
        b"<</Type/Catalog/Pages 2 0 R>>",
        b"<</Type/Pages/Kids[3 0 R]/Count 1>>",
        b"<</Type/Page/Parent 2 0 R/MediaBox[%s]/Contents 4 0 R/Resources %s>>" % (box.encode(), resources),
        stream + zlib.compress(content, 9) + b"\nendstream",
        *objects,
    ]
    text = b"%PDF-1.7\n" + b"".join(b"%d 0 obj\n%s\nendobj\n" % (i, part) for i, part in enumerate(parts, 1))
    return text + b"trailer\n<</Size %d/Root 1 0 R>>\n%%%%EOF\n" % (len(parts) + 1)


def ply(count: str, more: str = "", body: bytes = b"") -> bytes:
    """Return a PLY file with a stated count."""
    text = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n"
    text += "".join(f"property float {axis}\n" for axis in "xyz")
    return (text + more + "end_header\n").encode() + body


def packed_pcd(size: int) -> bytes:
    """Return a PCD of one byte that LZF copies: about `size` bytes in a ninetieth of that."""
    copies = size // 264
    size = (1 + 264 * copies) // 12 * 12
    head = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
    head += f"POINTS {size // 12}\nDATA binary_compressed\n"
    data = b"\0\0" + b"\xe0\xff\0" * copies
    return head.encode() + struct.pack("<II", len(data), size) + data


def listing(*names: str) -> Files:
    """Return a bundle's record that lists files."""
    record = {"format": FORMAT, "files": dict.fromkeys(names, "0" * 64), "world_sha256": "0" * 64}
    return {"world.json": json.dumps(record).encode()}


def dxf(entities: str, blocks: str = "") -> bytes:
    """Return a plain DXF with entities and blocks."""
    section = f"0\nSECTION\n2\nBLOCKS\n{blocks}0\nENDSEC\n" if blocks else ""
    head = "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n0\nENDSEC\n"
    return f"{head}{section}0\nSECTION\n2\nENTITIES\n{entities}0\nENDSEC\n0\nEOF\n".encode()


def dxf_block(name: str, content: str) -> str:
    """Return a block of a DXF."""
    return f"0\nBLOCK\n8\n0\n2\n{name}\n70\n0\n10\n0\n20\n0\n30\n0\n{content}0\nENDBLK\n8\n0\n"


def dxf_insert(name: str, more: str = "") -> str:
    """Return a reference to a block."""
    return f"0\nINSERT\n8\n0\n2\n{name}\n10\n0\n20\n0\n30\n0\n{more}"


def chained_blocks(depth: int, fan: int, content: str = "") -> bytes:
    """Return a DXF whose blocks hold the one before `fan` times."""
    blocks = dxf_block("b0", content) + "".join(
        dxf_block(f"b{i}", dxf_insert(f"b{i - 1}") * fan) for i in range(1, depth)
    )
    return dxf(dxf_insert(f"b{depth - 1}"), blocks)


def star_ring(points: int) -> list[list[float]]:
    """Return a ring whose edges all cross."""
    turn = np.arange(points) * np.pi * (points // 2 * 2 - 1) / points
    ring = (100 * np.column_stack([np.cos(turn), np.sin(turn)])).round(6).tolist()
    return [*ring, ring[0]]


def geojson(geometry: Any, **more: Any) -> bytes:
    """Return a GeoJSON file in metres."""
    feature = {"type": "Feature", "properties": {}, "geometry": geometry}
    return json.dumps({"type": "FeatureCollection", "note": "metres", "features": [feature], **more}).encode()


def nested_collections(depth: int) -> bytes:
    """Return a GeoJSON feature of nested collections."""
    inner = '{"type":"GeometryCollection","geometries":[' * depth + "]}" * depth
    return b'{"type":"Feature","properties":{},"geometry":' + inner.encode() + b"}"


def gpkg(sql: str, srs: str = 'LOCAL_CS["x",UNIT["metre",1]]') -> bytes:
    """Return a GeoPackage with one layer `t`, whose table or view `sql` makes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "m.gpkg"
        base = sqlite3.connect(path)
        base.executescript(
            "PRAGMA application_id=1196444487; PRAGMA user_version=10300;"
            "CREATE TABLE gpkg_spatial_ref_sys(srs_name TEXT, srs_id INTEGER PRIMARY KEY, organization TEXT,"
            " organization_coordsys_id INTEGER, definition TEXT, description TEXT);"
            "CREATE TABLE gpkg_contents(table_name TEXT PRIMARY KEY, data_type TEXT, identifier TEXT, description TEXT,"
            " last_change TEXT, min_x REAL, min_y REAL, max_x REAL, max_y REAL, srs_id INTEGER);"
            "CREATE TABLE gpkg_geometry_columns(table_name TEXT, column_name TEXT, geometry_type_name TEXT,"
            " srs_id INTEGER, z INTEGER, m INTEGER);"
            "INSERT INTO gpkg_contents VALUES('t','features','t','','2026-01-01T00:00:00Z',0,0,1,1,1);"
            "INSERT INTO gpkg_geometry_columns VALUES('t','geom','GEOMETRY',1,0,0);"
        )
        base.execute("INSERT INTO gpkg_spatial_ref_sys VALUES('x',1,'NONE',1,?,'')", [srs])
        base.executescript(sql)
        base.commit()
        base.close()
        return path.read_bytes()


def gpkg_blob(wkb: bytes) -> str:
    """Return a geometry as an SQL literal."""
    return "x'" + (b"GP\x00\x01" + struct.pack("<i", 1) + wkb).hex() + "'"
