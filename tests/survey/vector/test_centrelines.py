"""Centrelines in vector files: the same workings as a station table, joined where they meet, defects with places."""

from pathlib import Path

import ezdxf
import numpy as np
import pytest
import shapely
from shapely import LineString

from minesurveys.vector.shapes import Shapes
from pipeline.errors import InputError
from pipeline.params.survey import CentrelineSurveyParams, PassageSurveyParams, VectorSurveyParams
from pipeline.survey.detect import detect_here
from pipeline.survey.vector.centrelines import read_centrelines
from pipeline.survey.vector_survey import read_shapes, read_vector_survey
from tests.heights import RAMP, levels, seam, spiral, table
from tests.survey.shape_files import write_shapes

HALF_M = 2.2


def lines_of(legs):
    return [LineString([place for _, *place in leg]) for leg in legs.values()]


def line_length(line):
    return np.linalg.norm(np.diff(np.array(line.coords), axis=0), axis=1).sum()


def write(path: Path, lines):
    """Write lines as DXF in metres, or as GeoPackage or Shapefile of UTM zone 19 south."""
    if path.suffix == ".dxf":
        drawing = ezdxf.new()
        drawing.header["$INSUNITS"] = 6
        for line in lines:
            drawing.modelspace().add_polyline3d(list(line.coords), dxfattribs={"layer": "DRIFTS"})
        drawing.saveas(path)
        return path
    return write_shapes(path, lines, layer="drifts")


def drawn(path: Path, **values):
    params = CentrelineSurveyParams(kind="centrelines", name="a", file="data/x", half_width_m=HALF_M, **values)
    return read_vector_survey(params.model_copy(update={"file": path.as_posix()}))


def joined(*lines, snap_m=0.25):
    survey, _ = read_centrelines(Path("a.dxf"), Shapes([LineString(line) for line in lines], "m"), None, None, snap_m)
    places, node = np.unique(survey.positions_m, axis=0, return_inverse=True)
    ends = node.reshape(-1)[survey.legs]
    return places, {frozenset(pair) for pair in ends[ends[:, 0] != ends[:, 1]].tolist()}


@pytest.mark.parametrize("suffix", [".dxf", ".gpkg", ".shp"])
@pytest.mark.parametrize("legs", [RAMP, spiral(2), seam()], ids=["ramp", "spiral", "seam"])
def test_centrelines_make_the_workings_of_the_same_survey_as_a_table(tmp_path, legs, suffix):
    path = tmp_path / "stations.csv"
    path.write_text(table(legs))
    params = PassageSurveyParams(kind="passages", name="a", file="data/x", heights=None)
    table_read = read_vector_survey(params.model_copy(update={"file": path.as_posix()}))
    wanted, of_table = table_read.workings, table_read.shape
    read = drawn(write(tmp_path / f"mine{suffix}", lines_of(legs)))
    found, place, found_legs = read.workings, read.georeference, read.shape
    assert place.crs is None or "32719" in place.crs
    assert found.symmetric_difference(wanted).area < 0.01 * wanted.area  # walls turn otherwise where legs join
    one, two = (legs.positions_m[:, 2] + legs.datum_m for legs in (found_legs, of_table))
    assert (one.min(), one.max()) == pytest.approx((two.min(), two.max()))


def test_levels_and_a_shaft_come_out_of_centrelines(tmp_path):
    read = drawn(write(tmp_path / "mine.gpkg", lines_of(levels())))
    assert read.shape.surveyed_m == pytest.approx(sum(line_length(line) for line in lines_of(levels())))
    assert len(read.shape.pieces_m) == 0


def test_centrelines_in_feet_and_far_away_are_the_same_mine(tmp_path):
    lines = lines_of(RAMP)
    feet = [shapely.transform(line, lambda p: p / 0.3048, include_z=True) for line in lines]
    far = [shapely.transform(line, lambda p: np.add(p, [500_000, 7_000_000, 0]), include_z=True) for line in lines]
    one = drawn(write(tmp_path / "m.dxf", lines))
    two = drawn(write(tmp_path / "ft.dxf", feet), unit="ft")
    three = drawn(write(tmp_path / "far.gpkg", far))
    assert two.workings.symmetric_difference(one.workings).area < 1e-6
    np.testing.assert_allclose(two.shape.positions_m, one.shape.positions_m, atol=1e-6)
    assert three.georeference.origin == (500_000, 7_000_000)
    assert three.workings.symmetric_difference(one.workings).area < 1e-3


def test_ends_join_what_they_nearly_reach_and_others_are_listed_with_their_place(capsys):
    main = [(0, 0, 10), (50, 0, 10), (50, 40, 12)]
    places, edges = joined(main, [(20, 0.2, 10), (20, 30, 10)])  # onto the middle of a segment
    assert len(edges) == 4
    assert [20, 0.2, 10] in places.tolist()
    _, edges = joined(main, [(50.1, 0.1, 10.1), (80, 0, 10)])  # onto a corner
    assert len(edges) == 3
    assert not capsys.readouterr().err
    _, edges = joined(main, [(20, 1.5, 10), (20, 30, 10)])
    assert len(edges) == 3
    said = capsys.readouterr().err
    assert (
        "a.dxf: 1 ends are less than 3 m from another line and do not join it, the first at (20.0, 1.5, 10.0), 1.50 m"
        in said
    )
    joined(main, [(20, 0.1, 16), (20, 30, 16)])  # 6 m above it
    assert not capsys.readouterr().err


def test_lines_that_cross_at_one_height_meet_and_others_pass_over(capsys):
    one, two = [(0, 0, 10), (40, 0, 14)], [(20, -20, 12.4), (20, 20, 12.4)]
    places, edges = joined(one, two)
    assert len(edges) == 4
    assert [20, 0, 12.2] in places.round(9).tolist()
    assert "they meet there, the first at (20.0, 0.0, 12.2)" in capsys.readouterr().err
    _, edges = joined(one, [(20, -20, 18), (20, 20, 18)])
    assert len(edges) == 2


def test_a_ring_a_plumb_line_and_equal_lines_are_kept_once():
    ring = [(0, 0, 5), (30, 0, 5), (30, 30, 5), (0, 30, 5), (0, 0, 5)]
    shaft = [(30, 0, 5), (30, 0, -8)]
    _, edges = joined(ring, ring, shaft)
    assert len(edges) == 5


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (
            [[(0, 0, 100), (40, 0, 0), (80, 0, 101)]],
            r"1 points of lines have elevation 0, the first at \(40\.0",
        ),
        ([[(0, 0, 100), (40, 0, 20_000)]], r"an elevation of 20000 m, at most 10000 m"),
        ([], r"holds no lines"),
    ],
)
def test_elevations_that_cannot_be_are_refused_with_their_place(lines, message):
    with pytest.raises(InputError, match=message):
        read_centrelines(Path("a.dxf"), Shapes([LineString(line) for line in lines], "m"), None, None, 0.25)


def test_polygons_are_no_centrelines():
    with pytest.raises(InputError, match="holds polygons; centrelines are lines"):
        read_centrelines(Path("a.gpkg"), Shapes([shapely.box(0, 0, 9, 9)], "m"), None, None, 0.25)


def test_new_asks_for_the_width_of_lines_with_elevations(tmp_path):
    path = write(tmp_path / "mine.gpkg", lines_of(levels()))
    with pytest.raises(
        InputError, match=r"open walls of layer 'drifts' .*; --half-width M reads centrelines of drifts"
    ):
        detect_here(str(path), {})
    one = write(tmp_path / "one.gpkg", lines_of(RAMP))
    with pytest.raises(InputError, match="--half-width M reads"):
        detect_here(str(one), {})
    found = detect_here(str(path), {"half_width_m": HALF_M}).values
    assert found["values"]["kind"] == "centrelines"
    assert found["has_heights"]


def test_a_flat_drawing_keeps_its_shapes_without_elevations(tmp_path):
    path = write(tmp_path / "flat.dxf", [LineString([(0, 0, 7), (9, 0, 7), (9, 9, 7), (0, 0, 7)])])
    (line,) = read_shapes(path, None).shapes
    assert not line.has_z
    params = VectorSurveyParams(kind="vector", name="a", file="data/x").model_copy(update={"file": path.as_posix()})
    assert read_vector_survey(params).heights is None


def test_a_string_of_short_segments_has_no_crossings_and_no_near_ends(capsys):
    """The far end of a segment is exact: start + (end - start) rounds, and neighbours then cross."""
    turn = np.linspace(0, 3 * np.pi / 2, 60)
    string = np.column_stack([15 * np.cos(turn), 15 * np.sin(turn), -turn])
    _, legs = joined(string)
    assert len(legs) == 59
    assert capsys.readouterr().err == ""


def test_a_point_without_an_elevation_between_others_is_refused_with_its_place():
    with pytest.raises(InputError, match=r"1 points of lines have no elevation .* the first at \(30\.0, 5\.0\)"):
        joined([(0, 0, 100), (30, 5, float("nan")), (60, 0, 98)])


def test_lines_without_elevations_lie_at_0():
    places, _ = joined([(0, 0), (30, 5), (60, 0)])
    assert (places[:, 2] == 0).all()


def test_lines_that_all_fall_on_one_place_are_refused_with_their_span_and_the_unit(tmp_path):
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = 4  # mm of paper: 0.2 x 0.1 m
    for line in ([(0, 0), (200, 0)], [(200, 0), (200, 100)]):
        drawing.modelspace().add_lwpolyline(line)
    drawing.saveas(tmp_path / "a.dxf")
    with pytest.raises(
        InputError, match=r"a\.dxf: nothing is left of its lines, which span 0\.20 m, read in mm: .*--unit"
    ):
        drawn(tmp_path / "a.dxf")
    assert drawn(tmp_path / "a.dxf", unit="m").workings is not None


def test_the_share_of_each_layer_is_listed_where_several_are_read_as_centrelines(tmp_path, capsys):
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = 6
    for layer, x in (("CentreLine", 40), ("Grid", 120)):
        drawing.modelspace().add_line((0, 0), (x, 0), dxfattribs={"layer": layer})
    drawing.saveas(tmp_path / "a.dxf")
    drawn(tmp_path / "a.dxf")
    assert "a.dxf: 2 layers are read as one plan (of the length of their lines: Grid 75 %, CentreLine 25 %)" in (
        capsys.readouterr().err
    )
    drawn(tmp_path / "a.dxf", layers=["CentreLine"])
    assert "layers are read" not in capsys.readouterr().err
