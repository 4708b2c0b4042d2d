"""A GeoPackage is read without a trace beside it."""

import sqlite3
import struct

import pyogrio.raw
import pytest

from minesurveys.vector.geodata import read_geodata
from pipeline.errors import InputError
from tests.mines import RING
from tests.survey.shape_files import write_shapes


@pytest.fixture
def geopackage(tmp_path):
    """Return a GeoPackage that its last writer left in the mode of a write-ahead log."""
    path = write_shapes(tmp_path / "mine.gpkg", [RING])
    data = bytearray(path.read_bytes())
    data[18:20] = b"\x02\x02"
    path.write_bytes(bytes(data))
    return path


def test_a_geopackage_in_write_ahead_mode_is_read_and_leaves_no_file(geopackage):
    assert read_geodata(geopackage, None).shapes[0].equals(RING)
    assert [p.name for p in geopackage.parent.iterdir()] == ["mine.gpkg"]


def test_a_geopackage_with_changes_in_its_log_is_refused(geopackage):
    geopackage.with_name("mine.gpkg-wal").write_bytes(b"7\x7f\x06\x82")
    with pytest.raises(InputError, match=r"mine\.gpkg-wal holds changes that are not in the file"):
        read_geodata(geopackage, None)


def test_a_file_of_which_one_shape_is_broken_is_refused_and_not_read_without_it(tmp_path):
    path = write_shapes(tmp_path / "mine.shp", [RING, RING], layer="mine")
    data = bytearray(path.read_bytes())
    corner = struct.pack("<2d", *RING.exterior.coords[0])
    at = data.rindex(corner)
    data[at : at + 8] = struct.pack("<d", float("nan"))  # the last ring of the second shape is no ring any more
    path.write_bytes(bytes(data))
    with pytest.raises(InputError, match=r"mine\.shp: 1 of 2 shapes in layer 'mine' are broken, the first is number 2"):
        read_geodata(path, None)


def test_a_geopackage_whose_system_is_undefined_states_no_unit(tmp_path):
    """OGC 12-128r18, 1.1.2.1.2: srs_id -1 is an undefined Cartesian system."""
    path = write_shapes(tmp_path / "mine.gpkg", [RING])
    with sqlite3.connect(path) as database:
        database.execute("UPDATE gpkg_geometry_columns SET srs_id = -1")
    assert pyogrio.read_info(path)["crs"].startswith("LOCAL_CS")
    assert read_geodata(path, None).crs is None
