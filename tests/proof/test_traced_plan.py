"""A plan that is traced and has heights: stage 6 compares its record with the plan's pixels."""

import dataclasses
import json

import pytest
import shapely

from minexplore.bundle import RECORD
from pipeline.errors import ArtifactError
from pipeline.metrics.limits import flatten
from pipeline.proof.drawn_areas import require_drawn_areas
from pipeline.proof.groups import applying_limits
from stages.validation import validate_world
from tests.volume_worlds import CONFIG, VolumeWorld, survey_of_areas

BEND = shapely.Point(0, 0).buffer(12).difference(shapely.Point(0, 0).buffer(8)).difference(shapely.box(0, -20, 20, 0))
APART = shapely.box(20, 20, 24, 24)  # 16 m2 that nothing joins to the bend


@pytest.fixture(scope="module")
def graded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("graded")
    path = folder / "bend.geojson"
    features = [{"type": "Feature", "properties": {}, "geometry": shapely.geometry.mapping(a)} for a in (BEND, APART)]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return VolumeWorld(survey_of_areas(path, grade=0.02, unit="m"), folder)


def test_a_traced_plan_with_a_grade_is_built_and_its_certificate_holds(graded):
    plan = graded.traced["free_space"].areas
    assert plan.unconnected_m2 == pytest.approx(16, abs=1)
    assert plan.traced_tunnel_m2 != plan.tunnel_m2
    traced = {name: graded.traced[name] for name in ("cleaned", "raw")}
    params = CONFIG.validation.model_copy(update={"extent": "full"})
    found = validate_world(params, graded.mine, world=graded.bundle, traced=graded.folder / "traced", **traced)
    assert found["certificate"].holds
    assert found["metrics"]["iou"]["free_space_vs_cleaned"] > 0.98
    assert {name for name in applying_limits(params, flatten(found["metrics"])) if name.startswith("iou.")}


@pytest.mark.parametrize(("field", "by"), [("traced_tunnel_m2", 40.0), ("unconnected_m2", 0.1)])
def test_areas_that_the_plan_has_not_are_refused(graded, field, by):
    plan, masks = graded.traced["free_space"], (graded.traced["cleaned"], graded.traced["raw"])
    changed = dataclasses.replace(plan.areas, **{field: getattr(plan.areas, field) + by})
    with pytest.raises(ArtifactError, match=rf"world\.json: areas: .*{field} = "):
        require_drawn_areas(graded.bundle / RECORD, changed, plan.polygon.length, plan.frame, *masks)
