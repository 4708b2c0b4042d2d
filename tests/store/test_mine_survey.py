"""The survey of a mine as one folder: every shape is read as it was written, and nothing else is."""

from dataclasses import fields, replace

import numpy as np
import pytest
import shapely

from minesurveys.frames import Heights
from pipeline.errors import ArtifactError
from pipeline.store.mine_survey import MineModel, MineSurvey, open_survey, survey_arrays, survey_files, survey_of_arrays
from pipeline.types import ClosedMesh, DrawnFloors, DrawnPlan, FloorMesh, SurveyedLegs, Workings, text_array
from tests.mines import TEE, frame_for, survey_of

LEGS = SurveyedLegs(
    np.arange(6.0).reshape(2, 3), np.ones((2, 4)), np.array([0, 2], np.int32), text_array(["a", "b"]), 5.0, 100.0
)
FACES = np.array([[0, 1, 2]], np.int32)
SOLID = ClosedMesh(np.eye(3), FACES, 7.0, np.ones((4, 3)), np.full((4, 3), 9, np.uint8))
FLOORS = FloorMesh(np.eye(3), FACES, 7.0)
PICTURE, SEEN = np.full((3, 4, 3), 200, np.uint8), Workings(shapely.MultiPolygon([TEE]))
SURVEY = survey_of(frame_for(TEE), (1.0, 2.0))
OF = {
    "a picture": (DrawnPlan(), None, {"plan.png", "survey.json"}),
    "a drawing": (DrawnPlan(), SEEN, {"plan.png", "survey.json", "workings.geojson"}),
    "lines": (DrawnPlan(LEGS), SEEN, {"plan.png", "survey.json", "workings.geojson", "drawn_from.npz"}),
    "legs": (LEGS, SEEN, {"plan.png", "survey.json", "workings.geojson", "legs.npz"}),
    "a solid": (SOLID, SEEN, {"plan.png", "survey.json", "workings.geojson", "solid.npz"}),
    "floors": (DrawnFloors(FLOORS), SEEN, {"plan.png", "survey.json", "workings.geojson", "floors.npz"}),
    "shafts": (
        DrawnFloors(FLOORS, LEGS),
        SEEN,
        {"plan.png", "survey.json", "workings.geojson", "floors.npz", "shafts.npz"},
    ),
}


def require_same(one, other):
    """Refuse records that differ in a field; arrays may have no `==`."""
    assert type(one) is type(other)
    for field in fields(one) if hasattr(one, "__dataclass_fields__") else ():
        left, right = getattr(one, field.name), getattr(other, field.name)
        if isinstance(left, np.ndarray):
            assert left.dtype == right.dtype
            np.testing.assert_array_equal(left, right)
        elif field.name == "polygons":
            assert left.equals(right)
        elif hasattr(left, "__dataclass_fields__"):
            require_same(left, right)
        else:
            assert left == right, field.name


@pytest.mark.parametrize("of", OF)
def test_a_survey_is_read_as_it_was_written_and_has_no_file_of_what_it_has_not(of, tmp_path):
    shape, seen, names = OF[of]
    mine = MineSurvey(SURVEY, PICTURE, shape, seen)
    files = survey_files(mine)
    assert set(files) == names
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    require_same(open_survey(tmp_path), mine)
    values, arrays = survey_arrays(mine)
    handed_on = {key: np.ascontiguousarray(array) for key, array in arrays.items()}  # as between processes
    require_same(survey_of_arrays(values, handed_on), mine)


def test_a_plan_without_heights_is_level_and_all_else_is_a_volume():
    models = {of: MineSurvey(SURVEY, PICTURE, shape, seen).model for of, (shape, seen, _) in OF.items()}
    assert {of for of, model in models.items() if model is MineModel.LEVEL} == {"a picture", "a drawing", "lines"}
    with_heights = replace(SURVEY, heights=Heights(grade=0.1))
    assert MineSurvey(with_heights, PICTURE, DrawnPlan()).model is MineModel.VOLUME


@pytest.mark.parametrize(
    ("added", "message"),
    [
        ({"notes.txt": b""}, r"notes\.txt: no file of a survey"),
        ({"solid.npz": survey_files(MineSurvey(SURVEY, PICTURE, SOLID, SEEN))["solid.npz"]}, "not the files of one"),
    ],
)
def test_a_folder_with_more_than_one_shape_or_another_file_is_refused(added, message, tmp_path):
    for name, data in (survey_files(MineSurvey(SURVEY, PICTURE, LEGS, SEEN)) | added).items():
        (tmp_path / name).write_bytes(data)
    with pytest.raises(ArtifactError, match=message):
        open_survey(tmp_path)


@pytest.mark.parametrize("name", ["survey.json", "plan.png", "workings.geojson"])
def test_a_missing_file_is_named(name, tmp_path):
    for other, data in survey_files(MineSurvey(SURVEY, PICTURE, LEGS, SEEN)).items():
        if other != name:
            (tmp_path / other).write_bytes(data)
    with pytest.raises(ArtifactError, match=r"survey\.json: missing" if name == "survey.json" else "not the files of"):
        open_survey(tmp_path)
