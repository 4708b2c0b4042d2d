import numpy as np
import pytest
import shapely
from shapely import MultiPolygon, Polygon

from pipeline.geometry.network.skeleton import trace_network
from pipeline.geometry.outline.components import mend
from pipeline.metrics.wall_error import measure_wall_error
from pipeline.store.mine_survey import WORKINGS, MineSurvey
from pipeline.types import DrawnPlan, Workings
from stages.contours import trace_free_space
from tests.composed import compose
from tests.mines import frame_for, survey_of
from tests.project import ROOT

BOW_TIE = shapely.make_valid(Polygon([(0, 0), (20, 20), (20, 0), (0, 20)]))
CORNER = MultiPolygon([shapely.box(0, 0, 20, 10), shapely.box(20, 10, 40, 22)])
CRACK = MultiPolygon([shapely.box(0, 0, 20, 10), shapely.box(20.001, 0, 40, 12)])
SEAM = MultiPolygon([shapely.box(0, 0, 20, 10), shapely.box(20, 0, 40, 12)])


@pytest.mark.parametrize("bridge_m", [0, 0.5])
@pytest.mark.parametrize("workings", [BOW_TIE, CORNER], ids=["bow tie", "corner"])
def test_areas_that_touch_in_a_point_are_two_components(workings, bridge_m):
    mended = mend(workings, bridge_m, 10)
    assert len(mended.geoms) == 2
    assert mended.area == pytest.approx(workings.area, abs=0.5)


@pytest.mark.parametrize("workings", [CRACK, SEAM], ids=["crack", "seam"])
def test_areas_along_a_crack_or_a_common_side_are_one_component(workings):
    assert len(mend(workings, 0.5, 10).geoms) == 1


def test_a_component_without_a_neck_stays_as_it_is():
    tee = shapely.union_all([shapely.box(0, 0, 40, 3), shapely.box(18, 3, 21, 20)])
    assert mend(MultiPolygon([tee]), 0.5, 10).geoms[0].equals(tee)


@pytest.mark.parametrize("bridge_m", [0, 0.5])
@pytest.mark.parametrize("workings", [BOW_TIE, CORNER, CRACK], ids=["bow tie", "corner", "crack"])
def test_what_is_left_out_beside_the_workings_is_no_error_of_their_walls(workings, bridge_m, monkeypatch):
    monkeypatch.chdir(ROOT)
    params = compose([f"contours.bridge_m={bridge_m}"]).contours
    frame = frame_for(workings)
    plan = np.full((frame.height_px, frame.width_px), 255, np.uint8)
    mine = MineSurvey(survey_of(frame, (5, 3)), plan, DrawnPlan(), Workings(workings))
    read = trace_free_space(params, mine)
    error = measure_wall_error(
        read["traced"][WORKINGS].polygons.geoms[0], read["free_space"].polygon, read["raw"], frame
    )
    assert error.drawn_mean_m < 0.05  # the limit of conf/validation; bridges fill the wedges of the bow tie


def test_a_drift_that_is_thin_everywhere_stays_as_it_is():
    drift = shapely.box(0, 0, 60, 0.08)
    assert mend(MultiPolygon([drift]), 0.5, 10).geoms[0].equals(drift)


def test_the_tip_of_a_sharp_corner_is_cut_off_and_the_network_is_whole():
    wedge = Polygon([(0, 0), (0, 8), (60, 8.5)])  # thinner than a cell of the skeleton at its end
    (mended,) = mend(MultiPolygon([wedge]), 0.5, 10).geoms
    assert 0 < wedge.area - mended.area < 0.1
    assert trace_network(mended, 0.25, 2.0, 3.0).components == 1


def test_a_rough_wall_keeps_every_notch():
    rng = np.random.default_rng(2)
    x = np.arange(0, 60, 0.3)
    walls = [(xy, rng.normal(0, 0.06)) for xy in x], [(xy, 3 + rng.normal(0, 0.06)) for xy in x[::-1]]
    drift = Polygon([*walls[0], *walls[1]])
    assert np.array_equal(
        shapely.get_coordinates(mend(MultiPolygon([drift]), 0.5, 10)),
        shapely.get_coordinates(shapely.union_all([drift])),
    )
