"""What a vector file holds beside lines and polygons is named with its number, and with the way on if it is all."""

import sqlite3
import struct
from contextlib import closing

import ezdxf
import numpy as np
import pytest
import shapely

from minesurveys.reading import read_shapes
from pipeline.errors import InputError
from tests.mines import TEE
from tests.survey.shape_files import write_shapes

SQUARE = [(0, 0, 0), (50, 0, 0), (50, 5, 0), (0, 5, 0)]
FACES = [SQUARE, [(0, 0, 0), (50, 0, 0), (50, 0, 5), (0, 0, 5)]]


def tin(*triangles):
    """Return a TIN as well-known binary."""
    data = struct.pack("<BII", 1, 1016, len(triangles))
    for corners in triangles:
        data += struct.pack("<BIII", 1, 1017, 1, 4)
        data += b"".join(struct.pack("<3d", *corner) for corner in (*corners, corners[0]))
    return data


def arc(*places):
    return struct.pack("<BII", 1, 8, len(places)) + b"".join(struct.pack("<2d", *place) for place in places)


def geopackage(path, *stored):
    """Write a GeoPackage with one drift, and shapes that pyogrio does not write, as well-known binary or None."""
    write_shapes(path, [TEE] * (1 + len(stored)), geometry_type="Unknown", layer="mine")
    with closing(sqlite3.connect(path)) as file:
        for name in ("ST_MinX", "ST_MaxX", "ST_MinY", "ST_MaxY", "ST_IsEmpty"):  # of the triggers of its index
            file.create_function(name, 1, lambda _: 0)
        for number, wkb in enumerate(stored, 2):
            blob = None if wkb is None else b"GP\x00\x01" + struct.pack("<i", 32719) + wkb
            file.execute("UPDATE mine SET geom = ? WHERE fid = ?", (blob, number))
        file.commit()
    return path


def multipatch(path, rings):
    """Write a Shapefile of one MultiPatch, whose parts are rings."""
    points = np.array([place for ring in rings for place in (*ring, ring[0])], float)
    (west, south, low), (east, north, high) = points.min(axis=0), points.max(axis=0)
    at = np.cumsum([0, *(len(ring) + 1 for ring in rings)])[:-1]
    record = struct.pack("<i4d2i", 31, west, south, east, north, len(rings), len(points))
    record += struct.pack(f"<{len(rings)}i", *at) + struct.pack(f"<{len(rings)}i", *[5] * len(rings))
    record += points[:, :2].tobytes() + struct.pack("<2d", low, high) + points[:, 2].tobytes()

    def header(size):
        words = struct.pack(">7i", 9994, 0, 0, 0, 0, 0, size // 2) + struct.pack("<2i", 1000, 31)
        return words + struct.pack("<8d", west, south, east, north, low, high, 0, 0)

    path.write_bytes(header(108 + len(record)) + struct.pack(">2i", 1, len(record) // 2) + record)
    path.with_suffix(".shx").write_bytes(header(108) + struct.pack(">2i", 50, len(record) // 2))
    return path


def test_a_drawing_of_faces_and_fills_is_refused_with_their_kinds_and_the_way_on(tmp_path):
    drawing = ezdxf.new(units=6)
    for face in FACES:
        drawing.modelspace().add_3dface(face)
    drawing.modelspace().add_hatch().paths.add_polyline_path(SQUARE[:3], is_closed=True)
    drawing.saveas(tmp_path / "solid.dxf")
    with pytest.raises(InputError, match="only 2 3DFACE, 1 HATCH; --volume reads them as a solid of the workings"):
        read_shapes(tmp_path / "solid.dxf", None)


def test_texts_and_fills_beside_walls_are_counted_and_the_walls_are_read(tmp_path, capsys):
    drawing = ezdxf.new(units=6)
    drawing.modelspace().add_lwpolyline(list(TEE.exterior.coords)[:-1], close=True)
    for text in "ab":
        drawing.modelspace().add_text(text)
    drawing.modelspace().add_hatch().paths.add_polyline_path(SQUARE[:3], is_closed=True)
    drawing.saveas(tmp_path / "plan.dxf")
    assert len(read_shapes(tmp_path / "plan.dxf", None).shapes) == 1
    assert "plan.dxf: not read, as they are no lines or areas: 2 TEXT, 1 HATCH" in capsys.readouterr().err


def test_a_plan_on_a_layout_is_said_not_to_be_in_the_model_space(tmp_path):
    drawing = ezdxf.new(units=6)
    drawing.layout("Layout1").add_line((0, 0), (9, 0))
    drawing.saveas(tmp_path / "paper.dxf")
    with pytest.raises(InputError, match=r"a plan on a layout \(paper space\) is not read"):
        read_shapes(tmp_path / "paper.dxf", None)


def test_a_multipatch_is_refused_by_its_name_and_not_read_as_polygons(tmp_path):
    with pytest.raises(InputError, match=r"ore\.shp: holds no polygons and no lines, only 1 multipatch .*cut them at"):
        read_shapes(multipatch(tmp_path / "ore.shp", FACES), None)


def test_shapes_that_are_surfaces_or_empty_or_curved_are_counted_beside_a_drift(tmp_path, capsys):
    rounded = arc((0, 0), (5, 5), (10, 0))
    path = geopackage(tmp_path / "mine.gpkg", tin(SQUARE[:3]), None, None, rounded)
    read = read_shapes(path, None)
    told = capsys.readouterr().err
    assert [shape.geom_type for shape in read.shapes] == ["Polygon", "LineString"]
    assert read.shapes[1].length == pytest.approx(np.pi * 5, rel=1e-3)
    assert "2 shapes without geometry, 1 multipatch (TIN, polyhedral surface)" in told
    assert "mine.gpkg: 1 shapes have curves; arcs are read as chords" in told
    assert "measures (M)" not in told


def test_measures_are_dropped_with_their_number_and_the_elevations_stay(tmp_path, capsys):
    measured = struct.pack("<BII", 1, 3002, 2) + struct.pack("<8d", 0, 0, 700, 1, 9, 0, 701, 2)
    read = read_shapes(geopackage(tmp_path / "mine.gpkg", measured), None)
    assert shapely.get_coordinates(read.shapes[1], include_z=True).tolist() == [[0, 0, 700], [9, 0, 701]]
    assert "mine.gpkg: 1 shapes have measures (M); they are not read" in capsys.readouterr().err


def test_a_shapefile_without_its_index_is_refused_by_the_name_of_that_file(tmp_path):
    path = write_shapes(tmp_path / "mine.shp", [TEE])
    path.with_suffix(".shx").unlink()
    with pytest.raises(InputError, match=r"mine\.shp: mine\.shx is not beside it"):
        read_shapes(path, None)


def test_points_alone_are_no_walls_and_are_said_to_be_heights(tmp_path):
    (tmp_path / "p.geojson").write_text(shapely.to_geojson(shapely.MultiPoint([(0, 0), (1, 1)])))
    with pytest.raises(InputError, match="only 2 points; points are no walls: --heights FILE"):
        read_shapes(tmp_path / "p.geojson", None)
