"""Polylines and polygon meshes of DXF drawings, whose flags say which points are drawn and which ways close."""

import ezdxf
import numpy as np
import pyogrio
import pytest
import shapely
from ezdxf.math import BSpline

from minesurveys.solids.files import read_triangles
from minesurveys.vector.dxf import read_dxf
from pipeline.errors import InputError
from pipeline.survey.solids.closing import close_pieces
from tests.project import shared_file

FITTED, DRAWN, FRAME = 4, 8, 16  # flags of a polyline, and of its points
FRAME_M = [(0, 0, 0), (50, 80, 0), (100, -80, 0), (150, 0, 0)]


def curve():
    """The points of the curve that the frame controls."""
    return [tuple(point) for point in BSpline(FRAME_M, order=4).approximate(40)]


def add_fitted(layout, flat):
    """Add a polyline that a CAD program has fitted a spline to: the curve's points, and the frame's before each other.

    AutoCAD writes the frame's points first, other programs in between.
    """
    add = layout.add_polyline2d if flat else layout.add_polyline3d
    line = add([])
    line.dxf.flags |= FITTED
    points = curve()
    for flag, some in ((FRAME, FRAME_M[:2]), (DRAWN, points[:20]), (FRAME, FRAME_M[2:]), (DRAWN, points[20:])):
        line.append_vertices(some, dxfattribs={"flags": flag | (0 if flat else 32)})


def length_by_gdal(path):
    """The length of all lines that GDAL reads, which leaves frame points out."""
    return float(shapely.length(shapely.from_wkb(pyogrio.raw.read(path)[2])).sum())


@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize("in_block", [False, True])
def test_the_frame_of_a_fitted_spline_is_no_line(tmp_path, flat, in_block):
    drawing = ezdxf.new(units=6)
    space = drawing.modelspace()
    add_fitted(drawing.blocks.new("drift") if in_block else space, flat)
    if in_block:
        space.add_blockref("drift", (1000, 2000))
    drawing.saveas(tmp_path / "a.dxf")
    (line,) = read_dxf(tmp_path / "a.dxf", None).shapes
    assert line.length == pytest.approx(shapely.LineString(curve()).length)
    assert line.length == pytest.approx(length_by_gdal(tmp_path / "a.dxf"), abs=0.01)


def test_a_polyline_of_frame_points_alone_is_read(tmp_path):
    drawing = ezdxf.new(units=6)
    drawing.modelspace().add_polyline2d([]).append_vertices(FRAME_M, dxfattribs={"flags": FRAME})
    drawing.saveas(tmp_path / "a.dxf")
    assert read_dxf(tmp_path / "a.dxf", None).shapes[0].length == pytest.approx(shapely.LineString(FRAME_M).length)


def test_the_arcs_of_a_curve_that_was_fitted_by_arcs_are_read_with_its_extra_points(tmp_path):
    drawing = ezdxf.new(units=6)
    line = drawing.modelspace().add_polyline2d([])
    line.dxf.flags |= 2
    quarter = np.tan(np.pi / 8)
    for point, extra in (((10, 0), 0), ((0, 10), 1), ((-10, 0), 0)):
        line.append_formatted_vertices([(*point, quarter)], "xyb", dxfattribs={"flags": extra})
    drawing.saveas(tmp_path / "a.dxf")
    found = read_dxf(tmp_path / "a.dxf", None).shapes[0]
    assert found.length == pytest.approx(10 * np.pi, rel=1e-3)
    assert found.length == pytest.approx(length_by_gdal(tmp_path / "a.dxf"), rel=1e-3)


def test_a_polyline_in_a_mirrored_system_lies_where_gdal_reads_it(tmp_path):
    drawing = ezdxf.new(units=6)
    drawing.modelspace().add_lwpolyline([(0, 0), (10, 0), (10, 5)], dxfattribs={"extrusion": (0, 0, -1)})
    drawing.saveas(tmp_path / "a.dxf")
    (line,) = read_dxf(tmp_path / "a.dxf", None).shapes
    by_gdal = shapely.from_wkb(pyogrio.raw.read(tmp_path / "a.dxf")[2])[0]
    assert shapely.equals_exact(line, shapely.force_2d(by_gdal), 1e-9)
    assert line.bounds == pytest.approx((-10, 0, 0, 5))


def tube(drawing, turned, rows=4, smooth=False):
    """Add a tube of 60 m, 4 x 3.2 m, as a polygon mesh that closes along N, or along M if it is turned."""
    ring = [(-2, 0), (2, 0), (2, 3.2), (-2, 3.2)]
    places = [[(60 * i / (rows - 1), y, z) for y, z in ring] for i in range(rows)]
    places = [list(column) for column in zip(*places, strict=True)] if turned else places
    mesh = drawing.modelspace().add_polymesh((len(places), len(places[0])))
    (mesh.m_close if turned else mesh.n_close)()
    for i, row in enumerate(places):
        for j, place in enumerate(row):
            mesh.set_mesh_vertex((i, j), place)
    if smooth:  # the frame's points come first, twice as far out
        for vertex in mesh.vertices:
            vertex.dxf.flags |= DRAWN
        mesh.append_vertices([(100 * k, 0, 50) for k in range(6)], dxfattribs={"flags": 64 | FRAME})
        mesh.vertices[:] = mesh.vertices[-6:] + mesh.vertices[:-6]
        mesh.dxf.flags |= FITTED
        mesh.dxf.m_smooth_density, mesh.dxf.n_smooth_density = mesh.dxf.m_count, mesh.dxf.n_count
        mesh.dxf.m_count, mesh.dxf.n_count = 2, 3


def closed(path):
    read = read_triangles(path, path.read_bytes())
    return close_pieces(read.vertices, read.faces, 1e-4, 10.0)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("smooth", [False, True])
def test_a_polygon_mesh_that_closes_along_one_way_is_a_tube_with_two_open_ends(tmp_path, turned, smooth):
    drawing = ezdxf.new(units=6)
    tube(drawing, turned, smooth=smooth)
    drawing.saveas(tmp_path / "a.dxf")
    found = closed(tmp_path / "a.dxf")
    assert sum(solid.volume() for solid in found.solids) == pytest.approx(60 * 4 * 3.2)
    assert sorted(hole.edge_m for hole in found.holes) == pytest.approx([14.4, 14.4])


def test_a_polygon_mesh_that_closes_along_both_ways_has_no_hole(tmp_path):
    drawing = ezdxf.new(units=6)
    count = 12
    mesh = drawing.modelspace().add_polymesh((count, 4))
    mesh.close(m_close=True, n_close=True)
    for i in range(count):
        turn = 2 * np.pi * i / count
        for j, (out, up) in enumerate([(18, 0), (22, 0), (22, 3), (18, 3)]):
            mesh.set_mesh_vertex((i, j), (out * np.cos(turn), out * np.sin(turn), up))
    drawing.saveas(tmp_path / "a.dxf")
    found = closed(tmp_path / "a.dxf")
    ring_m2 = count / 2 * np.sin(2 * np.pi / count) * (22**2 - 18**2)
    assert sum(solid.volume() for solid in found.solids) == pytest.approx(3 * ring_m2)
    assert found.holes == []


def test_a_polygon_mesh_that_another_made_is_a_tube_of_60_m():
    found = closed(shared_file("polygon-mesh-tube.dxf"))
    low_x, low_y, low_z, high_x, high_y, high_z = found.solids[0].bounding_box()
    assert (high_x - low_x, high_y - low_y, high_z - low_z) == pytest.approx((60, 4, 3.2), abs=0.05)
    assert len(found.holes) == 2


@pytest.mark.parametrize(
    ("code", "unit", "said"),
    [
        (1, "in", ""),
        (2, "ft", ""),
        (21, "ft", ""),
        (6, "m", ""),
        (0, None, ""),
        (14, None, "Decimeters"),
        (10, None, "Yards"),
        (24, None, "USSurveyMile"),
    ],
)
def test_a_stated_unit_is_used_or_named(tmp_path, capsys, code, unit, said):
    drawing = ezdxf.new(units=code)
    tube(drawing, turned=False)
    drawing.modelspace().add_line((0, 0), (10, 0))
    drawing.saveas(tmp_path / "a.dxf")
    assert read_dxf(tmp_path / "a.dxf", None).unit == unit
    assert read_triangles(tmp_path / "a.dxf", b"").unit == unit
    shown = capsys.readouterr().err
    assert f"states its unit as {said} ($INSUNITS = {code})" in shown if said else "unit" not in shown


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ({"$INSUNITS": 0, "$MEASUREMENT": 0}, "states no unit ($INSUNITS) and is drawn in English units"),
        ({"$INSUNITS": 0, "$LUNITS": 4}, "states no unit ($INSUNITS) and shows lengths in feet and inches"),
        ({"$INSUNITS": 6, "$LUNITS": 3}, "states the unit m and shows lengths in feet and inches"),
        ({"$INSUNITS": 6, "$MEASUREMENT": 0}, ""),
        ({"$INSUNITS": 1, "$LUNITS": 4, "$MEASUREMENT": 0}, ""),
    ],
)
def test_english_units_that_a_drawing_only_shows_are_listed(tmp_path, capsys, header, said):
    drawing = ezdxf.new()
    drawing.modelspace().add_line((0, 0), (10, 0))
    for name, value in header.items():
        drawing.header[name] = value
    drawing.saveas(tmp_path / "a.dxf")
    read_dxf(tmp_path / "a.dxf", None)
    shown = capsys.readouterr().err
    assert said in shown if said else shown == ""


def test_a_place_on_the_earth_is_listed(tmp_path, capsys):
    drawing = ezdxf.new("R2010", units=6)
    drawing.modelspace().add_line((0, 0), (10, 0))
    drawing.modelspace().new_geodata().setup_local_grid(design_point=(0, 0), reference_point=(500_000, 5_500_000))
    drawing.saveas(tmp_path / "a.dxf")
    assert read_dxf(tmp_path / "a.dxf", None).unit == "m"
    assert "states its place on the Earth (GEODATA), which is not read" in capsys.readouterr().err


def test_a_line_far_from_all_others_is_named_and_left_out_by_its_layer(tmp_path):
    drawing = ezdxf.new(units=6)
    space = drawing.modelspace()
    for k in range(5):
        space.add_lwpolyline(
            [(456_780, 5_712_340 + 9 * k), (456_880, 5_712_340 + 9 * k)], dxfattribs={"layer": "walls"}
        )
    space.add_lwpolyline([(0, 0), (3, 0)], dxfattribs={"layer": "mark"})
    drawing.saveas(tmp_path / "a.dxf")
    with pytest.raises(
        InputError,
        match=r"2 of 12 points lie more than 10000 from the others, the first at \(0, 0\), the others "
        r"about \(456\d\d\d, 57123\d\d\); erase what lies there, or choose layers by --layer NAME",
    ):
        read_dxf(tmp_path / "a.dxf", None)
    assert len(read_dxf(tmp_path / "a.dxf", ["walls"]).shapes) == 5  # as the refusal says
