"""The model with its sheets side by side: every floor part lies where its sheet's floor is."""

import numpy as np

from minexplore.bundle import is_floor
from pipeline.mjcf.bundle import model_in_plan, open_bundle, read_floor
from tests.heights import spiral


def test_a_part_whose_box_has_its_middle_on_a_seam_stays_in_its_own_sheet(mine_of_legs):
    mine = mine_of_legs(spiral(3), "preset=light", "+mine=heights")
    world = open_bundle(mine.bundle)
    floor, plan = read_floor(mine.bundle, world.record), model_in_plan(mine.bundle, world)
    names = [geom.name for geom in map(plan.geom, range(plan.ngeom)) if is_floor(geom.name)]
    moved = np.array([plan.geom(name).pos for name in names])
    assert len(names) > 100
    assert floor.covers(moved[:, :2]).all()
