"""Hostile files of every reader, by its name. A file replaces one of the reader's valid sample."""

from __future__ import annotations

import struct

import numpy as np

from benchmarks.fuzzing import builders as make
from benchmarks.fuzzing import pictures, surveys, vectors
from benchmarks.fuzzing.builders import LAUGHS, TAGGED, Named, absurd_numbers
from benchmarks.fuzzing.levels import LEVELS

STATIONS: Named = {
    "one leg of 60,000 stations": lambda: {
        "s.csv": make.station_csv([f"A,s{i},{i / 10:g},0,2,2" for i in range(60_000)])
    },
    "one leg of 40,000 stations": lambda: {
        "s.csv": make.station_csv([f"A,s{i},{i / 10:g},0,2,2" for i in range(40_000)])
    },
    "ten thousand rooms in one place": lambda: {
        "s.csv": make.station_csv([f"A,s{i},{i % 7},{i % 11},50,50" for i in range(10_000)])
    },
    "thousand legs that cross": lambda: {
        "s.csv": make.station_csv(
            [row for i in range(5000) for row in (f"l{i},a{i},{i},0,1,1", f"l{i},b{i},{5000 - i},900,1,1")]
        )
    },
    "empty rows": lambda: {"s.csv": make.station_csv([","] * 20_000_000)},
    "one row of 30 million cells": lambda: {"s.csv": make.station_csv(["," * 30_000_000])},
    "header of a million columns": lambda: {"s.csv": b"," * 1_000_000 + b"\n1\n"},
    "a cell of 60 MB": lambda: {"s.csv": make.station_csv(["A," + "a" * 60_000_000 + ",0,0,1,1"])},
    "quotes": lambda: {"s.csv": make.station_csv(['"' * 60_000_000])},
    **absurd_numbers("s.csv", lambda n: make.station_csv(["A,a,0,0,2,2", f"A,b,{n},5,2,2", "A,c,9,9,2,2"])),
}
_SHOTS = "*data normal from to tape compass clino\n"
SURVEX: Named = {
    "file outside the folder": lambda: {"cave.svx": b"*include ../../../etc/passwd\n"},
    "file that includes itself": lambda: {"cave.svx": b"*include cave\n"},
    "files that include each other": lambda: {"more.svx": b"*include cave\n"},
    "begin without end": lambda: {"cave.svx": b"*begin a\n" * 100_000},
    "names of 100 kB, 90 deep": lambda: {
        "cave.svx": (b"*begin " + b"a" * 100_000 + b"\n") * 90 + b"1 2 9 9 9\n" * 50_000
    },
    "random network of 190,000 shots": lambda: {
        "cave.svx": (
            _SHOTS
            + "".join(
                f"{a} {b} 9 9 9\n"
                for a, b in np.random.default_rng(0).integers(0, 40_000, (190_000, 2)).tolist()
                if a != b
            )
        ).encode()
    },
    "million passages": lambda: {
        "cave.svx": b"*data passage station left right up down\n" + b"1 1 1 1 1\n" * 1_000_000
    },
    "million equates": lambda: {
        "cave.svx": _SHOTS.encode() + b"1 2 9 9 9\n" + b"".join(b"*equate a%d a%d\n" % (i, i + 1) for i in range(10**6))
    },
    "one line of 60 MB": lambda: {"cave.svx": b"1 " * 30_000_000},
    "three thousand files": lambda: {
        "cave.svx": b"".join(b"*include f%d\n" % i for i in range(3000)),
        **{f"f{i}.svx": b"*include f%d\n" % (i + 1) for i in range(3000)},
    },
    "readings named twice": lambda: {"cave.svx": b"*data normal from to tape tape compass clino\n1 2 9 9 9 0\n"},
    "walls of 10 km": lambda: {
        "cave.svx": f"{_SHOTS}1 2 9 9 9\n*data passage station left right\n1 9999 9999\n2 1 1\n".encode()
    },
    "units of 10^8": lambda: {"cave.svx": f"*units tape 99999999 metres\n{_SHOTS}1 2 99999999 0 0\n".encode()},
    **absurd_numbers("cave.svx", lambda n: f"{_SHOTS}1 2 {n} 0 0\n2 3 9 9 9\n".encode()),
}
COMPASS: Named = {
    "million lines": lambda: {"cave.plt": b"M 1 1 0 Sa P 1 1 1 1\n" * 1_000_000},
    "rooms of 900 feet in one place": lambda: {
        "cave.plt": b"".join(b"D %d %d 0 Ss%d P 899 899 1 899\n" % (i % 7, i % 11, i) for i in range(9000))
    },
    "no line breaks": lambda: {"cave.plt": b"D 1 1 0 Sa P " + b"1 " * 25_000_000},
    **absurd_numbers("cave.plt", lambda n: f"M 0 0 0 Sa P 5 5 5 5\nD {n} 9 0 Sb P 5 5 5 5\n".encode()),
}
_BINARY = b"binary_little_endian"
_POINT = "".join(f"property float {axis}\n" for axis in "xyz")
CLOUDS: dict[str, Named] = {
    "xyz": {
        "one line of 300 MB": lambda: {"c.xyz": b"1 " * 150_000_000},
        "columns without end": lambda: {"c.xyz": (b"1 " * 100_000 + b"\n") * 500},
        "digits without end": lambda: {"c.xyz": b"9" * 50_000_000 + b" 1 1\n"},
        **absurd_numbers("c.xyz", lambda n: (f"1 2 {n}\n" * 200).encode()),
    },
    "ply": {
        "10^12 points": lambda: {"c.ply": make.ply("999999999999")},
        "negative points": lambda: {"c.ply": make.ply("-5")},
        "points are no number": lambda: {"c.ply": make.ply("x" * 5000)},
        "more points than stated": lambda: {"c.ply": make.ply("3", body=b"1 2 3\n" * 500).replace(_BINARY, b"ascii")},
        "two elements of points": lambda: {
            "c.ply": make.ply("3", f"element vertex 3\n{_POINT}", b"1 2 3\n" * 6).replace(_BINARY, b"ascii")
        },
        "properties named twice": lambda: {"c.ply": make.ply("3", "property float x\n", bytes(48))},
        "faces are no number": lambda: {"c.ply": make.ply("3", "element face\nproperty list uchar int v\n", bytes(99))},
        "face of 255 points": lambda: {
            "c.ply": make.ply("3", "element face 1000000\nproperty list uchar int v\n", bytes(36) + b"\xff" * 9_000_000)
        },
        "hundred thousand properties": lambda: {
            "c.ply": make.ply("3", "".join(f"property float p{i}\n" for i in range(100_000)), bytes(1_200_036))
        },
        "header without end": lambda: {"c.ply": b"ply\n" + b"comment x\n" * 10_000_000},
    },
    "pcd": {
        "10^12 points": lambda: {"c.pcd": make.pcd("999999999999")},
        "10^12 binary points": lambda: {"c.pcd": make.pcd("999999999999", "binary")},
        "compressed bomb": lambda: {
            "c.pcd": make.pcd("1000000", "binary_compressed", struct.pack("<II", 99, 2**32 - 1) + bytes(99))
        },
        "negative points": lambda: {"c.pcd": make.pcd("-7")},
        "more binary points than stated": lambda: {"c.pcd": make.pcd("9", "binary", bytes(12_000))},
        "million fields": lambda: {"c.pcd": make.pcd("9").replace(b"x y z", b"x " * 1_000_000)},
    },
    "las": {
        "2^32 points": lambda: {"c.las": make.las(2**32 - 1)},
        "data beyond the end": lambda: {"c.las": make.las(50, offset=2**31)},
        "records of no size": lambda: {"c.las": make.las(50, size=0)},
        "2^32 records of variables": lambda: {"c.las": make.las(50)[:100] + b"\xff\xff\xff\xff" + make.las(50)[104:]},
    },
    "stl": {
        "2^32 triangles": lambda: {"c.stl": bytes(80) + b"\xff\xff\xff\xff" + bytes(5000)},
        "million words": lambda: {"c.stl": b"solid x\n" + b"facet normal 0 0 1\n" * 1_000_000},
        "triangles of 10^30": lambda: {
            "c.stl": bytes(80)
            + struct.pack("<I", 9)
            + (struct.pack("<12f", *[1e30 * i for i in range(12)]) + b"\0\0") * 9
        },
    },
    "obj": {
        "face of 10^12": lambda: {"c.obj": b"v 0 0 0\n" * 3 + b"f 1 2 999999999999\n"},
        "million groups": lambda: {"c.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\n" + b"usemtl a\nf 1 2 3\n" * 100_000},
        "material outside the folder": lambda: {
            "c.obj": b"mtllib ../../../etc/passwd\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
        },
        "polygon of a million corners": lambda: {"c.obj": b"v 0 0 0\n" * 3 + b"f " + b"1 2 3 " * 400_000 + b"\n"},
    },
}
SWEEP: Named = {
    "three million rows": lambda: {"sweep.csv": b"theta_mu,range_mu,range_var\n" + b"0,1,0\n" * 3_000_000},
    "70 MB": lambda: {"sweep.csv": b"theta_mu,range_mu,range_var\n" + b"0,1,0\n" * 12_000_000},
    **absurd_numbers("sweep.csv", lambda n: f"theta_mu,range_mu,range_var\n0,{n},0\n".encode()),
}
SECTION: Named = {
    "tag": lambda: {"conf.yaml": TAGGED},
    "aliases": lambda: {"conf.yaml": LAUGHS},
    "interpolation": lambda: {"conf.yaml": b"kind: ${oc.env:HOME}\n"},
    "deep": lambda: {"conf.yaml": b"[" * 50_000},
    "large": lambda: {"conf.yaml": b"a: 1\n" * 1_000_000},
}
BUNDLE: Named = {
    "file above the folder": lambda: make.listing("../../x"),
    "file with an absolute path": lambda: make.listing("/etc/passwd"),
    "file above by detours": lambda: make.listing("a/../../b"),
    "file without a name": lambda: make.listing(""),
    "deep": lambda: {"world.json": b"{" * 100_000},
}
HOSTILE: dict[str, Named] = {
    "png": pictures.PNG,
    "jpeg": pictures.JPEG,
    "tiff": pictures.TIFF,
    "pdf": pictures.PDF,
    "geotiff": pictures.GEOTIFF,
    "world file": pictures.WORLD_FILE,
    "map.yaml": pictures.MAP,
    "dxf": vectors.DXF,
    "geojson": vectors.GEOJSON,
    "geopackage": vectors.GEOPACKAGE,
    "shapefile": vectors.SHAPEFILE,
    "levels": LEVELS,
    "centrelines": vectors.CENTRELINES,
    "height raster": vectors.HEIGHT_RASTER,
    "height grid": vectors.HEIGHT_GRID,
    "contour lines": vectors.CONTOUR_LINES,
    "height labels": vectors.HEIGHT_LABELS,
    "stations": STATIONS,
    "survex": SURVEX,
    "compass": COMPASS,
    **surveys.HOSTILE_3D,
    **CLOUDS,
    "sweep": SWEEP,
    "bundle": BUNDLE,
    "survey section": SECTION,
}
