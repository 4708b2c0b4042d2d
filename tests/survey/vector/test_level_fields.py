"""A coal mine whose seams lie in one plane: a property of each roadway keeps the seams apart."""

import json

import numpy as np
import pyogrio.raw
import pytest
import shapely
from shapely import LineString

from minesurveys.remarks import collect_remarks
from pipeline.errors import InputError
from pipeline.params.survey import CentrelineSurveyParams, VectorSurveyParams
from pipeline.survey.detect import detect_here
from pipeline.survey.vector_survey import read_vector_survey
from tests.survey.shape_files import write_shapes

HALF_M = 2.5
SEAMS = (-420.0, -460.0, -500.0)


def roadways(seam, long_m=200.0, pillar_m=40.0):
    """Return the mains and cross-cuts of a seam, moved aside so that those of two seams cross in plan."""
    aside, mains = 13.0 * seam, 3
    across = int(long_m / pillar_m) + 1
    lines = [LineString([(0, aside + k * pillar_m), (long_m, aside + k * pillar_m)]) for k in range(mains)]
    ends = aside, aside + (mains - 1) * pillar_m
    lines += [LineString([(aside + k * pillar_m, ends[0]), (aside + k * pillar_m, ends[1])]) for k in range(across)]
    return [line.intersection(shapely.box(0, -1, long_m, 1000)) for line in lines if aside < long_m]


def coal_mine(path, as_areas=False):
    """Write the roadways of three seams as GeoJSON in UTM, with their seam, its number and its floor."""
    features = []
    for seam, floor in enumerate(SEAMS):
        for line in filter(lambda line: line.length > 0, roadways(seam)):
            shape = line.buffer(HALF_M, cap_style="square") if as_areas else line
            features.append(
                {
                    "type": "Feature",
                    "properties": {"seam": f"Seam {seam}", "number": seam, "floor": floor},
                    "geometry": json.loads(shapely.to_geojson(shape)),
                }
            )
    crs = {"type": "name", "properties": {"name": "EPSG:32632"}}
    path.write_text(json.dumps({"type": "FeatureCollection", "crs": crs, "features": features}))
    return path


def one_seam(seam):
    return shapely.union_all([line.buffer(HALF_M, cap_style="round") for line in roadways(seam) if line.length > 0])


def read(path, kind=CentrelineSurveyParams, **values):
    width = {"half_width_m": HALF_M} if kind is CentrelineSurveyParams else {}
    name = {CentrelineSurveyParams: "centrelines", VectorSurveyParams: "vector"}[kind]
    params = kind.model_validate({"kind": name, "name": "a", "file": "data/x", "px_per_m": 1.0, **width, **values})
    return read_vector_survey(params.model_copy(update={"file": path.as_posix()}))


def test_seams_in_one_plane_are_merged_where_they_cross_and_the_warning_names_the_option_and_the_fields(
    tmp_path, capsys
):
    read(coal_mine(tmp_path / "coal.geojson"))
    told = capsys.readouterr().err
    assert "places without a common point" in told
    assert "--level-by FIELD keeps levels apart by the value of a property (seam, number, floor)" in told


def test_areas_of_seams_that_lie_over_each_other_are_joined_with_a_warning_of_their_size_and_the_option(
    tmp_path, capsys
):
    path = coal_mine(tmp_path / "coal.geojson", as_areas=True)
    found = read(path, VectorSurveyParams)
    areas = [shape for seam in range(3) for shape in roadways(seam) if shape.length > 0]
    over_m2 = sum(line.buffer(HALF_M, cap_style="square").area for line in areas) - found.workings.area
    told = capsys.readouterr().err
    assert f"{over_m2:.0f} m2 of its areas lie over others and are joined with them as one level" in told
    assert "--level-by FIELD keeps levels apart by the value of a property (seam, number, floor)" in told


def test_areas_beside_each_other_are_joined_without_a_warning(tmp_path, capsys):
    path = write_shapes(tmp_path / "a.gpkg", [shapely.box(k * 10, 0, k * 10 + 10.01, 5) for k in range(4)])
    assert read(path, VectorSurveyParams).workings.area == pytest.approx(200, abs=0.1)
    assert "lie over" not in capsys.readouterr().err


def test_of_the_units_that_are_tried_only_the_chosen_one_is_warned_about(tmp_path):
    areas = [shapely.box(0, k * 2000, 60_000, k * 2000 + 4000) for k in range(2)]
    write_shapes(tmp_path / "mm.gpkg", areas, None)
    with collect_remarks() as remarks:
        assert detect_here(str(tmp_path / "mm.gpkg"), {}).values["values"]["unit"] == "mm"
    assert [remark.line().partition(" of its")[0] for remark in remarks if "lie over" in remark.line()] == [
        "mm.gpkg: 120 m2"
    ]


@pytest.mark.parametrize(
    "stated",
    [
        {"level_by": "floor"},
        {"level_by": "seam", "elevations_m": {"Seam 0": -420.0, "Seam 1": -460.0, "Seam 2": -500.0}},
    ],
)
def test_a_property_keeps_seams_apart_and_the_longest_is_built_at_its_floor(tmp_path, capsys, stated):
    found = read(coal_mine(tmp_path / "coal.geojson"), **stated)
    wanted = one_seam(0)
    assert found.workings.symmetric_difference(wanted).area < 0.01 * wanted.area
    assert found.shape.datum_m + found.shape.positions_m[0, 2] == pytest.approx(-420.0)
    told = capsys.readouterr().err
    assert "3 pieces share no station" in told
    assert "--piece (survey.piece) builds another" in told
    assert ("(-500, -460, -420), taken as elevations in metres" in told) == ("elevations_m" not in stated)


def test_areas_of_seams_are_kept_apart_by_the_same_property(tmp_path, capsys):
    found = read(coal_mine(tmp_path / "coal.geojson", as_areas=True), VectorSurveyParams, level_by="floor")
    corners = found.shape.mesh.vertices[found.shape.mesh.faces]
    area_m2 = shapely.area(shapely.polygons(corners[:, :, :2])).sum()
    assert area_m2 == pytest.approx(sum(one_seam(seam).area for seam in range(3)), rel=0.02)
    assert np.unique(corners[:, :, 2]).tolist() == [0, 40, 80]
    assert "3 pieces of its levels and ramps do not meet; all are built" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("field", "message"),
    [
        ("seam", r"its 3 values are no elevations at least 4 m apart.*--elevation 'Seam 0'=M --elevation 'Seam 1'=M"),
        ("number", r"its 3 values are no elevations .*--elevation '0'=M"),
        ("level", "no shape has this property; its properties: seam, number, floor"),
    ],
)
def test_values_that_are_no_elevations_are_asked_for_one_by_one(tmp_path, field, message):
    with pytest.raises(InputError, match=rf"coal\.geojson: --level-by {field}: {message}"):
        read(coal_mine(tmp_path / "coal.geojson"), level_by=field)


def test_a_drawing_without_properties_is_refused_with_the_option_for_layers(tmp_path):
    (tmp_path / "a.str").write_text("a\n0,0,0,0\n1,0,0,0,\n1,5,5,0,\n0,0,0,0,END\n")
    with pytest.raises(InputError, match="its lines have no properties, but layers; state --elevation LAYER=M"):
        detect_here(str(tmp_path / "a.str"), {"level_by": "floor"})


def test_a_property_of_a_geopackage_names_levels_too_and_is_written_into_the_survey(tmp_path):
    lines = [(seam, line) for seam in (0, 1) for line in roadways(seam)[:3] + roadways(seam)[4:5]]
    floors = np.array([SEAMS[seam] for seam, _ in lines])
    shapes = np.array([line.wkb for _, line in lines], object)
    path = tmp_path / "coal.gpkg"
    pyogrio.raw.write(path, shapes, [floors], ["floor"], geometry_type="LineString", crs="EPSG:32632")
    values = detect_here(str(path), {"level_by": "floor", "half_width_m": HALF_M}).values["values"]
    assert values["level_by"] == "floor"
    found = read(path, level_by=values["level_by"])
    wanted = shapely.union_all([line.buffer(HALF_M) for seam, line in lines if seam == 0])
    assert found.workings.area == pytest.approx(wanted.area, rel=0.01)
