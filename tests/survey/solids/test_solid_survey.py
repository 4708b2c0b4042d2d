"""A solid as a survey: units, axes and origins are noticed, and the view from above is its plan."""

import numpy as np
import pytest
import trimesh

from benchmarks.scans.solid_files import write
from minesurveys.remarks import collect_remarks
from pipeline.errors import InputError
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import SolidSurveyParams
from pipeline.survey.detect import detect_survey
from pipeline.survey.solids.decimate import distances
from pipeline.survey.solids.read import read_solid
from tests.survey.solids.test_solid_files import crossing_tunnels

PARAMS = SolidSurveyParams(kind="solid", name="a", file="data/x", heights=None)


def read(path, **values):
    return read_solid(PARAMS.model_copy(update={"file": path.as_posix(), **values}))


def remarks_of(path, **values):
    with collect_remarks() as found:
        detect_survey(path, StatedOptions(**values))
    return " ".join(remark.line() for remark in found)


def test_the_plan_is_the_view_from_above(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    write(tmp_path / "a.obj", vertices, faces)
    found = read(tmp_path / "a.obj")
    assert found.workings.area == pytest.approx(12 * 3 + 8 * 3 - 3 * 3)
    assert found.workings.bounds == pytest.approx((0, -2, 12, 6))


def test_coordinates_of_a_national_grid_and_elevations_get_an_origin(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    write(tmp_path / "a.obj", vertices + np.array([351234.0, 6301118.0, 2412.5]), faces)
    found = read(tmp_path / "a.obj")
    assert found.georeference.origin == (351230.0, 6301110.0)
    assert found.solid.datum_m == 2412
    assert found.solid.vertices.min(axis=0) == pytest.approx([4.0, 6.0, 0.5])


def test_a_stated_unit_scales_the_solid(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    write(tmp_path / "a.obj", vertices / 0.3048, faces)
    assert read(tmp_path / "a.obj", unit="ft").workings.bounds == pytest.approx((0, -2, 12, 6))


def test_a_file_with_y_up_is_noticed_and_turned_by_the_option(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    write(tmp_path / "a.obj", vertices[:, [0, 2, 1]] * [1, 1, -1], faces)
    assert "most level surfaces face along its y axis" in remarks_of(tmp_path / "a.obj")
    assert read(tmp_path / "a.obj", up="y").workings.bounds == pytest.approx((0, -2, 12, 6))
    write(tmp_path / "a.glb", vertices, faces)  # has y up by its rule
    assert "y axis" not in remarks_of(tmp_path / "a.glb")


def test_what_is_guessed_closed_and_turned_is_listed(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    end = np.flatnonzero((vertices[faces][:, :, 0] == 0).all(axis=1))
    write(tmp_path / "a.obj", vertices, np.delete(faces, end, axis=0)[:, ::-1])
    said = remarks_of(tmp_path / "a.obj")
    assert "states no unit; read as metres, 12 x 8 x 3 m, its passages 2.99 m across; --unit" in said
    assert "1 holes are closed: 3.50 m at (0.0, 1.5, 1.2)" in said
    assert "the normals of 1 of 1 pieces point into the workings" in said


def test_a_dense_mesh_is_simplified_to_as_many_facets_as_a_world_holds(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=5, radius=3.0)
    ball.export(tmp_path / "a.ply")
    found = detect_survey(tmp_path / "a.ply")
    assert len(ball.faces) > 20_000
    assert found.values["simplify_m"] == 0.03


def test_of_a_mesh_that_is_simplified_by_a_millimetre_no_corner_moves_by_more(tmp_path):
    box = trimesh.creation.box([20, 4, 3])
    for _ in range(6):
        box = box.subdivide()
    rough_m = 2e-4 * np.random.default_rng(0).standard_normal(box.vertices.shape)
    write(tmp_path / "a.obj", box.vertices + rough_m, box.faces)
    solid = read(tmp_path / "a.obj").solid
    assert len(box.faces) > 40_000
    assert len(solid.faces) < 20_000
    shift = [0, 0, solid.datum_m]
    assert distances(box.vertices + rough_m - shift, solid.vertices, solid.faces.astype(int)).max() < 0.001
    assert "no corner moves by more than" in remarks_of(tmp_path / "a.obj")


def test_the_section_that_is_detected_reads_the_same_solid(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    write(tmp_path / "a.glb", vertices, faces)
    found = detect_survey(tmp_path / "a.glb", StatedOptions(close_m=2.0))
    section = SolidSurveyParams.model_validate(found.values | {"name": "a", "heights": None, "file": "data/x"})
    solid = read(tmp_path / "a.glb", **section.model_dump(exclude={"file"})).solid
    assert section.close_m == 2.0
    assert solid.vertices.max(axis=0) == pytest.approx([12, 6, 3])


def test_a_mesh_that_encloses_nothing_is_refused_by_name(tmp_path):
    write(tmp_path / "a.obj", np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    with pytest.raises(InputError, match=r"a\.obj: its triangles enclose no space"):
        read(tmp_path / "a.obj")


def box(low, high, is_rock=False):
    found = trimesh.creation.box(bounds=[low, high])
    return trimesh.Trimesh(found.vertices, found.faces[:, ::-1] if is_rock else found.faces, process=False)


def test_rock_in_the_workings_is_listed_with_the_place_of_the_largest_and_has_no_plan(tmp_path):
    pillars = [box([x, 12, 0], [x + d, 18, 3.5], is_rock=True) for x, d in ((4, 2), (12, 6))]
    trimesh.util.concatenate([box([0, 0, 0], [30, 30, 3.5]), *pillars]).export(tmp_path / "a.stl")
    said = remarks_of(tmp_path / "a.stl")
    assert "2 of 3 pieces are rock in the workings" in said
    assert "168 m3, the largest 126 m3 at (15.0, 15.0, 1.8)" in said
    assert read(tmp_path / "a.stl").workings.area == pytest.approx(900 - 48)


def test_spaces_that_only_touch_are_listed(tmp_path):
    trimesh.util.concatenate([box([0, 0, 0], [30, 4, 3.5]), box([30, 4, 0], [60, 8, 3.5])]).export(tmp_path / "a.stl")
    said = remarks_of(tmp_path / "a.stl")
    assert "1 pairs of spaces touch at an edge or a point alone, the first at (30.0, 4.0, 1.8)" in said
    assert "0.05 m of rock part them" in said
