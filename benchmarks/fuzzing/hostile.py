"""Instructive hostile files, by reader: one for each way to attack. A file replaces one of the reader's valid sample.

The reading process bounds time and memory whatever a file holds; these show the limits that refuse a file at once.
"""

from __future__ import annotations

import struct
import zlib

from benchmarks.fuzzing import builders as make
from benchmarks.fuzzing.builders import Named
from benchmarks.fuzzing.surveys import THERION, head

_ENDLESS = (
    "CREATE VIEW t AS WITH RECURSIVE c(i) AS (SELECT 1 UNION ALL SELECT i+1 FROM c) SELECT i AS fid, {} AS geom FROM c"
)
_POINT = make.gpkg_blob(struct.pack("<BIdd", 1, 1, 0.0, 0.0))
_SHOTS = b"1 2 20 0 0\n2 3 30 90 0\n"

HOSTILE: dict[str, Named] = {
    "png": {
        "header of 10^10 px": lambda: {"plan.png": make.png(100_000, 100_000, pixels=b"x")},
        "bomb of 16 bits and alpha": lambda: {
            "plan.png": make.png(14_000, 14_000, 16, 6, pixels=zlib.compress(b"x", 9))
        },
        "bomb of colour profile": lambda: {
            "plan.png": make.png(200, 120, more=make.chunk(b"iCCP", b"x\0\0" + zlib.compress(bytes(500_000_000), 9)))
        },
    },
    "tiff": {
        "sixty thousand channels": lambda: {"plan.tif": make.grey_tiff(200, 120, t277=60_000)},
        "BigTIFF of 2^60 tags": lambda: {"plan.tif": b"II+\0\x08\0\0\0" + struct.pack("<QQ", 16, 2**60) + bytes(900)},
    },
    "pdf": {
        "page of 10^9 points": lambda: {"plan.pdf": make.pdf(b"0 0 m", box="0 0 1000000000 1000000000")},
        "content bomb of 500 MB": lambda: {"plan.pdf": make.pdf(b"0 0 1 1 re f " * 40_000_000)},
    },
    "map.yaml": {
        "aliases": lambda: {"map.yaml": make.LAUGHS},
        "deep within the size": lambda: {"map.yaml": b"a: " + b"{a: " * 20_000},
    },
    "world file": {"digits without end": lambda: {"plan.pgw": b"9" * 90_000}},
    "dxf": {
        "blocks that hold each other": lambda: {
            "mine.dxf": make.dxf(
                make.dxf_insert("a"),
                make.dxf_block("a", make.dxf_insert("B")) + make.dxf_block("b", make.dxf_insert("A")),
            )
        },
        "empty blocks, ten to the tenth": lambda: {"mine.dxf": make.chained_blocks(10, 10)},
    },
    "pcd packed scan": {"bomb of 3 GB": lambda: {"c.pcd": make.packed_pcd(3_000_000_000)}},
    "geojson": {
        "collections 500 deep": lambda: {"mine.geojson": make.nested_collections(450)},
        "star of 20,000 rays": lambda: {
            "mine.geojson": make.geojson({"type": "Polygon", "coordinates": [make.star_ring(20_001)]})
        },
    },
    "geopackage": {
        "view without end": lambda: {"mine.gpkg": make.gpkg(_ENDLESS.format(_POINT))},
        "view that counts without end": lambda: {"mine.gpkg": make.gpkg(_ENDLESS.format(_POINT) + " WHERE i < 0")},
    },
    "ply": {
        "more points than stated": lambda: {
            "c.ply": make.ply("3", body=b"1 2 3\n" * 500).replace(b"binary_little_endian", b"ascii")
        }
    },
    "solved .3d": {"label of 4 GB": lambda: {"mine.3d": head() + b"\x82\0\xff\0\0\0\0\xff\xff\xff\xff\xff"}},
    "survex project": {
        "file above, after blanks that Survex knows": lambda: {"main.svx": b" ,*,include,/etc/passwd\n" + _SHOTS},
        "file above, after a control character that ends a line": lambda: {
            "main.svx": b"*include south\n; a comment \x1a*include ../../../etc/passwd\n"
        },
        "file above, after a mark of UTF-8": lambda: {"main.svx": b"\xef\xbb\xbf*include ../../../etc/passwd\n"},
        "file above, in a file of another format": lambda: {
            "main.svx": b"*include other.mak\n",
            "other.mak": b"#../../../etc/passwd;\n",
        },
        "begin a hundred thousand deep": lambda: {"main.svx": b"*include south\n" + b"*begin a\n" * 100_000},
    },
    "therion": {
        "imported file above": lambda: {"mine.th": b"survey mine\nimport ../../../etc/passwd.3d\nendsurvey\n"},
        "last line continued": lambda: {"mine.th": THERION["mine.th"] + b"equate 1 2 \\"},
    },
    "compass data": {
        "file above, its name over two lines": lambda: {"mine.mak": b"#\r\n../../../etc/passwd;\r\n"},
        "file above, in what looks like a comment": lambda: {"mine.mak": b"/#a\r\n#../../../etc/passwd;\r\n"},
        "two files in a line, the second outside": lambda: {"mine.mak": b"#mine.dat; #/etc/passwd;\r\n"},
        "hundred thousand files": lambda: {"mine.mak": b"#mine.dat;\r\n" * 100_000},
    },
    "bundle": {"file above the folder": lambda: make.listing("../../x")},
    "survey section": {"deep": lambda: {"conf.yaml": b"[" * 50_000}},
}
