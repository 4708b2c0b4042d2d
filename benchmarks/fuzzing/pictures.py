"""Hostile pictures, PDFs, world files and occupancy grids, made when they are needed."""

from __future__ import annotations

import gzip
import struct
import zlib

from benchmarks.fuzzing import builders as make
from benchmarks.fuzzing.builders import LAUGHS, TAGGED, Named, absurd_numbers, chunk


def _image(width: int, height: int, filters: int) -> bytes:
    head = b"/Type/XObject/Subtype/Image/Width %d/Height %d/ColorSpace/DeviceGray/BitsPerComponent 8" % (width, height)
    return make.flate(bytes(width * height), filters, head)


PNG: Named = {
    "header of 10^10 px": lambda: {"plan.png": make.png(100_000, 100_000, pixels=b"x")},
    "header of 2^31 columns": lambda: {"plan.png": make.png(2**31 - 1, 1, pixels=b"x")},
    "header of no pixels": lambda: {"plan.png": make.png(0, 0, pixels=b"x")},
    "bomb of 196 megapixels": lambda: {"plan.png": make.png(14_000, 14_000)},
    "bomb of 16 bits and alpha": lambda: {"plan.png": make.png(14_000, 14_000, 16, 6, pixels=zlib.compress(b"x", 9))},
    "bomb of colour profile": lambda: {
        "plan.png": make.png(200, 120, more=chunk(b"iCCP", b"x\0\0" + zlib.compress(bytes(500_000_000), 9)))
    },
    "bomb of text": lambda: {
        "plan.png": make.png(200, 120, more=chunk(b"zTXt", b"x\0\0" + zlib.compress(bytes(500_000_000), 9)) * 20)
    },
    "million text chunks": lambda: {"plan.png": make.png(200, 120, more=chunk(b"tEXt", b"a\0b") * 1_000_000)},
    "two headers": lambda: {
        "plan.png": make.png(200, 120, more=chunk(b"IHDR", struct.pack(">IIBBBBB", 90_000, 90_000, 8, 0, 0, 0, 0)))
    },
    "animation of 2^31 frames": lambda: {
        "plan.png": make.png(200, 120, more=chunk(b"acTL", struct.pack(">II", 2**31 - 1, 0)))
    },
    "noise of 36 megapixels": lambda: {"plan.png": make.noise_png(6000)},
    "two thousand nested rings": lambda: {"plan.png": make.rings_png(8000)},
    "hundred thousand scale bars": lambda: {"plan.png": make.bars_png(6000)},
    "two pixels a side": lambda: {"plan.png": make.png(2, 2)},
    "turned by Exif without end": lambda: {
        "plan.png": make.png(200, 120, more=chunk(b"eXIf", b"II*\0\xff\xff\xff\xff" + b"\x12\x01\x03\0" * 20))
    },
    "another format": lambda: {"plan.png": b"RIFF\x24\0\0\0WEBPVP8L" + bytes(99)},
    "gzip": lambda: {"plan.png": gzip.compress(make.png(200, 120))},
}
JPEG: Named = {
    "header of 65500 px a side": lambda: {"plan.jpg": make.progressive_jpeg(65_500, 65_500, 0)},
    "scans without end": lambda: {"plan.jpg": make.progressive_jpeg(14_000, 14_000, 5000)},
    "markers without end": lambda: {"plan.jpg": b"\xff\xd8" + b"\xff" * 50_000_000},
    "no markers": lambda: {"plan.jpg": b"\xff\xd8" + bytes(50_000_000)},
    "segments of length zero": lambda: {"plan.jpg": b"\xff\xd8" + b"\xff\xe0\0\0" * 5_000_000},
}
TIFF: Named = {
    "one strip of 196 megapixels": lambda: {"plan.tif": make.grey_tiff(14_000, 14_000)},
    "header of 10^18 px": lambda: {"plan.tif": make.grey_tiff(2**30, 2**30)},
    "a tile larger than the picture": lambda: {"plan.tif": make.grey_tiff(200, 120, t322=16_000, t323=12_000)},
    "sixty thousand channels": lambda: {"plan.tif": make.grey_tiff(200, 120, t277=60_000)},
    "samples of 64 bits": lambda: {"plan.tif": make.grey_tiff(14_000, 14_000, t258=64)},
    "directory beyond the end": lambda: {"plan.tif": b"II*\0\xff\xff\xff\xff" + bytes(99)},
    "directory that names itself": lambda: {"plan.tif": make.tiff([(330, 4, 1, 8), (256, 4, 1, 9), (257, 4, 1, 9)])},
    "BigTIFF of 2^60 tags": lambda: {"plan.tif": b"II+\0\x08\0\0\0" + struct.pack("<QQ", 16, 2**60) + bytes(900)},
    "samples with a sign": lambda: {"plan.tif": make.grey_tiff(200, 120, t339=2)},
    "floats": lambda: {"plan.tif": make.grey_tiff(200, 120, t258=32, t339=3)},
    "turned by its own tag": lambda: {"plan.tif": make.grey_tiff(200, 120, t274=6)},
    "tag counts of 2^32": lambda: {"plan.tif": make.tiff([(t, 4, 2**32 - 1, 8) for t in (256, 257, 258, 273, 279)])},
}
_TINY_PATTERN = (
    b"<</Type/Pattern/PatternType 1/PaintType 1/TilingType 1/BBox[0 0 1 1]/XStep 0.00001/YStep 0.00001/Resources<<>>"
    b"/Length 13>>\nstream\n0 0 1 1 re f \nendstream"
)
PDF: Named = {
    "stream bomb of 2 GB": lambda: {"plan.pdf": make.pdf(b"", objects=(make.flate(bytes(2_000_000_000)),))},
    "content bomb of 500 MB": lambda: {"plan.pdf": make.pdf(b"0 0 1 1 re f " * 40_000_000)},
    "nested filters": lambda: {
        "plan.pdf": make.pdf(b"/I Do", resources=b"<</XObject<</I 5 0 R>>>>", objects=(_image(20_000, 20_000, 3),))
    },
    "picture of 10^9 px": lambda: {
        "plan.pdf": make.pdf(b"/I Do", resources=b"<</XObject<</I 5 0 R>>>>", objects=(_image(40_000, 30_000, 1),))
    },
    "forms within forms": lambda: {"plan.pdf": make.form_bomb(9)},
    "pattern of tiny steps": lambda: {
        "plan.pdf": make.pdf(
            b"/Pattern cs /P scn 0 0 300 200 re f", resources=b"<</Pattern<</P 5 0 R>>>>", objects=(_TINY_PATTERN,)
        )
    },
    "page of 10^9 points": lambda: {"plan.pdf": make.pdf(b"0 0 m", box="0 0 1000000000 1000000000")},
    "page of nan": lambda: {"plan.pdf": make.pdf(b"0 0 m", box="0 0 nan inf")},
    "page without size": lambda: {"plan.pdf": make.pdf(b"0 0 m", box="0 0 0 0")},
    "page tree that names itself": lambda: {"plan.pdf": make.pdf(b"").replace(b"Kids[3 0 R]", b"Kids[2 0 R]")},
    "deep arrays": lambda: {"plan.pdf": make.pdf(b"", resources=b"[" * 500_000 + b"]" * 500_000)},
    "million path segments with wide dashes": lambda: {
        "plan.pdf": make.pdf(b"[0.001 0.001] 0 d 0 0 m " + b"300 200 l 0 0 l " * 200_000 + b"S")
    },
    "entry of cross-references at 10^18": lambda: {"plan.pdf": b"%PDF-1.7\nstartxref\n999999999999999999\n%%EOF"},
}
GEOTIFF: Named = {"pixels of no size": lambda: {"plan.tif": make.grey_tiff(200, 120, t33550=0)}}
WORLD_FILE: Named = {
    "absurd numbers": lambda: {"plan.pgw": b"1e308\n" * 6},
    "zeros": lambda: {"plan.pgw": b"0\n" * 6},
    "million numbers": lambda: {"plan.pgw": b"1\n" * 1_000_000},
    "digits without end": lambda: {"plan.pgw": b"9" * 90_000},
    **absurd_numbers("plan.pgw", lambda n: f"{n}\n0\n0\n-{n}\n0\n0\n".encode()),
}
MAP: Named = {
    "picture outside the folder": lambda: {"map.yaml": make.map_yaml(image="../../../../etc/passwd")},
    "picture with an absolute path": lambda: {"map.yaml": make.map_yaml(image="/etc/passwd")},
    "picture is the map": lambda: {"map.yaml": make.map_yaml(image="map.yaml")},
    "picture is the folder": lambda: {"map.yaml": make.map_yaml(image=".")},
    "picture with a zero byte": lambda: {"map.yaml": make.map_yaml(image='"a\\0b"')},
    "tag": lambda: {"map.yaml": TAGGED},
    "aliases": lambda: {"map.yaml": LAUGHS},
    "deep": lambda: {"map.yaml": b"[" * 20_000},
    "deep within the size": lambda: {"map.yaml": b"a: " + b"{a: " * 20_000},
    "large": lambda: {"map.yaml": b"# x\n" * 20_000_000},
    "hundred thousand keys": lambda: {"map.yaml": b"".join(b"%d: 0\n" % i for i in range(12_000))},
    "digits without end": lambda: {"map.yaml": make.map_yaml(resolution="9" * 90_000)},
    "sexagesimal without end": lambda: {"map.yaml": make.map_yaml(resolution="1" + ":1" * 40_000)},
    "turned by 10^300": lambda: {"map.yaml": make.map_yaml(origin="[0, 0, 1e300]")},
    "far origin": lambda: {"map.yaml": make.map_yaml(origin="[1e300, 0, 0]")},
    "huge grid": lambda: {"map.pgm": b"P5 999999999 999999999 255\n"},
    "ascii grid without end": lambda: {"map.pgm": b"P2 9000 9000 255\n" + b"1 " * 20_000_000},
    "header of comments": lambda: {"map.pgm": b"P5 " + b"#\n" * 20_000_000},
    "grid of 10000 x 10000": lambda: {"map.pgm": b"P5 10000 10000 255\n" + bytes([255, 0]) * 50_000_000},
    **absurd_numbers("map.yaml", lambda n: make.map_yaml(resolution=n)),
}
