"""Vector files: written by each format's own library, read by our readers."""

import json
import os
import re
import warnings
from itertools import pairwise

import ezdxf
import numpy as np
import pyogrio.raw
import pyproj
import pytest
import shapely
from shapely import LineString
from shapely.affinity import translate

from minesurveys.coordinates.map_axes import coordinate_system
from minesurveys.formats import files_of
from minesurveys.vector.dxf import read_dxf
from minesurveys.vector.geodata import read_geodata
from minesurveys.vector.geojson import read_geojson
from minesurveys.vector.shapes import Shapes, locate
from pipeline.errors import InputError
from pipeline.geometry.rasterize import fill_polygon
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import VectorSurveyParams
from pipeline.survey.detect import detect_survey
from pipeline.survey.vector.enclosed import workings_of
from pipeline.survey.vector_survey import read_vector_survey
from tests.mines import RING, TEE
from tests.survey.shape_files import write_shapes


def workings_from(path, content, unit=None, origin=None, snap_m=0.25, seeds=()):
    shapes, georeference = locate(path, content, unit, origin)
    return workings_of(path, shapes, snap_m, list(seeds)), georeference


def same(one, other, tolerance_m2=1e-6):
    assert one.symmetric_difference(other).area <= tolerance_m2


def drawing(path, unit=6, scale=1.0, rings=(RING.exterior, *RING.interiors), layer="ribs"):
    made = ezdxf.new("R2010")
    made.header["$INSUNITS"] = unit
    for ring in rings:
        made.modelspace().add_lwpolyline(np.array(ring.coords)[:-1] / scale, close=True, dxfattribs={"layer": layer})
    made.saveas(path)
    return made


@pytest.mark.parametrize(("unit", "metres"), [(6, 1.0), (4, 0.001), (2, 0.3048)])
def test_nested_closed_polylines_are_workings_and_pillars_in_any_unit(tmp_path, unit, metres):
    path = tmp_path / "mine.dxf"
    drawing(path, unit, metres)
    workings, georeference = workings_from(path, read_dxf(path, None))
    same(workings, RING)
    assert georeference.metres_per_unit == metres


def test_chords_of_arcs_and_bulges_are_as_near_to_them_as_a_share_of_the_drawing(tmp_path):
    made, radius_m = ezdxf.new(), 200.0
    made.header["$INSUNITS"] = 6
    made.modelspace().add_arc((0, 0), radius_m, 0, 90)
    made.modelspace().add_lwpolyline([(radius_m, 0, 0, 0, 1.0), (-radius_m, 0, 0, 0, 0)])  # half a turn
    made.saveas(tmp_path / "arc.dxf")
    for line in read_dxf(tmp_path / "arc.dxf", None).shapes:
        ends = shapely.get_coordinates(line)
        middles = (ends[1:] + ends[:-1]) / 2
        off_m = np.abs(np.linalg.norm(np.concatenate([ends, middles]), axis=1) - radius_m)
        assert off_m.max() < 1e-4 * 2 * radius_m


def test_open_wall_lines_are_joined_and_enclose_workings(tmp_path):
    path = tmp_path / "open.dxf"
    made = ezdxf.new()
    made.header["$INSUNITS"] = 6
    corners = np.array(TEE.exterior.coords)
    for a, b in pairwise(corners):
        along = (b - a) / np.linalg.norm(b - a)
        made.modelspace().add_line(a + 0.05 * along, b - 0.05 * along)  # every corner has a gap of 7 cm
    made.saveas(path)
    same(workings_from(path, read_dxf(path, None))[0], TEE, 0.05)
    with pytest.raises(InputError, match=r"nearest ends left open are 0\.07 m apart.*survey\.snap_m = 0\.01"):
        workings_from(path, read_dxf(path, None), snap_m=0.01)


def test_a_seed_chooses_the_enclosed_area_that_is_a_drift(tmp_path):
    path = tmp_path / "two.geojson"
    lines = [LineString(ring.coords) for ring in (RING.exterior, *RING.interiors)]
    path.write_text(shapely.to_geojson(shapely.MultiLineString(lines)))
    content = read_geojson(path, None)
    same(workings_from(path, content, unit="m", seeds=[(1, 1)])[0], RING)
    same(workings_from(path, content, unit="m", seeds=[(30, 20)])[0], shapely.box(6, 6, 54, 34))
    with pytest.raises(InputError, match=r"the walls round the seed \(99, 99\) are open"):
        workings_from(path, content, unit="m", seeds=[(99, 99)])


def test_blocks_are_resolved_curves_are_flattened_and_layers_are_chosen(tmp_path):
    path = tmp_path / "block.dxf"
    made = drawing(path, layer="notes")
    block = made.blocks.new("chamber")
    block.add_circle((0, 0), 5.0, dxfattribs={"layer": "ribs"})
    made.layers.add("ribs")
    made.modelspace().add_blockref("chamber", (100, 0))
    made.saveas(path)
    workings, _ = workings_from(path, read_dxf(path, ["ribs"]))
    assert workings.centroid.distance(shapely.Point(100, 0)) < 1e-6
    assert workings.area == pytest.approx(np.pi * 25, rel=2e-3)
    with pytest.raises(InputError, match=r"no layer walls; there are .*notes, ribs"):
        read_dxf(path, ["walls"])


def test_a_wall_drawn_twice_counts_once(tmp_path):
    for rings in ((RING.exterior, RING.exterior, *RING.interiors), (RING.exterior, *RING.interiors, *RING.interiors)):
        drawing(tmp_path / "twice.dxf", rings=rings)
        same(workings_from(tmp_path / "twice.dxf", read_dxf(tmp_path / "twice.dxf", None))[0], RING)


@pytest.mark.parametrize(
    "geometry",
    [
        {"type": "Polygon", "coordinates": [[[0, 0], ["x", 0], [10, 5], [0, 5], [0, 0]]]},
        {"type": "LineString", "coordinates": [[0, 0], [None, 1], [2, 2]]},
        {"type": "Circle", "coordinates": [0, 0], "radius": 3},
        {"type": "Polygon"},
    ],
    ids=["text for a number", "no number", "unknown kind", "no coordinates"],
)
def test_a_broken_geometry_refuses_geojson_of_which_gdal_would_leave_it_out_without_an_error(tmp_path, geometry):
    path = tmp_path / "mine.geojson"
    shapes = [json.loads(shapely.to_geojson(RING)), geometry]
    features = [{"type": "Feature", "properties": {}, "geometry": shape} for shape in shapes]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    with pytest.raises(InputError, match="a feature or its geometry lacks what RFC 7946 asks for"):
        read_geojson(path, None)
    with warnings.catch_warnings(action="ignore"):
        read_by_gdal = pyogrio.raw.read(path)[2]
    assert [wkb is None for wkb in read_by_gdal] == [False, True]  # otherwise GDAL could read these files, too


def test_geojson_with_a_stated_unit_has_no_coordinate_system(tmp_path):
    (tmp_path / "local.geojson").write_text(shapely.to_geojson(RING))
    _, georeference = workings_from(
        tmp_path / "local.geojson", read_geojson(tmp_path / "local.geojson", None), unit="m"
    )
    assert georeference.crs is None


def test_nested_blocks_with_too_many_entities_are_refused(tmp_path):
    path = tmp_path / "bomb.dxf"
    made = ezdxf.new()
    made.blocks.new("b0").add_line((0, 0), (1, 1))
    for level in range(1, 8):
        block = made.blocks.new(f"b{level}")
        for _ in range(10):
            block.add_blockref(f"b{level - 1}", (0, 0))
    made.modelspace().add_blockref("b7", (0, 0))
    made.saveas(path)
    with pytest.raises(InputError, match="entities with blocks resolved, the limit is 100000"):
        read_dxf(path, None)


def test_a_pipe_beside_a_shapefile_is_refused_and_not_waited_for(tmp_path):
    path = tmp_path / "a.shp"
    path.write_bytes(b"\x00\x00\x27\x0a" + bytes(96))
    os.mkfifo(tmp_path / "a.dbf")
    with pytest.raises(InputError, match=r"a\.dbf beside it is not a plain file"):
        read_geodata(path, None)


@pytest.mark.parametrize("name", ["mine.gpkg", "mine.shp"])
def test_polygons_in_map_coordinates_are_moved_to_a_local_origin(tmp_path, name):
    moved = shapely.transform(RING, lambda p: p + np.array([381_234.0, 6_290_123.0]))
    path = write_shapes(tmp_path / name, [moved])
    workings, georeference = workings_from(path, read_geodata(path, None))
    same(
        shapely.transform(workings, lambda p: p + np.array(georeference.origin) - (381_234.0, 6_290_123.0)), RING, 1e-3
    )
    assert georeference.crs is not None
    assert "32719" in georeference.crs
    assert georeference.origin == (381_230.0, 6_290_120.0)
    assert {p.suffix for p in files_of(path)} == {path.suffix} | (
        {".shx", ".dbf", ".prj", ".cpg"} if name.endswith(".shp") else set()
    )


def test_layers_of_a_geopackage_are_chosen_by_name(tmp_path):
    path = tmp_path / "two.gpkg"
    for layer, shape in (("ribs", RING), ("surface", TEE)):
        write_shapes(path, [shape], layer=layer, append=path.exists())
    same(workings_from(path, read_geodata(path, ["ribs"]))[0], RING)
    with pytest.raises(InputError, match="no layer roads; there are ribs, surface"):
        read_geodata(path, ["roads"])


def test_degrees_are_projected_to_metres(tmp_path):
    path = tmp_path / "mine.geojson"
    to_degrees = pyproj.Transformer.from_crs("EPSG:32719", "EPSG:4326", always_xy=True)
    wide = shapely.transform(
        RING, lambda p: np.column_stack(to_degrees.transform(*(p + np.array([381_000.0, 6_290_000.0])).T))
    )
    path.write_text(json.dumps({"type": "Feature", "properties": {}, "geometry": json.loads(shapely.to_geojson(wide))}))
    workings, georeference = workings_from(path, read_geojson(path, None))
    assert workings.area == pytest.approx(RING.area, rel=1e-3)  # UTM's own scale is off by 0.04 %
    assert len(workings.geoms[0].interiors) == 1
    assert "tmerc" in georeference.projection


@pytest.mark.parametrize(
    ("shapes", "unit", "origin", "message"),
    [
        ([shapely.box(0, 0, 90_000, 10)], None, None, "reaches from .* beyond 10000 m; is survey.unit = m right"),
        ([shapely.box(0, 0, 9, 10)], None, (9e5, 0.0), "beyond 10000 m"),
        ([shapely.Point(1, 2)], None, None, "no polygons and no lines"),
        ([], None, None, "no polygons and no lines"),
    ],
)
def test_shapes_that_cannot_be_a_mine_are_refused(tmp_path, shapes, unit, origin, message):
    with pytest.raises(InputError, match=message):
        workings_from(tmp_path / "x.gpkg", Shapes(shapes), unit, origin)


@pytest.mark.parametrize(
    ("name", "data", "reader"),
    [
        ("a.geojson", b"{}", read_geojson),
        ("a.geojson", b"[1, 2", read_geojson),
        ("a.dxf", b"nothing", read_dxf),
        ("a.geojson", b'{"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [[1]]}}', read_geojson),
        ("a.gpkg", b"<OGRVRTDataSource/>", read_geodata),
        ("a.shp", b"", read_geodata),
        ("a.gpkg", b"SQLite format 3\x00" + bytes(900), read_geodata),
    ],
)
def test_a_file_whose_content_does_not_match_its_suffix_is_refused_by_name(tmp_path, name, data, reader):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=name):
        reader(tmp_path / name, None)


@pytest.mark.parametrize("corner", [(0.0, 0.0), (0.5, 0.25), (0.125, 2.0)])
def test_walls_at_whole_and_half_metres_miss_all_pixel_centres(tmp_path, monkeypatch, corner):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").mkdir()
    mine = shapely.transform(TEE, lambda xy: xy + corner)
    (tmp_path / "data/mine.geojson").write_text(
        json.dumps(
            {
                "type": "FeatureCollection",
                "features": [{"type": "Feature", "properties": {}, "geometry": shapely.geometry.mapping(mine)}],
            }
        )
    )
    fields = {"kind": "vector", "name": "mine", "file": "data/mine.geojson", "unit": "m", "origin": (0.0, 0.0)}
    read = read_vector_survey(VectorSurveyParams.model_validate(fields))
    workings, frame = read.workings, read.frame
    drawn = fill_polygon(workings, frame)
    for shift_m in (0.01, -0.01):
        assert (fill_polygon(translate(workings, shift_m, shift_m), frame) == drawn).all()


@pytest.mark.parametrize("system", ["+init={}:a", "+proj=longlat +nadgrids={}", "+proj=pipeline +step +file={}"])
def test_a_coordinate_system_that_names_a_file_is_refused_before_proj_opens_it(tmp_path, system):
    secret = tmp_path / "outside.init"
    secret.write_text("<a> +proj=utm +zone=33 +datum=WGS84 <>\n")
    ring = [[0, 0], [50, 0], [50, 5], [0, 5], [0, 0]]
    feature = {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
    crs = {"type": "name", "properties": {"name": system.format(secret)}}
    path = tmp_path / "plan.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "crs": crs, "features": [feature]}))
    with pytest.raises(InputError, match="names files; they are not read"):
        locate(path, read_geojson(path, None), None, None)
    assert coordinate_system(path, "+proj=merc +a=6378137 +b=6378137 +nadgrids=@null +units=m").is_projected


@pytest.mark.parametrize("side_deg", [1e-9, 4e-6])
def test_workings_shorter_than_a_robot_are_refused_with_the_key_of_their_unit(tmp_path, monkeypatch, side_deg):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").mkdir()
    (tmp_path / "data/speck.geojson").write_text(shapely.to_geojson(shapely.box(0, 0, side_deg, side_deg)))
    fields = {"kind": "vector", "name": "speck", "file": "data/speck.geojson"}
    with pytest.raises(InputError, match=r" m long, at least 1 m is needed; is survey\.unit right"):
        read_vector_survey(VectorSurveyParams.model_validate(fields))


@pytest.mark.parametrize("release", ["R12", "R2010"])
def test_walls_that_are_drawn_with_a_width_are_lines(tmp_path, capsys, release):
    content = ezdxf.filemanagement.new(release)
    content.header["$INSUNITS"] = 6
    for ring in (RING.exterior, *RING.interiors):
        points = [(x, y, 0.3, 0.3) for x, y in ring.coords[:-1]]
        if release == "R12":
            content.modelspace().add_polyline2d(points, format="xyse", close=True)
        else:
            content.modelspace().add_lwpolyline(points, format="xyse", close=True)
    content.saveas(tmp_path / "mine.dxf")
    read = read_dxf(tmp_path / "mine.dxf", None)
    assert len(read.shapes) == 1 + len(RING.interiors)
    assert read.others == {}
    assert "2 polylines have a width, which is not read; --half-width" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "name"),
    [({"geometryType": "esriGeometryPolygon", "features": []}, "Esri JSON"), ({"type": "Topology"}, "TopoJSON")],
)
def test_other_ways_to_write_shapes_as_json_are_named(tmp_path, content, name):
    (tmp_path / "mine.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=f"{name}, which is not read: QGIS opens it and saves it as GeoJSON"):
        read_geojson(tmp_path / "mine.json", None)


@pytest.mark.parametrize(
    ("value", "shown"), [("NaN", "NaN"), ("1e400", "Infinity"), ("-1e308", "-1e+308"), ("1" * 400, "1" * 20)]
)
def test_a_coordinate_that_no_place_has_is_named_with_its_feature(tmp_path, value, shown):
    good = {"type": "Polygon", "coordinates": [[[0, 0], [90, 0], [90, 5], [0, 5], [0, 0]]]}
    wrong = {"type": "Polygon", "coordinates": [[[0, 0], [90, 0], [90, "X"], [0, 5], [0, 0]]]}
    features = [{"type": "Feature", "properties": {}, "geometry": shape} for shape in (None, good, wrong)]
    path = tmp_path / "a.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}).replace('"X"', value))
    for unit in (None, "m"):
        with pytest.raises(InputError, match=f"feature 3 has the coordinate {re.escape(shown)}, expected") as caught:
            detect_survey(path, StatedOptions(unit=unit))
        assert len(str(caught.value)) < len(str(path)) + 100


def test_a_coordinate_that_no_place_has_is_named_with_its_shape(tmp_path):
    areas = [shapely.box(0, 0, 90, 5), shapely.box(0, 0, 1e300, 5)]
    write_shapes(tmp_path / "a.gpkg", areas, "EPSG:32632")
    with pytest.raises(InputError, match=r"shape 2 has the coordinate 1e\+300, expected numbers below 1e\+12"):
        detect_survey(tmp_path / "a.gpkg")
