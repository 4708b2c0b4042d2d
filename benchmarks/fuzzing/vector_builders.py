"""Build hostile drawings and geographic files for the fuzzer."""

from __future__ import annotations

import json
import sqlite3
import struct
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fuzzing.builders import Files


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


def dxf_line(x0: Any, y0: Any, x1: Any, y1: Any) -> str:
    """Return a line of a DXF."""
    return f"0\nLINE\n8\n0\n10\n{x0}\n20\n{y0}\n30\n0\n11\n{x1}\n21\n{y1}\n31\n0\n"


def chained_blocks(depth: int, fan: int, content: str = "") -> bytes:
    """Return a DXF whose blocks hold the one before `fan` times."""
    blocks = dxf_block("b0", content) + "".join(
        dxf_block(f"b{i}", dxf_insert(f"b{i - 1}") * fan) for i in range(1, depth)
    )
    return dxf(dxf_insert(f"b{depth - 1}"), blocks)


def geojson(geometry: Any, **more: Any) -> bytes:
    """Return a GeoJSON file in metres."""
    feature = {"type": "Feature", "properties": {}, "geometry": geometry}
    return json.dumps({"type": "FeatureCollection", "note": "metres", "features": [feature], **more}).encode()


def grid_lines(n: int) -> list[list[list[int]]]:
    """Return lines that cross n * n times."""
    return [[[i, -1], [i, n]] for i in range(n)] + [[[-1, i], [n, i]] for i in range(n)]


def star_ring(points: int) -> list[list[float]]:
    """Return a ring whose edges all cross."""
    turn = np.arange(points) * np.pi * (points // 2 * 2 - 1) / points
    ring = (100 * np.column_stack([np.cos(turn), np.sin(turn)])).round(6).tolist()
    return [*ring, ring[0]]


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


def wkb_collection(depth: int) -> bytes:
    """Return nested collections as WKB."""
    return struct.pack("<BII", 1, 7, 1) * depth + struct.pack("<BII", 1, 2, 0)


def shp(kind: int, records: list[bytes], **head: int) -> bytes:
    """Return a .shp file; `length` and `count` replace stated sizes."""
    body = b"".join(struct.pack(">ii", i, len(record) // 2) + record for i, record in enumerate(records, 1))
    length = head.get("length", (100 + len(body)) // 2)
    return struct.pack(">i20xi", 9994, length) + struct.pack("<ii8d", 1000, kind, *[0.0] * 8) + body


def shx(records: list[bytes]) -> bytes:
    """Return the index of a Shapefile."""
    body, at = b"", 50
    for record in records:
        body += struct.pack(">ii", at, len(record) // 2)
        at += 4 + len(record) // 2
    return struct.pack(">i20xi", 9994, 50 + len(body) // 2) + struct.pack("<ii8d", 1000, 5, *[0.0] * 8) + body


def shp_record(kind: int, parts: int, points: int, data: bytes = b"") -> bytes:
    """Return a record of a Shapefile with stated counts."""
    return struct.pack("<i4dii", kind, 0, 0, 9, 9, parts, points) + data


def shapefile(record: bytes, **head: int) -> Files:
    """Return a Shapefile of one record."""
    return {"mine.shp": shp(5, [record], **head), "mine.shx": shx([record])}
