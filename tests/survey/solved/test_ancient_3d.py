"""Solved surveys of versions 0.01, 1 and 2, which Survex's programs read and no longer write."""

import re
import shutil
import struct
import subprocess

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.survey.solved.model import LegFlag, StationFlag
from pipeline.survey.solved.survex_3d import read_3d
from tests.solved import position_of

needs_dump3d = pytest.mark.skipif(shutil.which("dump3d") is None, reason="Survex is not installed (Debian: survex)")

TEXT = (
    "Survex 3D Image File\nv0.01\nold mine\nSat,2001.09.15 17:12:56 BST\nline 0.00 0.00 0.00 -2.59 9.65 -0.35\n"
    "draw -2.93 4.67 -0.61\nmove 0 0 0\ndraw 1e1 5.5 -3\ncross 1 2 3\nname \\mine.a 0.00 0.00 0.00\n"
    "name mine.b -2.59 9.65 -0.35\nname mine.c -2.93 4.67 -0.61\nname mine.d 10.00 5.50 -3.00\n"
)


def place(*at):
    return struct.pack("<3i", *at)


def binary(version, code):
    """Return a file of version 1 or 2 with every kind of item that has no flags."""
    head = b"Survex 3D Image File\n" + {1: b"Bv0.01", 2: b"v2"}[version] + b"\nold mine\nSat,2001.09.15 17:12:56 BST\n"
    out = head + code(4) + place(0, 0, 0) + code(5) + place(-259, 965, -35) + code(5) + place(-293, 467, -61)
    out += code(1) + place(7, 7, 7) + code(4) + place(0, 0, 0) + code(2) + b"\\mine.a\n"
    out += code(3) + b"mine.b\n" + place(-259, 965, -35) + code(3) + b"\n"
    return out + code(6) + struct.pack("<i", 6) + b"mine.c" + place(-293, 467, -61)


FILES = {
    "text": TEXT.encode(),
    "text of DOS": TEXT.replace("\n", "\r\n").encode(),
    "version 1": binary(1, lambda code: struct.pack("<i", code)) + struct.pack("<i", -1),
    "version 2": binary(2, lambda code: bytes([code]))
    + b"\x81" + place(5, 5, 5) + b"\x44mine.e\n" + place(5, 5, 5)
    + b"\x07\x08" + struct.pack("<i", 6) + b"mine.f" + place(6, 6, 6) + b"\0",
}  # fmt: skip


@needs_dump3d
@pytest.mark.parametrize("data", FILES.values(), ids=FILES)
def test_an_ancient_file_reads_as_dump3d_prints_it(tmp_path, data):
    path = tmp_path / "old.3d"
    path.write_bytes(data)
    survey = read_3d(path)
    printed = subprocess.run(["dump3d", path], check=True, capture_output=True, text=True).stdout
    nodes = re.findall(r"^NODE (\S+) (\S+) (\S+) \[(.*)\]", printed, re.MULTILINE)
    assert {name for *_, name in nodes} == set(position_of(survey))
    for *at, name in nodes:
        np.testing.assert_allclose(position_of(survey)[name], np.array(at, float), atol=1e-9)
    legs, here = [], None
    for kind, *at in re.findall(r"^(MOVE|LINE) (\S+) (\S+) (\S+)", printed, re.MULTILINE):
        legs += [(here, at)] if kind == "LINE" else []
        here = at
    np.testing.assert_allclose(survey.positions_m[survey.legs], np.array(legs, float), atol=1e-9)
    assert re.search('^TITLE "(.*)"', printed)[1] == survey.title == "old mine"
    assert survey.date == "Sat,2001.09.15 17:12:56 BST"


def test_flags_of_version_2_are_those_of_later_versions(tmp_path):
    (tmp_path / "old.3d").write_bytes(FILES["version 2"])
    survey = read_3d(tmp_path / "old.3d")
    assert survey.leg_flags.tolist() == [0, 0, LegFlag.SURFACE]
    flags = dict(zip(survey.names, survey.station_flags.tolist(), strict=True))
    assert flags["mine.e"] == StationFlag.ENTRANCE
    assert flags["mine.f"] == StationFlag.EXPORTED
    assert flags["mine.a"] == StationFlag.UNDERGROUND


def test_a_name_of_version_1_stands_at_the_move_before_it_and_moves_no_leg(tmp_path):
    code = struct.Struct("<i").pack
    data = binary(1, code) + code(5) + place(1, 2, 3) + code(-1)
    (tmp_path / "old.3d").write_bytes(data)
    survey = read_3d(tmp_path / "old.3d")
    np.testing.assert_array_equal(survey.positions_m[survey.legs[-1]], [(-2.93, 4.67, -0.61), (0.01, 0.02, 0.03)])
    np.testing.assert_array_equal(position_of(survey)["mine.a"], (0, 0, 0))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (TEXT.encode() + b"curve 1 2 3\n", "'curve' is no item"),
        (TEXT.encode() + b"draw 1 2\n", "'the end' is no number of metres"),
        (TEXT.encode() + b"draw 1 2 nan\n", "'nan' is no number of metres below 2e"),
        (TEXT.encode() + b"draw 1 2 0x3\n", "'0x3' is no number of metres"),
        (TEXT.encode() + b"name mine.e\n", "a name without a place"),
        (TEXT.encode() + b"name " + 1001 * b"e" + b" 1 2 3\n", "a name of more than 1000 bytes"),
        (binary(2, lambda code: bytes([code])), "is cut off"),
        (binary(2, lambda code: bytes([code])) + b"\x08", "code 0x08 is unknown"),
        (binary(2, lambda code: bytes([code])) + b"\x06\xff\xff\xff\xff", "is cut off"),
        (FILES["text of DOS"].replace(b"v0.01", b"v2"), "versions v0.01, Bv0.01 and v2 to v8 are read"),
        (TEXT.replace("old mine", "old mine (extended)").encode(), "an extended elevation, which is a drawing"),
    ],
)
def test_a_broken_ancient_file_is_refused(tmp_path, data, message):
    (tmp_path / "old.3d").write_bytes(data)
    with pytest.raises(InputError, match=message):
        read_3d(tmp_path / "old.3d")
