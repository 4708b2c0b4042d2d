"""MuJoCo places the parts of a compiled world where its text places them."""

import re

import mujoco
import numpy as np
import pytest
import shapely

from minexplore.bundle import MODEL
from pipeline.mjcf.bundle import open_bundle
from pipeline.mjcf.loading import most_moved_m
from pipeline.proof.certificate import measure_containment
from pipeline.proof.rebuilt.same_model import require_same_model
from tests.composed import compose
from tests.mines import BuiltMine

FOOT_M = 0.3048


@pytest.fixture(scope="module")
def long_drift(tmp_path_factory):
    """Return a straight drift of 600 x 15 ft: the axes of its walls are nearly those of the whole mine."""
    config = compose(["+mine=own", "preset=light", "contours.tolerance_m=0.0"])
    outline = shapely.box(0, 0, 600 * FOOT_M, 15 * FOOT_M)
    return BuiltMine(outline, config, tmp_path_factory.mktemp("long") / "world"), config


def test_the_walls_of_a_long_straight_drift_are_not_turned(long_drift):
    text = (long_drift[0].bundle / MODEL).read_text()
    assert most_moved_m(mujoco.MjModel.from_xml_string(text)) < 1e-9
    without, states = re.subn("<inertial [^>]*/>", "", text)
    assert states == 1
    assert most_moved_m(mujoco.MjModel.from_xml_string(without)) > 5e-5  # so far MuJoCo would move a wall's end


def test_a_world_whose_parts_mujoco_leaves_alone_states_no_inertia(tee):
    text = (tee.bundle / MODEL).read_text()
    assert "inertial" not in text
    assert most_moved_m(open_bundle(tee.bundle).model) < 1e-5


def test_the_certificate_of_a_long_straight_drift_holds_and_its_model_is_the_builders(long_drift):
    mine, config = long_drift
    world, params = open_bundle(mine.bundle), config.validation
    settings = params.certificate.model_copy(update={"contacts": 0})
    found = measure_containment(mine.bundle, world, mine.free_space, settings, (0.25, 2.0))
    assert found["intrusion_mm"] <= params.certificate.limits["intrusion_mm"].max
    require_same_model(mine.bundle, world.record, mine.free_space.polygon, True, params.collision_tile_m)


def test_the_place_of_every_part_is_that_of_its_text(long_drift):
    model = open_bundle(long_drift[0].bundle).model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    turned = np.zeros(9)
    for geom in range(model.ngeom):
        mujoco.mju_quat2Mat(turned, model.geom_quat[geom])
        wanted = data.xmat[model.geom_bodyid[geom]].reshape(3, 3) @ turned.reshape(3, 3)
        assert np.abs(data.geom_xmat[geom].reshape(3, 3) - wanted).max() < 1e-9
