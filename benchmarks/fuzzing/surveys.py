"""Samples and hostile files of solved surveys, Survex projects, Therion centrelines and Compass data."""

from __future__ import annotations

import struct

from benchmarks.fuzzing.builders import Files, Named, absurd_numbers

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


def old_3d() -> bytes:
    """Return a `.3d` file of version 3: one leg between two stations of `mine`, and a splay."""
    out = head(3, b"old") + b"\x0f" + place((0, 0, 0))
    out += b"\x80\x05mine." + place((0, 2000, 10)) + b"\x84\x00" + place((100, 2000, 10))
    out += b"\x42\x01a" + place((0, 0, 0)) + b"\x10" + b"\x42\x01b" + place((0, 2000, 10))
    return out + b"\0\0"


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
SAMPLES_3D: dict[str, Files] = {
    "solved .3d": {"mine.3d": ring_3d()},
    "survex project": PROJECT,
    "therion": THERION,
    "compass data": {"mine.mak": b"/ a comment\r\n#mine.dat;\r\n", "mine.dat": COMPASS_DAT},
}


def _items(item: bytes, count: int = 1) -> bytes:
    return head() + item * count


SOLVED: Named = {
    "header alone": lambda: {"mine.3d": head()},
    "version 9": lambda: {"mine.3d": head(9)},
    "version 0.01": lambda: {"mine.3d": b"Survex 3D Image File\nv0.01\nx\nx\n" + bytes(100)},
    "title without end": lambda: {"mine.3d": b"Survex 3D Image File\nv8\n" + b"x" * 60_000_000},
    "label of 4 GB": lambda: {"mine.3d": _items(b"\x82\0\xff\0\0\0\0\xff\xff\xff\xff\xff")},
    "label that shrinks below nothing": lambda: {"mine.3d": _items(b"\x82\xf0" + place((0, 0, 0)))},
    "label that grows for ever": lambda: {"mine.3d": _items(b"\x82\x0faaaaaaaaaaaaaaa" + place((0, 0, 0)), 1_000_000)},
    "five million legs": lambda: {
        "mine.3d": _items(b"\x0f" + place((0, 0, 0))) + (b"\x60" + place((1, 1, 1))) * 4_900_000
    },
    "ten million dates": lambda: {"mine.3d": _items(b"\x10", 60_000_000)},
    "leg before a move": lambda: {"mine.3d": _items(b"\x60" + place((1, 1, 1)))},
    "reserved code": lambda: {"mine.3d": _items(b"\x05")},
    "extended elevation": lambda: {"mine.3d": head()[:-1] + b"\x80\0\0"},
    "cross-section of no station": lambda: {"mine.3d": _items(b"\x30" + label(b"nowhere") + bytes(8)) + b"\0\0"},
    "station in two places": lambda: {
        "mine.3d": _items(b"\x82" + label(b"a") + place((0, 0, 0)) + b"\x82\0\0\0" + place((1, 0, 0))) + b"\0\0"
    },
    "coordinates of 21,000 km": lambda: {
        "mine.3d": ring_3d([(-(2**31), 0, 0), (2**31 - 1, 9, 9), (0, 9, 9), (9, 0, 0)])
    },
    "all stations in one place": lambda: {"mine.3d": ring_3d([(0, 0, 0)] * 4)},
    "cross-sections of -320 m": lambda: {
        "mine.3d": ring_3d().replace(struct.pack("<h", 200), struct.pack("<h", -32000))
    },
    "old label of 4 GB": lambda: {"mine.3d": head(3, b"x") + b"\x42\xff\xff\xff\xff\xff"},
    "old label trimmed to nothing": lambda: {"mine.3d": head(3, b"x") + b"\x01"},
    "coordinate system with line breaks": lambda: {"mine.3d": ring_3d().replace(b"EPSG:32719", b"EPSG:3\r\x1b[31m:x")},
    "coordinate system that is a file": lambda: {"mine.3d": ring_3d().replace(b"EPSG:32719", b"/etc/passwd")},
}
_SHOTS = b"1 2 20 0 0\n2 3 30 90 0\n"
PROJECTS: Named = {
    "file above the folder": lambda: {"main.svx": b"*include ../../../etc/passwd\n" + _SHOTS},
    "file with an absolute path": lambda: {"main.svx": b"*include /etc/passwd\n" + _SHOTS},
    "file above, after blanks that Survex knows": lambda: {"main.svx": b" ,*,include,/etc/passwd\n" + _SHOTS},
    "file above by backslashes": lambda: {"main.svx": b'*include "..\\..\\..\\etc\\passwd"\n' + _SHOTS},
    "file above, hidden from *include": lambda: {
        "main.svx": b"*include south\n*set keyword #\n#include /etc/passwd\n" + _SHOTS
    },
    "file above in a file": lambda: {"south.svx": b"*include ../../x\n"},
    "comment sign changed": lambda: {"main.svx": b"*include south\n*set comment #\n; *include /etc/passwd\n"},
    "file above, after a control character that ends a line": lambda: {
        "main.svx": b"*include south\n; a comment \x1a*include ../../../etc/passwd\n"
    },
    "file above, in a name with a control character": lambda: {
        "main.svx": b"*include south\x0b/../../../etc/passwd\n",
        "south\x0b/x": b"",
    },
    "file above, after a mark of UTF-8": lambda: {"main.svx": b"\xef\xbb\xbf*include ../../../etc/passwd\n"},
    "file above, in a file whose name holds a backslash": lambda: {
        "main.svx": b"*include a\\b\n",
        "a/b.svx": b"",
        "a\\b.svx": b"*include ../../../etc/passwd\n",
    },
    "file above, in a file of another format": lambda: {
        "main.svx": b"*include other.mak\n",
        "other.mak": b"#../../../etc/passwd;\n",
    },
    "coordinate system without a name": lambda: {"main.svx": b"*include south\n*cs;x\n*ref"},
    "drive": lambda: {"main.svx": b"*include C:\\x\n" + _SHOTS},
    "device": lambda: {"main.svx": b"*include /dev/zero\n" + _SHOTS},
    "file that includes itself": lambda: {"main.svx": b"*include main\n"},
    "files that include each other": lambda: {"south.svx": b"*include main\n"},
    "files that include a file twice, 60 deep": lambda: {
        "main.svx": b"*include f0\n",
        **{f"f{i}.svx": b"*include f%d\n*include f%d\n" % (i + 1, i + 1) for i in range(60)},
        "f60.svx": _SHOTS,
    },
    "three hundred files": lambda: {
        "main.svx": b"".join(b"*include f%d\n" % i for i in range(300)),
        **{f"f{i}.svx": b"a%d a%d 5 0 0\n" % (i, i + 1) for i in range(300)},
    },
    "name of 100 kB": lambda: {"main.svx": b"*include " + b"a" * 100_000 + b"\n"},
    "name with zeros": lambda: {"main.svx": b"*include south\0.svx\n"},
    "begin a hundred thousand deep": lambda: {"main.svx": b"*include south\n" + b"*begin a\n" * 100_000},
    "coordinate system from a file": lambda: {
        "main.svx": b'*cs custom "+proj=utm +zone=19 +nadgrids=/etc/passwd"\n*include south\n'
    },
    "random network of 60,000 shots": lambda: {
        "main.svx": b"*include south\n"
        + b"".join(
            b"%d %d 9 %d 9\n" % (i * 7919 % 20_000, i * 104_729 % 19_997 + 30_000, i % 360) for i in range(60_000)
        )
    },
    "million warnings": lambda: {"main.svx": b"*include south\n" + b"1 2 20 400 0\n" * 300_000},
    "million shots": lambda: {"main.svx": b"*include south\n" + b"1 2 9 9 9\n" * 1_000_000},
    "NUL and control bytes": lambda: {"south.svx": bytes(range(256)) * 1000},
    **absurd_numbers("south.svx", lambda n: f"*begin b\n1 2 {n} 90 0\n2 4 20 0 0\n*end b\n".encode()),
}
_CENTRELINE = b"centreline\ndata normal from to length compass clino\n1 2 20 0 0\nendcentreline\n"
CENTRELINES: Named = {
    "file above the folder": lambda: {"mine.th": b"input ../../../etc/passwd\n"},
    "file with an absolute path": lambda: {"mine.th": b"input /etc/passwd\n"},
    "device": lambda: {"mine.th": b"input /dev/zero\n"},
    "file that inputs itself": lambda: {"mine.th": b"input mine.th\n"},
    "files that input each other": lambda: {"north.th": b"input mine.th\n"},
    "files that input a file twice, 60 deep": lambda: {
        "mine.th": b"input f0\n",
        **{f"f{i}.th": b"input f%d\ninput f%d\n" % (i + 1, i + 1) for i in range(60)},
        "f60.th": _CENTRELINE,
    },
    "surveys a hundred thousand deep": lambda: {"mine.th": b"survey a\n" * 100_000},
    "groups a hundred thousand deep": lambda: {"mine.th": b"centreline\n" + b"group\n" * 100_000},
    "survex commands in names": lambda: {"mine.th": _CENTRELINE.replace(b"1 2 20", b"*include /etc/passwd 20")},
    "survex commands after a line break": lambda: {
        "mine.th": _CENTRELINE.replace(b"data normal", b'equate "a\x0b*include /etc/passwd" b\ndata normal')
    },
    "survex commands in a title": lambda: {"mine.th": b'survey "a;*include /etc/passwd"\nendsurvey\n'},
    "million shots": lambda: {"mine.th": _CENTRELINE.replace(b"1 2 20 0 0\n", b"1 2 9 9 9\n3 4 9 9 9\n" * 500_000)},
    "line continued a million times": lambda: {"mine.th": b"survey a \\\n" * 1_000_000},
    "line of 60 MB": lambda: {"mine.th": b"survey " + b"a" * 60_000_000},
    "comment without end": lambda: {"mine.th": b"comment\n" + b"x\n" * 1_000_000},
    "coordinate system from a file": lambda: {"north.th": THERION["north.th"].replace(b"EPSG:32719", b"/etc/passwd")},
    "square of a grid that is none": lambda: {"north.th": THERION["north.th"].replace(b"EPSG:32719", b"OSGB:HI")},
    "shots without stations": lambda: {"mine.th": b"centreline\ndata normal ignoreall\n1 2 3\nendcentreline\n"},
    "last line continued": lambda: {"mine.th": _CENTRELINE + b"equate 1 2 \\"},
    "fixed off the earth": lambda: {"north.th": THERION["north.th"].replace(b"380000", b"999999999999")},
    "declination of 10^300": lambda: {
        "north.th": THERION["north.th"].replace(b"  data normal", b"  declination 1e300 degrees\n  data normal", 1)
    },
    "quotes": lambda: {"mine.th": b'"' * 1_000_000},
    **absurd_numbers("north.th", lambda n: THERION["north.th"].replace(b"30.3", n.encode())),
}
COMPASS_PROJECTS: Named = {
    "file above the folder": lambda: {"mine.mak": b"#../../../etc/passwd;\r\n"},
    "file with an absolute path": lambda: {"mine.mak": b"#/etc/passwd;\r\n"},
    "file above by backslashes": lambda: {"mine.mak": b"#..\\..\\x.dat;\r\n"},
    "drive": lambda: {"mine.mak": b"#C:\\x.dat;\r\n"},
    "device": lambda: {"mine.mak": b"#/dev/zero;\r\n"},
    "file above, its name over two lines": lambda: {"mine.mak": b"#\r\n../../../etc/passwd;\r\n"},
    "file above, in a project in a project": lambda: {
        "mine.mak": b"#other.mak;\r\n",
        "other.mak": b"#../../../etc/passwd;\r\n",
    },
    "file above, in what looks like a comment": lambda: {"mine.mak": b"/#a\r\n#../../../etc/passwd;\r\n"},
    "million names without letters": lambda: {"mine.mak": b"#;\r\n" * 10_000_000},
    "two files in a line, the second outside": lambda: {"mine.mak": b"#mine.dat; #/etc/passwd;\r\n"},
    "hundred thousand files": lambda: {"mine.mak": b"#mine.dat;\r\n" * 100_000},
    "three hundred files": lambda: {
        "mine.mak": b"".join(b"#f%d.dat;\r\n" % i for i in range(300)),
        **{f"f{i}.dat": COMPASS_DAT for i in range(300)},
    },
    "name without end": lambda: {"mine.mak": b"#" + b"a" * 1_000_000},
    "data without end": lambda: {
        "mine.dat": COMPASS_DAT.replace(b"\x0c", b"") + b" A1 A2 9 9 9 1 1 1 1\r\n" * 1_000_000
    },
    "headers alone": lambda: {"mine.dat": b"SURVEY NAME: A\r\n" * 300_000},
    "form feeds": lambda: {"mine.dat": b"\x0c" * 5_000_000},
    **absurd_numbers("mine.dat", lambda n: COMPASS_DAT.replace(b" A2 A3 100.0", f" A2 A3 {n}".encode())),
}
HOSTILE_3D: dict[str, Named] = {
    "solved .3d": SOLVED,
    "survex project": PROJECTS,
    "therion": CENTRELINES,
    "compass data": COMPASS_PROJECTS,
}
