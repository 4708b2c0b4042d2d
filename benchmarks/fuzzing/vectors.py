"""Hostile drawings and geographic files, made when they are needed."""

from __future__ import annotations

import gzip
import json
import struct
from functools import partial

import numpy as np

from benchmarks.fuzzing import vector_builders as make
from benchmarks.fuzzing.builders import Named, absurd_numbers, zip_of
from benchmarks.fuzzing.vector_builders import dxf_block, dxf_insert, dxf_line

_DEEP = b"[" * 200_000 + b"]" * 200_000
_ENTITIES = (
    b'<?xml version="1.0"?><!DOCTYPE l [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;">]><l>&b;</l>'
)


DXF: Named = {
    "a grid of 10^9 corners that ends": lambda: {
        "mine.dxf": make.dxf(
            "0\nPOLYLINE\n8\n0\n66\n1\n70\n16\n71\n30000\n72\n30000\n0\nVERTEX\n8\n0\n10\n1\n20\n1\n0\nSEQEND\n"
        )
    },
    "300,000 lines": lambda: {"mine.dxf": make.dxf("0\nLINE\n" * 300_000)},
    "blocks that hold themselves": lambda: {"mine.dxf": make.dxf(dxf_insert("a"), dxf_block("a", dxf_insert("a")))},
    "blocks that hold each other": lambda: {
        "mine.dxf": make.dxf(dxf_insert("a"), dxf_block("a", dxf_insert("B")) + dxf_block("b", dxf_insert("A")))
    },
    "empty blocks, ten to the tenth": lambda: {"mine.dxf": make.chained_blocks(10, 10)},
    "lines in blocks, ten to the eighth": lambda: {"mine.dxf": make.chained_blocks(8, 10, dxf_line(0, 0, 1, 1))},
    "blocks a thousand deep": lambda: {"mine.dxf": make.chained_blocks(1000, 1, dxf_line(0, 0, 1, 1))},
    "array of 10^9 references": lambda: {
        "mine.dxf": make.dxf(
            dxf_insert("a", "70\n32767\n71\n32767\n44\n1\n45\n1\n"), dxf_block("a", dxf_line(0, 0, 1, 1))
        )
    },
    "scales of 10^308": lambda: {
        "mine.dxf": make.dxf(dxf_insert("a", "41\n1e308\n42\n1e308\n"), dxf_block("a", dxf_line(0, 0, 9, 9)))
    },
    "grid of 1000 x 1000 lines": lambda: {
        "mine.dxf": make.dxf("".join(dxf_line(*a, *b) for a, b in make.grid_lines(1000)))
    },
    "arc and circle of 10^300": lambda: {
        "mine.dxf": make.dxf(
            "0\nCIRCLE\n8\n0\n10\n0\n20\n0\n40\n1e300\n0\nARC\n8\n0\n10\n0\n20\n0\n40\n1e-300\n50\n0\n51\n1e300\n"
        )
    },
    "spline of degree 10^9": lambda: {
        "mine.dxf": make.dxf(
            "0\nSPLINE\n8\n0\n70\n8\n71\n999999999\n72\n9\n73\n4\n74\n0\n" + "40\n0\n" * 9 + "10\n1\n20\n2\n30\n0\n" * 4
        )
    },
    "polyline of 3 million points": lambda: {
        "mine.dxf": make.dxf("0\nLWPOLYLINE\n8\n0\n90\n3000000\n70\n1\n" + "10\n1\n20\n2\n" * 3_000_000)
    },
    "bulges of 10^300": lambda: {
        "mine.dxf": make.dxf(
            "0\nLWPOLYLINE\n8\n0\n90\n3\n70\n1\n" + "10\n1\n20\n2\n42\n1e300\n10\n5\n20\n9\n42\n-1e300\n"
        )
    },
    "one line of 60 MB": lambda: {"mine.dxf": make.dxf("0\nTEXT\n1\n" + "x" * 60_000_000 + "\n")},
    "binary": lambda: {"mine.dxf": b"AutoCAD Binary DXF\r\n\x1a\x00" + b"\x00\x00LINE\x00" * 9_000_000},
    **absurd_numbers(
        "mine.dxf", lambda n: make.dxf(dxf_line(0, 0, 50, 0) + dxf_line(50, 0, n, 40) + dxf_line(n, 40, 0, 0))
    ),
}


def _ring(*points: tuple[float, float]) -> dict:
    return {"type": "Polygon", "coordinates": [[*points, points[0]]]}


def _in_system(name: str) -> dict[str, bytes]:
    feature = {"type": "Feature", "properties": {}, "geometry": _ring((0, 0), (60, 0), (60, 5), (0, 5))}
    system = {"type": "name", "properties": {"name": name}}
    return {"mine.geojson": json.dumps({"type": "FeatureCollection", "crs": system, "features": [feature]}).encode()}


# Another planet, a file, an address, a grid that is a file, and a system of three axes.
SYSTEMS = (
    "IAU_2015:30100",
    "+init=/etc/passwd:a",
    "http://127.0.0.1/x",
    "+proj=pipeline +step +grids=/etc/passwd",
    "EPSG:4978",
)
GEOJSON: Named = {
    "system of half a character": lambda: {
        "mine.geojson": b'{"type": "Polygon", "crs": {"properties": {"name": "\\ud800"}}, "coordinates": '
        b"[[[0, 0], [60, 0], [60, 5], [0, 5], [0, 0]]]}"
    },
    "deep features": lambda: {"mine.geojson": b'{"type": "FeatureCollection", "features": ' + _DEEP + b"}"},
    "deep array": lambda: {"mine.geojson": b"[" * 1_000_000},
    "deep objects": lambda: {"mine.geojson": b'{"type":' * 300_000},
    "XML entities": lambda: {"mine.geojson": _ENTITIES},
    "collections 500 deep": lambda: {"mine.geojson": make.nested_collections(450)},
    "collections 100,000 deep": lambda: {"mine.geojson": make.nested_collections(100_000)},
    "grid of 1000 x 1000 lines": lambda: {
        "mine.geojson": make.geojson({"type": "MultiLineString", "coordinates": make.grid_lines(1000)})
    },
    "star of 20,000 rays": lambda: {
        "mine.geojson": make.geojson({"type": "Polygon", "coordinates": [make.star_ring(20_001)]})
    },
    "hundred thousand equal lines": lambda: {
        "mine.geojson": make.geojson({"type": "MultiLineString", "coordinates": [[[0, 0], [9, 9]]] * 100_000})
    },
    "long slanting lines side by side": lambda: {
        "mine.geojson": make.geojson(
            {"type": "MultiLineString", "coordinates": [[[i * 1e-3, 0], [i * 1e-3 + 500, 500]] for i in range(90_000)]}
        )
    },
    "ten thousand nested rings": lambda: {
        "mine.geojson": make.geojson(
            {
                "type": "MultiLineString",
                "coordinates": [
                    [[i, i], [40_000 - i, i], [40_000 - i, 40_000 - i], [i, 40_000 - i], [i, i]]
                    for i in np.arange(0, 2000, 0.2).tolist()
                ],
            }
        )
    },
    "polygon of 20,000 touching holes": lambda: {
        "mine.geojson": make.geojson(
            {
                "type": "Polygon",
                "coordinates": [[[0, 0], [900, 0], [900, 900], [0, 900], [0, 0]]]
                + [[[i, j], [i + 5, j], [i + 5, j + 5], [i, j]] for i in range(1, 890, 6) for j in range(1, 890, 6)],
            }
        )
    },
    "three million points": lambda: {
        "mine.geojson": make.geojson({"type": "LineString", "coordinates": [[0, 1]] * 3_000_000})
    },
    "million features": lambda: {
        "mine.geojson": b'{"type":"FeatureCollection","features":[' + b"{}," * 1_000_000 + b"{}]}"
    },
    "digits without end": lambda: {
        "mine.geojson": make.geojson(_ring((0, 0), (9, 0), (9, 9))).replace(
            b"[9, 9]", b"[9, 9" + b"9" * 5_000_000 + b"]"
        )
    },
    "layer names of 60 MB": lambda: {"mine.geojson": make.geojson(None, features=[{"properties": "x" * 60_000_000}])},
    **{f"coordinate system {name[:16]}": partial(_in_system, name) for name in SYSTEMS},
    "unit with line breaks": lambda: {
        "mine.geojson": json.dumps(
            {
                "type": "FeatureCollection",
                "crs": {"type": "name", "properties": {"name": 'LOCAL_CS["a",UNIT["b\n  image: /etc/passwd\n",1]]'}},
                "features": [
                    {"type": "Feature", "properties": {}, "geometry": _ring((0, 0), (60, 0), (60, 5), (0, 5))}
                ],
            }
        ).encode()
    },
    **absurd_numbers(
        "mine.geojson",
        lambda n: make.geojson(_ring((0, 0), (60, 0), (60, 5), (0, 5))).replace(b"[60, 5]", f"[{n}, 5]".encode()),
    ),
}
_SQUARE = struct.pack("<BIII8d", 1, 3, 1, 4, 0, 0, 60, 0, 60, 5, 0, 0)
_BIG = "WITH RECURSIVE c(i) AS (SELECT 1 UNION ALL SELECT i+1 FROM c{}) SELECT i AS fid, {} AS geom FROM c"
_POINT = make.gpkg_blob(struct.pack("<BIdd", 1, 1, 0.0, 0.0))
GEOPACKAGE: Named = {
    "XML entities": lambda: {"mine.gpkg": _ENTITIES},
    "virtual format": lambda: {"mine.gpkg": b"<OGRVRTDataSource><OGRVRTLayer/></OGRVRTDataSource>"},
    "gzip": lambda: {"mine.gpkg": gzip.compress(bytes(100_000_000))},
    "zip": lambda: {"mine.gpkg": zip_of(bytes(100_000_000))},
    "write-ahead log": lambda: {"mine.gpkg": _in_log_mode(_layer(_SQUARE))},
    "journal to roll back": lambda: {
        "mine.gpkg": _layer(_SQUARE),
        "mine.gpkg-journal": bytes.fromhex("d9d505f920a163d7") + struct.pack(">IIII", 1, 1, 9, 512) + bytes(5000),
    },
    "view without end": lambda: {"mine.gpkg": make.gpkg("CREATE VIEW t AS " + _BIG.format("", _POINT))},
    "view that counts without end": lambda: {
        "mine.gpkg": make.gpkg("CREATE VIEW t AS " + _BIG.format("", _POINT) + " WHERE i < 0")
    },
    "blob of 1 GB from nothing": lambda: {
        "mine.gpkg": make.gpkg("CREATE VIEW t AS SELECT 1 AS fid, zeroblob(999999999) AS geom")
    },
    "collections 100,000 deep": lambda: {"mine.gpkg": _layer(make.wkb_collection(100_000))},
    "line of 2^32 points": lambda: {"mine.gpkg": _layer(struct.pack("<BII", 1, 2, 2**32 - 1))},
    "polygon of 2^32 rings": lambda: {"mine.gpkg": _layer(struct.pack("<BII", 1, 3, 2**32 - 1))},
    "layer that is a file": lambda: {
        "mine.gpkg": make.gpkg("CREATE VIEW t AS SELECT 1 AS fid, readfile('/etc/passwd') AS geom")
    },
    "coordinate system of 5 MB": lambda: {
        "mine.gpkg": make.gpkg("CREATE TABLE t(fid INTEGER PRIMARY KEY, geom BLOB)", "PROJCS[" * 800_000)
    },
    "unit with line breaks": lambda: {
        "mine.gpkg": _layer(
            struct.pack("<BIII8d", 1, 3, 1, 4, 0, 0, 60, 0, 60, 5, 0, 0), 'LOCAL_CS["a",UNIT["b\n  image: x\n",1]]'
        )
    },
    "five thousand layers": lambda: {"mine.gpkg": make.gpkg(_many_layers(5000))},
    **absurd_numbers(
        "mine.gpkg", lambda n: _layer(struct.pack("<BIII8d", 1, 3, 1, 4, 0, 0, 60, 0, _double(n), 5, 0, 0))
    ),
}


def _double(text: str) -> float:
    return float.fromhex(text) if text.startswith("0x") else float(text)


def _in_log_mode(data: bytes) -> bytes:
    return data[:18] + b"\x02\x02" + data[20:]


def _layer(wkb: bytes, srs: str = 'LOCAL_CS["x",UNIT["metre",1]]') -> bytes:
    table = "CREATE TABLE t(fid INTEGER PRIMARY KEY, geom BLOB);"
    return make.gpkg(f"{table}INSERT INTO t VALUES(1,{make.gpkg_blob(wkb)})", srs)


def _many_layers(count: int) -> str:
    return "".join(
        f"CREATE TABLE l{i}(fid INTEGER PRIMARY KEY, geom BLOB);"
        f"INSERT INTO gpkg_contents VALUES('l{i}','features','l{i}','','2026-01-01T00:00:00Z',0,0,1,1,1);"
        f"INSERT INTO gpkg_geometry_columns VALUES('l{i}','geom','GEOMETRY',1,0,0);"
        for i in range(count)
    )


SHAPEFILE: Named = {
    "all ones": lambda: {"mine.shp": b"\x00\x00\x27\x0a" + b"\xff" * 96},
    "table of ones": lambda: {"mine.dbf": b"\xff" * 4096},
    "polygon of 2^31 points": lambda: make.shapefile(make.shp_record(5, 1, 2**31 - 1, bytes(64))),
    "polygon of 2^31 parts": lambda: make.shapefile(make.shp_record(5, 2**31 - 1, 4, bytes(64))),
    "stated length of 8 GB": lambda: make.shapefile(make.shp_record(5, 1, 4, bytes(68)), length=2**31 - 1),
    "index of 10 million equal records": lambda: {
        "mine.shx": struct.pack(">i20xi", 9994, 50 + 4 * 10_000_000)
        + struct.pack("<ii8d", 1000, 5, *[0.0] * 8)
        + struct.pack(">ii", 50, 60) * 10_000_000
    },
    "coordinate system of 10 MB": lambda: {"mine.prj": b"PROJCS[" * 1_500_000},
    "unit with line breaks": lambda: {"mine.prj": b'LOCAL_CS["a",UNIT["b\n  image: x",1]]'},
    "table of 2^32 rows": lambda: {"mine.dbf": struct.pack("<B3BIHH20x", 3, 26, 1, 1, 2**32 - 1, 65, 65_535) + b"\r"},
}


def _lines(*lines: object) -> dict[str, bytes]:
    geometry = {"type": "MultiLineString", "coordinates": lines}
    feature = {"type": "Feature", "properties": {}, "geometry": geometry}
    content = {"type": "FeatureCollection", "features": [feature], "note": "metres"}
    return {"mine.geojson": json.dumps(content).encode()}


def _risen(number: str) -> bytes:
    return _lines([[0, 0, 5], [40, 0, "N"]])["mine.geojson"].replace(b'"N"', number.encode())


CENTRELINES: Named = {
    "50,000 ends in one place": lambda: _lines(*([[0, 0, 5], [9 + k / 1e4, 3, 7]] for k in range(50_000))),
    "3,000 lines that cross": lambda: _lines(
        *([[k, -1, 5], [k, 1600, 5]] for k in range(1500)), *([[-1, k, 5], [1600, k, 5]] for k in range(1500))
    ),
    "60,000 points in one place": lambda: _lines([[k % 3, 0, k % 5] for k in range(60_000)]),
    "plumb lines 20 km deep": lambda: _lines([[0, 0, 9000], [0, 0, -9000]], [[0, 0, 9000], [40, 0, 9000]]),
    "10,000 passages over each other": lambda: _lines(*([[0, 0, k], [60, 0.1 * k, k]] for k in range(9999))),
    "a coordinate of four numbers": lambda: _lines([[0, 0, 5, 7], [40, 0, 5, 7]]),
    **absurd_numbers("mine.geojson", _risen),
}


def _sparse_raster(side: int) -> dict[str, bytes]:
    """Return a GeoTIFF of so many cells a side, of which none is stored."""
    import tempfile
    from pathlib import Path

    import rasterio
    from rasterio.transform import from_origin

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "heights.tif"
        shape = {"width": side, "height": side, "count": 1, "dtype": "float64", "sparse_ok": True, "tiled": True}
        with rasterio.open(path, "w", driver="GTiff", transform=from_origin(0, 40, 1e-3, 1e-3), **shape):
            pass
        return {"heights.tif": path.read_bytes()}


HEIGHT_RASTER: Named = {
    "60,000 x 60,000 cells that are not stored": lambda: _sparse_raster(60_000),
    "5,000 x 5,000 cells in a few metres": lambda: _sparse_raster(5000),
    "a virtual raster": lambda: {
        "heights.tif": b'<VRTDataset rasterXSize="9" rasterYSize="9"><VRTRasterBand><SimpleSource>'
        b"<SourceFilename>/etc/passwd</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>"
    },
}
_GRID = "ncols {0}\nnrows {0}\nxllcorner 0\nyllcorner 0\ncellsize {1}\n"
HEIGHT_GRID: Named = {
    "10^9 columns and rows": lambda: {"heights.asc": _GRID.format(10**9, 1).encode() + b"1 2 3\n"},
    "30,000 columns and rows, empty": lambda: {"heights.asc": _GRID.format(30_000, 0.01).encode()},
    "a number of 30 MB": lambda: {"heights.asc": _GRID.format(2, 20).encode() + b"1" * 30_000_000 + b" 1 1 1\n"},
    **absurd_numbers("heights.asc", lambda n: (_GRID.format(2, 20) + f"1 {n}\n1 1\n").encode()),
}
CONTOUR_LINES: Named = {
    "a text": lambda: {"heights.gpkg": b"not a database"},
    "a database of another kind": lambda: {"heights.gpkg": b"SQLite format 3\x00" + bytes(4096)},
}
HEIGHT_LABELS: Named = {
    "a line of 10^11 m": lambda: {"heights.dxf": make.dxf(dxf_line(0, 0, 10**11, 1).replace("31\n0", "31\n9"))},
    "100,000 labels in one place": lambda: {
        "heights.dxf": make.dxf(dxf_line(0, 0, 9, 9) + "0\nTEXT\n8\n0\n10\n3\n20\n3\n30\n0\n40\n1\n1\n1.5\n" * 100_000)
    },
    "a label of 10 MB": lambda: {
        "heights.dxf": make.dxf(
            dxf_line(0, 0, 9, 9) + "0\nTEXT\n8\n0\n10\n3\n20\n3\n30\n0\n40\n1\n1\n" + "1" * 10_000_000 + "\n"
        )
    },
    "codes within codes": lambda: {
        "heights.dxf": make.dxf(
            dxf_line(0, 0, 9, 9) + "0\nMTEXT\n8\n0\n10\n3\n20\n3\n30\n0\n40\n1\n1\n" + "{\\\\S1/2;" * 20_000 + "\n"
        )
    },
    **absurd_numbers(
        "heights.dxf",
        lambda n: make.dxf(dxf_line(0, 0, 9, 9) + f"0\nTEXT\n8\n0\n10\n{n}\n20\n3\n30\n0\n40\n1\n1\n1.5\n"),
    ),
}
