import mujoco
import numpy as np
import pytest
import shapely

from minexplore.bundle import GeomGroup
from pipeline.errors import LimitError
from pipeline.geometry.rasterize import fill_polygon
from pipeline.metrics.iou import intersection_over_union
from pipeline.metrics.limits import breaches, require_limits
from pipeline.metrics.navigability import cast_columns
from pipeline.metrics.topology import compare_topology
from pipeline.mjcf.bundle import open_bundle
from pipeline.params.validation import Limit
from tests.mines import RING, TEE, BuiltMine, frame_for


def test_iou_of_overlapping_squares_is_exact():
    one, two = np.zeros((10, 10), dtype=bool), np.zeros((10, 10), dtype=bool)
    one[:4, :4] = two[2:6, 2:6] = True
    assert intersection_over_union(one, two) == 4 / 28
    assert intersection_over_union(one, one) == 1
    assert intersection_over_union(one & two, np.zeros_like(one)) == 0
    assert intersection_over_union(np.zeros_like(one), np.zeros_like(one)) == 1


def columns_of(built: BuiltMine, model: mujoco.MjModel, free=None):
    record = open_bundle(built.bundle).record
    return cast_columns(
        model,
        np.array(record.T_world_mine),
        built.cleaned if free is None else free,
        built.frame,
        3.5,
        0.2,
        GeomGroup.FLOOR,
        GeomGroup.COLLISION,
    )


def test_every_column_of_a_faithful_world_is_open(tee: BuiltMine):
    found = columns_of(tee, open_bundle(tee.bundle).model)
    assert found.columns == tee.cleaned.sum()
    assert found.blocked == 0
    assert found.blocked_at_wall <= 4


def test_few_rays_look_at_every_geom(tee: BuiltMine, monkeypatch):
    asked, mj_ray = [], mujoco.mj_ray
    monkeypatch.setattr(mujoco, "mj_ray", lambda *ray: asked.append(1) or mj_ray(*ray))
    assert 20 * len(asked) < columns_of(tee, open_bundle(tee.bundle).model).columns
    assert asked


def test_a_boulder_in_a_drift_is_counted_and_located(tee: BuiltMine):
    spec = mujoco.MjSpec.from_file(str(tee.bundle / "mine.xml"))
    spec.body("mine").add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.5, 0.5, 0.5], pos=[20, 2.5, 0.5], group=3)
    found = columns_of(tee, spec.compile())
    assert found.blocked == 8 * 8  # one square metre at 8 px/m
    deep = found.blocked_places_m[found.blocked_depths_m > found.wall_band_m]
    assert deep.mean(axis=0) == pytest.approx([20, 2.5], abs=0.01)
    assert found.deepest_blocked_m == pytest.approx(2.5, abs=0.2)


def test_a_hole_in_the_floor_blocks_its_columns(tee: BuiltMine):
    spec = mujoco.MjSpec.from_file(str(tee.bundle / "mine.xml"))
    spec.delete(spec.geom("floor_mud"))
    assert columns_of(tee, spec.compile()).blocked > 1000


def test_rock_that_the_plan_calls_free_is_blocked(tee: BuiltMine):
    free = tee.cleaned.copy()
    free[:10, :10] = True  # a corner of the plan, all rock
    found = columns_of(tee, open_bundle(tee.bundle).model, free)
    assert found.blocked + found.blocked_at_wall == pytest.approx(100, abs=4)
    assert found.blocked > 30


BOX, PLANE, SPHERE = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_SPHERE
ROCK, FLOOR = int(GeomGroup.COLLISION), int(GeomGroup.FLOOR)
COVER = {"type": BOX, "size": [60, 30, 0.1], "pos": [30, 10, -0.1], "group": FLOOR}
ADDED = {
    "as built": [],
    "a turned and tilted block": [{"type": BOX, "size": [1, 0.4, 0.7], "pos": [20, 2.5, 0.5], "euler": [20, 35, 50]}],
    "a ball, and a plane of bounds": [
        {"type": SPHERE, "size": [0.7, 0, 0], "pos": [12, 2.5, 0.4]},
        {"type": PLANE, "size": [2, 1, 1], "pos": [30, 2.5, 1.0]},
    ],
    "an endless plane over the floor": [{"type": PLANE, "size": [0, 0, 1], "pos": [0, 0, 0.5]}],
    "rock without colour": [{"type": BOX, "size": [1, 1, 1], "pos": [20, 2.5, 0.5], "rgba": [0, 0, 0, 0]}],
    "floor without colour": [COVER | {"rgba": [1, 1, 1, 0]}],
    "floor under rays that start within it": [COVER | {"size": [60, 30, 5]}],
    "floor over rays": [COVER | {"pos": [30, 10, 8]}],
    "tilted floor": [COVER | {"euler": [0, 3, 0]}],
    "a group below the first, read as the first": [{"type": BOX, "size": [1] * 3, "pos": [20, 2.5, 0.5], "group": -1}],
}


@pytest.mark.parametrize("is_bare", [False, True], ids=["with floor", "without a zone"])
@pytest.mark.parametrize("added", ADDED.values(), ids=ADDED)
def test_columns_are_those_of_a_ray_at_every_geom(tee: BuiltMine, added, is_bare):
    spec = mujoco.MjSpec.from_file(str(tee.bundle / "mine.xml"))
    if is_bare:
        spec.delete(spec.geom("floor_mud"))
    for geom in added:
        spec.body("mine").add_geom(**{"group": ROCK} | geom)
    model, free = spec.compile(), np.random.default_rng(0).random(tee.cleaned.shape) < 0.1  # in the rock as well
    found = columns_of(tee, model, free)
    places, is_open = tee.frame.to_mine(np.argwhere(free)[:, ::-1] + 0.5), []
    T, hit, data = np.array(open_bundle(tee.bundle).record.T_world_mine), np.zeros(1, np.int32), mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    groups = np.isin(np.arange(mujoco.mjNGROUP), (FLOOR, ROCK)).astype(np.uint8)
    for x, y in places:
        for aside in (0.0, 0.001):
            start = T @ [x + aside, y, 3.7, 1]
            if mujoco.mj_ray(model, data, start[:3], -T[:3, 2].copy(), groups, 1, -1, hit) >= 0:
                break
        is_open.append(hit[0] >= 0 and model.geom_group[hit[0]] == FLOOR)
    np.testing.assert_array_equal(found.blocked_places_m, places[~np.array(is_open)])
    assert 0 < found.blocked + found.blocked_at_wall < found.columns or is_bare or added


def masks(plan, world):
    frame = frame_for(plan)
    return fill_polygon(plan, frame), fill_polygon(world, frame), frame


def test_equal_networks_match_and_a_blocked_ring_has_no_loop():
    same = compare_topology(*masks(RING, RING), 0.25, 2.0)
    assert (same.loops_plan, same.loops_world, same.loops_difference) == (1, 1, 0)
    cut = RING.difference(shapely.box(25, -1, 26, 7))
    found = compare_topology(*masks(RING, cut), 0.25, 2.0)
    assert (found.loops_plan, found.loops_world, found.loops_difference) == (1, 0, 1)


def test_a_pillar_whose_area_is_at_the_limit_of_specks_makes_the_same_loop_in_both():
    hall = shapely.box(0, 0, 20, 12)
    plan, world = (hall.difference(shapely.box(9, 6, 9 + side, 6 + side)) for side in (0.52, 0.48))
    found = compare_topology(*masks(plan, world), 0.1, 2.0)
    assert found.loops_plan == found.loops_world


@pytest.mark.parametrize(("apart_m", "loops"), [(0.0, 0), (0.5, 1)])
def test_rock_whose_pixels_touch_by_a_corner_is_no_island_and_rock_beside_a_passage_is_one(apart_m, loops):
    hall, wall = shapely.box(0, 0, 20, 12), shapely.box(9, 0, 10, 6)
    pillar = shapely.box(10 + apart_m, 6 + apart_m, 11 + apart_m, 7 + apart_m)
    plan = hall.difference(shapely.union_all([wall, pillar]))
    joined = shapely.box(9.5, 5.5, 11.0, 7.0)
    found = compare_topology(*masks(plan, plan.difference(joined)), 0.1, 2.0)
    assert (found.loops_plan, found.loops_world, found.loops_difference) == (loops, 0, loops)


def test_a_pillar_with_a_pixel_at_its_corner_is_an_island():
    hall, pillar = shapely.box(0, 0, 20, 12), shapely.box(9, 5, 11, 7)
    plan, world, frame = masks(hall.difference(pillar), hall)
    row, col = np.nonzero(~plan[1:-1, 1:-1] & (fill_polygon(hall, frame)[1:-1, 1:-1]))
    plan[row.min(), col.max() + 2] = False  # touches the pillar by a corner
    found = compare_topology(plan, world, frame, 0.1, 2.0)
    assert (found.loops_plan, found.loops_world, found.loops_difference) == (1, 0, 1)


def test_a_pixel_at_the_corner_of_a_pillar_is_no_second_island_where_the_world_has_it_in_the_pillar():
    hall, pillar = shapely.box(0, 0, 20, 12), shapely.box(9, 5, 11, 7)
    plan, world, frame = masks(*[hall.difference(pillar)] * 2)
    row, col = np.nonzero(~plan[1:-1, 1:-1] & (fill_polygon(hall, frame)[1:-1, 1:-1]))
    row, col = row.min(), col.max() + 2
    plan[row, col] = world[row : row + 2, col] = False  # in the world a second pixel joins it to the pillar
    found = compare_topology(plan, world, frame, 0.1, 2.0)
    assert (found.loops_plan, found.loops_world, found.loops_difference) == (1, 1, 0)


def test_a_lost_drift_and_an_added_drift_are_counted_separately():
    straight = shapely.box(0, 0, 80, 5)
    lost = compare_topology(*masks(TEE, straight), 0.25, 2.0)
    assert (lost.drifts_lost, lost.drifts_added) == (1, 0)
    added = compare_topology(*masks(TEE, shapely.union_all([TEE, shapely.box(10, 5, 14, 20)])), 0.25, 2.0)
    assert (added.drifts_lost, added.drifts_added) == (0, 1)


DRIFT = shapely.box(0, -2, 50, 2)
CHAMBER = shapely.Point(60, 0).buffer(12)


def test_a_skeleton_may_end_at_either_side_of_a_wide_chamber():
    chamber = shapely.union_all([DRIFT, CHAMBER])
    ends = [shapely.box(58, 8, 62, 15), shapely.box(69, -4, 75, 0)]  # niches, 15 m apart, draw the skeleton's end
    found = compare_topology(*masks(*(shapely.union_all([chamber, end]) for end in ends)), 0.25, 5.0)
    assert (found.drifts_lost, found.drifts_added) == (0, 0)


def test_a_drift_that_leaves_a_chamber_is_missed():
    north, south = shapely.box(58, 8, 62, 40), shapely.box(58, -40, 62, -8)
    mines = [shapely.union_all([DRIFT, CHAMBER, *drifts]) for drifts in ([north], [south], [north, south])]
    frame = frame_for(mines[2])
    one, two, both = (fill_polygon(mine, frame) for mine in mines)
    for plan, world, counts in ((both, one, (1, 0)), (one, both, (0, 1)), (one, two, (1, 1))):
        found = compare_topology(plan, world, frame, 0.25, 2.0)
        assert (found.drifts_lost, found.drifts_added) == counts


def test_disconnected_workings_are_counted_as_components():
    cut = TEE.difference(shapely.box(20, -1, 22, 6))
    found = compare_topology(*masks(TEE, cut), 0.25, 2.0)
    assert (found.components_plan, found.components_world) == (1, 2)


LIMITS = {"iou.a": Limit(min=0.99), "blocked": Limit(max=0)}


def test_metrics_within_limits_pass_and_breaches_name_metric_value_and_limit():
    require_limits({"iou": {"a": 0.99}, "blocked": 0}, LIMITS)
    with pytest.raises(LimitError, match=r"iou\.a = 0\.98: limit >= 0\.99"):
        require_limits({"iou": {"a": 0.98}, "blocked": 0}, LIMITS)
    assert breaches({"iou": {"a": float("nan")}, "blocked": 3}, LIMITS) == [
        "iou.a = nan: limit >= 0.99",
        "blocked = 3: limit <= 0",
    ]
    assert breaches({"blocked": 0}, LIMITS) == ["iou.a: not measured (limit >= 0.99)"]


def test_a_breach_names_the_place_of_its_figure_if_that_is_known():
    limits = {"floor.step_mm": Limit(max=10), "floor.error_mm": Limit(max=10)}
    found = breaches({"floor": {"step_mm": 12.0, "step_at": "1 to 2 at (3.00, 4.00, 5.00) m", "error_mm": 11}}, limits)
    assert found == [
        "floor.step_mm = 12: limit <= 10, 1 to 2 at (3.00, 4.00, 5.00) m",
        "floor.error_mm = 11: limit <= 10",
    ]
