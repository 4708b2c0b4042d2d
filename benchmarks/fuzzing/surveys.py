"""Samples of solved surveys, Survex projects, Therion centrelines, Compass data and Walls projects."""

from __future__ import annotations

import struct

from benchmarks.fuzzing.builders import Files

Place = tuple[int, int, int]
_RING: list[Place] = [(0, 0, 0), (0, 2000, 10), (3000, 2000, 30), (3000, 0, 10)]  # cm


def label(name: bytes, keep: int = 0, before: int = 0) -> bytes:
    """Return a label of version 8 that replaces all but `keep` bytes of one of `before` bytes."""
    return b"\0" + _count(before - keep) + _count(len(name) - keep) + name[keep:]


def _count(number: int) -> bytes:
    return bytes([number]) if number < 255 else b"\xff" + struct.pack("<I", number)


def place(at: Place) -> bytes:
    """Return coordinates, cm."""
    return struct.pack("<3i", *at)


def head(version: int = 8, title: bytes = b"mine\0EPSG:32719") -> bytes:
    """Return the header of a `.3d` file."""
    text = b"Survex 3D Image File\nv%d\n%s\n@1700000000\n" % (version, title)
    return text + (b"\0" if version >= 8 else b"")


def ring_3d(places: list[Place] = _RING) -> bytes:
    """Return a `.3d` file of version 8: a ring of four stations with cross-sections."""
    out, before = head() + b"\0", 0
    out += b"\x0f" + place(places[0])
    for at in (*places[1:], places[0]):
        out += b"\x60" + place(at)
    for i, at in enumerate(places):
        out += b"\x82" + label(b"mine.%d" % i, 0, before) + place(at)
        before = 6
    for i in (*range(len(places)), 0):
        end = 1 if i == 0 and before == 7 else 0
        out += bytes([0x30 | end]) + label(b"mine.%d" % i, 0, 6) + struct.pack("<4h", 200, 200, 250, 0)
    return out + b"\0"


def ring_lox(places: list[Place] = _RING) -> bytes:
    """Return a `.lox` file: the same ring, with cross-sections at both ends of each leg."""
    count = len(places)
    stations = [
        struct.pack("<7I3d", k, 0, 2 * k, 2, 0, 0, 6 if k == 0 else 0, *(cm / 100 for cm in at))
        for k, at in enumerate(places)
    ]
    shots = [struct.pack("<2I8d3Id", k, (k + 1) % count, *[2, 2, 2.5, 0] * 2, 0, 2, 0, 60) for k in range(count)]
    return (
        _lox_block(1, [struct.pack("<6I", 0, 0, 5, 0, 0, 0)], b"mine\0")
        + _lox_block(2, stations, b"".join(b"%d\0" % k for k in range(count)))
        + _lox_block(3, shots, b"")
    )


def _lox_block(kind: int, records: list[bytes], texts: bytes) -> bytes:
    data = b"".join(records)
    return struct.pack("<4I", kind, len(data), len(records), len(texts)) + data + texts


PROJECT: Files = {
    "main.svx": b"""*begin mine
*fix a.1 100 200 10
*include "north/a"
*include south.svx
*equate a.3 b.1
*equate a.1 b.4
*end mine
""",
    "north/a.svx": b"""*begin a
1 2 20 0 0
2 3 30.3 0 1
2 .. 2.1 90 0
2 .. 1.9 270 0
*data passage station left right up down
1 2 2 3 0
2 2 2 3 0
3 2 2 3 0
*end a
""",
    "south.svx": b"""*begin b
1 2 40 90 0
2 3 50 180 0
3 4 40.2 270 -1
*data passage station left right up down
1 2 2 3 0
2 2 2 3 0
3 2 2 3 0
4 2 2 3 0
*end b
""",
}
THERION: Files = {
    "mine.th": b"""encoding utf-8
survey mine -title "A mine"
  input north.th
  input north.th2 # a drawing
  survey south
    centreline
      date 2024.05.01
      units length feet
      data normal from to length compass clino left right up down
      1 2 131.2 90 0 2 2 3 0
      2 3 164.1 180 0 2 2 3 0
      3 4 131.9 270 -1 2 2 3 0
      flags surface
      4 5 10 0 40 - - - -
    endcentreline
  endsurvey
  centreline
    equate 3@north 1@south
    equate 1@north 4@south
  endcentreline
endsurvey
""",
    "north.th": b"""survey north
centreline
  cs EPSG:32719
  fix 1 380000 6290000 2400
  data normal from to length compass clino
  1 2 20 0 0
  1 2 20.02 0.02 0 # repeated
  2 - 2.1 90 0
  2 - 1.9 270 0
  2 3 30.3 0 1
  data dimensions station left right up down
  1 2 2 3 0
  2 2 2 3 0
  3 2 2 3 0
endcentreline
endsurvey
""",
}
COMPASS_DAT = (
    b"MINE\r\nSURVEY NAME: A\r\nSURVEY DATE: 7 10 1979  COMMENT:x\r\nSURVEY TEAM:\r\nme\r\n"
    b"DECLINATION:    0.00  FORMAT: DDDDLUDRADLNF\r\n\r\n"
    b"  FROM   TO   LENGTH  BEARING   INC   LEFT   UP   DOWN   RIGHT   FLAGS  COMMENTS\r\n\r\n"
    b" A1 A2 100.0 0.0 0.0 6 9 1 6\r\n A2 A3 100.0 90.0 0.5 6 9 1 6\r\n A3 A4 100.0 180.0 -0.5 6 9 1 6\r\n"
    b" A4 A1 100.0 270.0 0 -9 9 1 999.9\r\n\x0c\r\n"
)
WALLS: Files = {
    "mine.wpj": b""".BOOK\tA mine
.NAME\tmine
.STATUS\t7
.BOOK\tNorth
.NAME\tNORTH
.PATH\tSub\\North
.SURVEY\tThe main drift
.NAME\tMAIN
.STATUS\t8
.SURVEY\tPictures
.NAME\tpictures.zip
.STATUS\t65536
.SURVEY\tOld
.NAME\told
.STATUS\t2
.ENDBOOK
.SURVEY\tGone
.NAME\tgone
.PATH\tnowhere
.STATUS\t8
.SURVEY\tSouth
.NAME\tsouth
.STATUS\t8
.ENDBOOK
""",
    "sub/north/main.srv": b"#units meters order=dav\n#fix A 100 200 30\nA B 10 90 0 <1,2,3,4>\nB C 5 0 90\n",
    "south.srv": b"#units meters\nC D 7 0 0\n",
}
SAMPLES_3D: dict[str, Files] = {
    "solved .3d": {"mine.3d": ring_3d()},
    "solved .lox": {"mine.lox": ring_lox()},
    "survex project": PROJECT,
    "therion": THERION,
    "compass data": {"mine.mak": b"/ a comment\r\n#mine.dat;\r\n", "mine.dat": COMPASS_DAT},
    "compass survey": {"mine.dat": COMPASS_DAT},
    "walls project": WALLS,
    "walls survey": {"main.srv": WALLS["sub/north/main.srv"]},
}
