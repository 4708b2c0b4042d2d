"""Build hostile files for the fuzzer: headers that lie, bombs, deep nesting and absurd numbers."""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from minexplore.bundle import FORMAT

Files = dict[str, bytes]
Make = Callable[[], Files]
Named = dict[str, Make]
LAUGHS = b"a: &a [x, x, x, x, x, x, x, x, x]\n" + b"".join(
    b"%c: &%c [%s]\n" % (98 + i, 98 + i, b", ".join([b"*%c" % (97 + i)] * 9)) for i in range(9)
)
TAGGED = b"!!python/object/apply:os.system ['touch ../minexplore-was-here']\n"
ABSURD = ("1e308", "-1e308", "nan", "inf", "1e-320", "9" * 400, "0x7fffffff")


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


def noise_png(side: int) -> bytes:
    """Return a PNG of black and white noise."""
    rows = np.random.default_rng(0).integers(0, 256, (side, side // 8 + 1), dtype=np.uint8)
    rows[:, 0] = 0
    return png(side, side, 1, 0, b"", zlib.compress(rows.tobytes(), 1))


def rings_png(side: int) -> bytes:
    """Return a PNG of nested rings."""
    row, col = np.mgrid[:side, :side]
    ring = np.minimum(np.minimum(row, col), np.minimum(side - 1 - row, side - 1 - col)) % 4 < 2
    rows = np.hstack([np.zeros((side, 1), np.uint8), np.packbits(~ring, axis=1)])
    return png(side, side, 1, 0, b"", zlib.compress(rows.tobytes(), 9))


def bars_png(side: int) -> bytes:
    """Return a PNG full of scale bars."""
    picture = np.ones((side, side), bool)
    for row in range(4, side - 8, 8):
        for col in range(4, side - 40, 40):
            picture[row : row + 3, col : col + 30] = False
    rows = np.hstack([np.zeros((side, 1), np.uint8), np.packbits(picture, axis=1)])
    return png(side, side, 1, 0, b"", zlib.compress(rows.tobytes(), 9))


def progressive_jpeg(width: int, height: int, scans: int) -> bytes:
    """Return a progressive JPEG with a stated size and many empty scans."""
    quant = b"\xff\xdb\x00\x43\x00" + bytes([1] * 64)
    frame = b"\xff\xc2\x00\x0b\x08" + struct.pack(">HH", height, width) + b"\x01\x01\x11\x00"
    huffman = (
        b"\xff\xc4\x00\x14\x00"
        + bytes([1] + [0] * 15)
        + b"\x00"
        + b"\xff\xc4\x00\x14\x10"
        + bytes([1] + [0] * 15)
        + b"\x00"
    )
    first = b"\xff\xda\x00\x08\x01\x01\x00\x00\x00\x00" + bytes(4000)
    later = (b"\xff\xda\x00\x08\x01\x01\x00\x01\x3f\x00" + bytes(40)) * scans
    return b"\xff\xd8" + quant + frame + huffman + first + later + b"\xff\xd9"


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


def flate(data: bytes, times: int = 1, extra: bytes = b"") -> bytes:
    """Return a PDF stream, compressed several times."""
    for _ in range(times):
        data = zlib.compress(data, 9)
    return (
        b"<<%s/Length %d/Filter[%s]>>\nstream\n" % (extra, len(data), b"/FlateDecode " * times) + data + b"\nendstream"
    )


def form_bomb(levels: int) -> bytes:
    """Return a PDF whose forms draw each other twenty times a level."""
    forms = []
    for level in range(levels):
        content = b"0 0 1 1 re f " if level == levels - 1 else b"/F Do " * 20
        inner = b"<</XObject<</F %d 0 R>>>>" % (6 + level)
        head = b"/Type/XObject/Subtype/Form/BBox[0 0 300 200]/Resources %s" % (inner if level < levels - 1 else b"<<>>")
        forms.append(b"<<%s/Length %d>>\nstream\n%s\nendstream" % (head, len(content), content))
    return pdf(b"/F Do", resources=b"<</XObject<</F 5 0 R>>>>", objects=tuple(forms))


def zip_of(data: bytes) -> bytes:
    """Return an archive with a GeoPackage."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("mine.gpkg", data)
    return stream.getvalue()


def map_yaml(**fields: Any) -> bytes:
    """Return a map's YAML; fields replace the usual ones."""
    base = {"image": "map.pgm", "resolution": 0.1, "origin": [0, 0, 0], **fields}
    return "".join(f"{key}: {value}\n" for key, value in base.items()).encode()


def station_csv(rows: list[str]) -> bytes:
    """Return a station table."""
    return ("leg,station,easting_m,northing_m,left_m,right_m\n" + "\n".join(rows) + "\n").encode()


def las(points: int, offset: int = 227, size: int = 20) -> bytes:
    """Return a LAS file with stated counts."""
    head = struct.pack(
        "<4sHH16sBB32s32sHHHIIBHI5I",
        b"LASF",
        0,
        0,
        b"",
        1,
        2,
        b"",
        b"",
        1,
        2026,
        227,
        offset,
        0,
        0,
        size,
        points,
        *[0] * 5,
    )
    return head + struct.pack("<12d", *[0.01] * 3, *[0] * 3, *[1, 0] * 3) + bytes(20 * 50)


def ply(count: str, more: str = "", body: bytes = b"") -> bytes:
    """Return a PLY file with a stated count."""
    text = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n"
    text += "".join(f"property float {axis}\n" for axis in "xyz")
    return (text + more + "end_header\n").encode() + body


def pcd(points: str, data: str = "ascii", body: bytes = b"0 0 0\n" * 200) -> bytes:
    """Return a PCD file with a stated count."""
    return (
        f"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {points}\nHEIGHT 1\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA {data}\n"
    ).encode() + body


def absurd_numbers(name: str, form: Callable[[str], bytes]) -> Named:
    """Return a file for each absurd number."""
    return {f"number {value[:12]}": partial(_one_file, name, form, value) for value in ABSURD}


def _one_file(name: str, form: Callable[[str], bytes], value: str) -> Files:
    return {name: form(value)}


def listing(*names: str) -> Files:
    """Return a bundle's record that lists files."""
    record = {"format": FORMAT, "files": dict.fromkeys(names, "0" * 64), "world_sha256": "0" * 64}
    return {"world.json": json.dumps(record).encode()}
