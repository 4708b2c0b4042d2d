"""Shafts become openings: fenced in the floor, with walls down to the level below, and islands in no network."""

import json
import re
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
import shapely

from minexplore.bundle import RECORD, BundleError, is_floor, rock_geom
from minexplore.envs.env import MineEnv
from minexplore.envs.robot_batch import RobotBatch
from minexplore.physics.local_models import LocalModels
from minexplore.physics.robot import RobotParams
from minexplore.schema import check_files, hash_files, read_folder
from minexplore.task import TaskParams
from minexplore.world import load_world
from pipeline.geometry.floor.parts import wall_lines
from pipeline.geometry.openings.fit import fit_openings
from pipeline.mjcf.bundle import OpenedBundle, open_bundle, placed_parts
from pipeline.mjcf.world import GeomGroup
from pipeline.proof.floor import enclosure_of_floor
from pipeline.proof.stress_test import _escaped, _throw
from pipeline.proof.validator import Validator
from pipeline.survey.passages.sheets import lay_out_sheets
from pipeline.survey.stations.table import read_station_legs
from stages.contours import _find_openings
from tests.composed import compose
from tests.heights import HEADER, RAMP, MineWithHeights, certificate_params, levels, table
from tests.mines import sealed

_SLICES_M = (0.05, 0.5, 1.0, 3.45)


def with_shafts() -> dict:
    """Return three levels: a shaft at a dead end, one in a drift, and a blind one 18 m deep from the lowest level."""
    legs = levels()
    legs["T"] = [("m12", 40, 0, -6), ("t1", 40.3, 0.2, -9), ("m22", 40, 0, -12)]
    legs["B"] = [("m20", 0, 0, -12), ("b1", 0.5, 0, -30)]
    return legs


@pytest.fixture(scope="module")
def fenced(mine_of_legs):
    return mine_of_legs(with_shafts(), "preset=light")


@pytest.fixture(scope="module")
def opened(mine_of_legs):
    return mine_of_legs(with_shafts(), "preset=light", "realism.fence_openings=false")


def validator_of(mine, config, contacts=0):
    return Validator(certificate_params(config, contacts), mine.bundle, mine.cleaned, mine.raw, mine.survey)


def broken(certificate):
    return {name: clause.value for name, clause in certificate.clauses.items() if not clause.holds}


def shafts_of(legs, tmp_path):
    path = tmp_path / "mine.csv"
    path.write_text(table(legs))
    return lay_out_sheets(path, read_station_legs(path))


def test_shafts_are_built_unless_the_parameters_say_otherwise(tmp_path):
    workings, heights = shafts_of(with_shafts(), tmp_path)
    survey = SimpleNamespace(heights=heights)
    assert len(_find_openings(compose([]).contours, survey, workings).shafts) == 3
    assert not _find_openings(compose(["contours.openings=false"]).contours, survey, workings).shafts


@pytest.mark.slow
def test_a_surveyed_roof_stays_as_high_in_a_floor_with_openings(light, tmp_path):
    mine = MineWithHeights(with_shafts(), light, tmp_path, {"m00": 5.0, "m01": 5.0, "m10": 3.0})
    assert len(mine.openings) == 3
    collar = np.array(mine.openings[0].outline_m)
    roof = mine.floor.raised(3.5).heights_at(collar) - mine.floor.heights_at(collar)
    np.testing.assert_allclose(roof, 5.0, atol=0.01)
    assert broken(validator_of(mine, light).certificate) == {}


def test_a_floor_is_filled_over_its_openings_and_keeps_its_other_faces(fenced):
    floor, outlines = fenced.floor, [np.array(opening.outline_m) for opening in fenced.openings]
    whole = floor.filled(outlines)
    np.testing.assert_array_equal(whole.faces[: len(floor.faces)], floor.faces)
    middles = np.array([outline.mean(axis=0) for outline in outlines])
    assert not floor.covers(middles).any()
    assert whole.covers(middles).all()
    assert whole.sheet[whole.faces_at(middles)].tolist() == [opening.sheet for opening in fenced.openings]
    assert len(floor.wall_edges()) - len(whole.wall_edges()) == 4 * len(outlines)


def test_shafts_of_a_survey_lead_from_station_to_station_and_to_blind_ends(tmp_path):
    _, heights = shafts_of(with_shafts(), tmp_path)
    found = {shaft.stations: (shaft.sheet, shaft.below, shaft.top_m, shaft.bottom_m) for shaft in heights.shafts}
    assert found == {
        ("m00", "m10"): (0, 1, 12.0, 6.0),
        ("m12", "m22"): (1, 2, 6.0, 0.0),
        ("m20", "b1"): (2, None, 0.0, -18.0),
    }


@pytest.mark.parametrize(
    ("end", "reason"),
    [
        (("b1", 9, 0, -12.5), r"m00 to b1 at \(0\.0, 0\.0\), which meets workings between its ends"),
        (("m20", 0, 0, -12), r"m00 to m20 at \(0\.0, 0\.0\), which meets workings between its ends"),
        (("b1", 0.5, 0, -4), r"m00 to b1 at \(0\.0, 0\.0\), which meets workings between its ends"),
    ],
)
def test_a_shaft_that_leans_or_meets_other_workings_is_left_out_with_its_place(end, reason, tmp_path, capsys):
    legs = levels()
    legs["S"] = [("m00", 0, 0, 0), end]
    if end[0] == "m20":
        legs["S"].insert(1, ("s1", 0.5, 0.5, -6))
    _, heights = shafts_of(legs, tmp_path)
    assert not heights.shafts
    assert re.search(rf"1 shafts are left out, the first {reason}", capsys.readouterr().err)


def test_a_collar_has_the_surveyed_width_if_a_robot_passes_beside_it(tmp_path):
    path = tmp_path / "mine.csv"
    for width, side in ((2.0, 2.0), (3.6, 1.5)):  # 4.4 m of drift
        rows = table(levels()).replace("S,m00,0.0000,0.0000,2.2,2.2", f"S,m00,0.0000,0.0000,{width / 2},{width / 2}")
        assert rows.startswith(HEADER)
        path.write_text(rows)
        outline, heights = lay_out_sheets(path, read_station_legs(path))
        openings, left_out = fit_openings(outline, heights)
        (opening,) = openings.shafts
        assert not left_out
        assert shapely.Polygon(opening.outline_m).area == pytest.approx(side**2)


def test_a_shaft_in_too_narrow_a_drift_is_left_out_with_its_place_but_not_at_its_dead_end(tmp_path):
    path = tmp_path / "mine.csv"
    ramp = [RAMP["A"][0], ("q", 10, 0, 100), *RAMP["A"][1:]]
    for name, x, count in (("q", 10, 0), ("a", 0, 1)):
        path.write_text(table({"A": ramp, "S": [(name, x, 0, 100), ("z", x + 0.2, 0, 90)]}, half_m=0.9))
        outline, heights = lay_out_sheets(path, read_station_legs(path))
        openings, left_out = fit_openings(outline, heights)
        assert len(openings.shafts) == count
        assert len(left_out) == 1 - count
        if left_out:
            assert "the shaft from q to z at (10.0, 0.0) is left out: 1 m wide, it has no 0.9 m of drift" in left_out[0]


def test_the_certificate_of_fenced_openings_holds_and_no_robot_enters_one(fenced, light):
    validator = validator_of(fenced, light, 500)
    assert broken(validator.certificate) == {}
    assert validator.containment["escapes"] == 0
    assert len(fenced.openings) == 3
    record = json.loads((fenced.bundle / RECORD).read_text())
    assert record["fenced"] is True
    assert [opening["below"] for opening in record["openings"]] == [1, 2, None]


def test_the_network_of_drifts_is_that_without_openings(fenced, light, tmp_path):
    bare = {name: leg for name, leg in levels().items() if name != "S"}
    without = MineWithHeights(bare, light, tmp_path)
    assert not without.openings
    assert fenced.network == without.network
    islands = fenced.free_space.areas.islands - without.free_space.areas.islands
    assert islands == 3
    topology = validator_of(fenced, light).measure("topology")
    assert topology["loops_world"] == topology["loops_plan"] == without.network.loops
    assert topology["drifts_lost"] == topology["drifts_added"] == 0


def test_a_robot_stops_at_a_fence_and_its_beams_end_on_it(fenced):
    env = MineEnv(world=fenced.bundle)
    env.reset(seed=1)
    env.robots.place(0, 6.0, 0.0, np.pi)
    ahead = env.robots.true_ranges(np.arange(1))[0, 0]
    assert ahead == pytest.approx(6.0 - 0.75, abs=0.01)
    for _ in range(100):
        info = env.step(np.array([1.0, 0.0]))[4]
    assert info["collisions"] > 0
    x, y, _ = info["pose_m_rad"]
    assert x == pytest.approx(0.75 + env.robot.radius_m, abs=0.05)
    assert abs(y) < 0.2
    assert info["height_m"] == pytest.approx(12.0, abs=0.05)
    env.close()


@pytest.mark.parametrize(("part", "figure"), [("shaft", "missing_m2"), ("fence", "missing_m2"), ("end", "missing_m2")])
def test_the_certificate_misses_a_wall_a_fence_and_a_blind_end(part, figure, fenced):
    world = open_bundle(fenced.bundle)
    last = world.record.collision_parts - 1
    name = rock_geom({"fence": last, "end": last - 12, "shaft": last - 13}[part])  # 3 fences of 4 parts are the last
    spec = mujoco.MjSpec.from_file(str(fenced.bundle / "mine.xml"))
    spec.delete(spec.geom(name))
    less = OpenedBundle(world.record, spec.compile(), 0, 0)
    parts = placed_parts(less.model, GeomGroup.COLLISION, np.array(world.record.T_world_mine))
    figures = enclosure_of_floor(less, fenced.free_space.polygon, fenced.floor, parts, _SLICES_M)
    assert figures[figure] > 0.1
    assert figures["widest_gap_m"] > 1.0 or part == "end"


def test_there_is_roof_over_a_collar_and_none_where_a_shaft_comes_down(fenced):
    model = open_bundle(fenced.bundle).model
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    geom = np.zeros(1, np.int32)
    middle = np.array([0.3, 0.2])
    tops = [(12.0, True), (6.0, False)]  # over the upper level's collar, and at the shaft's foot on the middle level
    T = np.array(json.loads((fenced.bundle / RECORD).read_text())["T_world_mine"])
    for floor_m, is_closed in tops:
        start = T[:3, :3] @ [*middle, floor_m + 1.2] + T[:3, 3]
        far = mujoco.mj_ray(model, data, start, T[:3, 2].copy(), None, 1, -1, geom)
        assert (far == pytest.approx(2.3, abs=0.01)) == is_closed


def test_forged_openings_are_refused_with_their_field(fenced):
    files = read_folder(fenced.bundle)
    record = json.loads(files[RECORD])
    moved = [[x + 1.0, y] for x, y in record["openings"][0]["outline_m"]]
    for field, value, said in (
        ("outline_m", moved, r"openings\[0\]\.outline_m: a corner that is not on the boundary"),
        ("outline_m", record["openings"][0]["outline_m"][::-1], r"openings\[0\]\.outline_m = .*counter-clockwise"),
        ("below", 7, r"openings\[0\]: from sheet 0 to 7"),
        ("bottom_m", 12.5, r"openings\[0\]\.bottom_m = 12\.5: want less than top_m = 12"),
    ):
        changed = {**record, "openings": [{**record["openings"][0], field: value}, *record["openings"][1:]]}
        forged = sealed({**files, RECORD: json.dumps(changed).encode()})
        with pytest.raises(BundleError, match=said):
            check_files(fenced.bundle, forged, hash_files(forged))


def drive_into_the_shaft(world, whole, steps=60):
    """Drive a robot into the shaft of the upper level at full speed; return its heights and the last info."""
    env = MineEnv(world=world, whole=whole)
    env.reset(seed=1)
    env.robots.place(0, 3.0, 0.1, np.pi)
    heights = []
    for _ in range(steps):
        info = env.step(np.array([1.0, 0.0]))[4]
        heights.append(info["height_m"])
    place = env.robots.plan_places(np.arange(1))[0]
    env.close()
    return np.array(heights), info, place


def test_a_robot_driven_into_an_open_shaft_falls_to_the_level_below_and_stays_there(opened):
    heights, info, place = drive_into_the_shaft(opened.bundle, whole=False)
    assert info["fell"]
    assert heights[0] == pytest.approx(12.0, abs=0.05)
    assert heights[-1] == pytest.approx(6.1, abs=0.15)
    assert np.diff(heights).min() > -0.5  # at 3 m/s, and what gravity adds within a step
    below = shapely.get_parts(opened.free_space.polygon)[1]
    assert below.contains(shapely.Point(place))


def test_a_fall_in_the_model_of_the_rock_nearby_is_that_in_the_model_of_all_rock(opened):
    near, *_ = drive_into_the_shaft(opened.bundle, whole=False, steps=35)
    whole, *_ = drive_into_the_shaft(opened.bundle, whole=True, steps=35)
    np.testing.assert_allclose(near, whole, atol=0.05)


def test_no_plane_or_box_closes_an_open_shaft(opened, fenced):
    for mine, closed in ((opened, False), (fenced, True)):
        models = LocalModels(load_world(mine.bundle), TaskParams(), RobotParams())
        kinds = [
            int(geom.type)
            for opening in mine.openings
            for geom in models.spec(tuple(models.tiles_of(np.mean(opening.outline_m, axis=0)[None])[0].tolist())).geoms
            if is_floor(geom.name)
        ]
        assert kinds
        assert any(kind != mujoco.mjtGeom.mjGEOM_MESH for kind in kinds) == closed


def test_the_certificate_of_open_shafts_holds_and_only_their_fences_differ(opened, fenced, light):
    validator = validator_of(opened, light, 500)
    assert broken(validator.certificate) == {}
    assert validator.containment["escapes"] == 0
    assert validator.containment["deepest_m"] < 0.05
    assert (fenced.bundle / "floor.npz").read_bytes() == (opened.bundle / "floor.npz").read_bytes()
    parts = [open_bundle(mine.bundle).record.collision_parts for mine in (fenced, opened)]
    assert parts[0] - parts[1] == 4 * len(opened.openings)


def test_robots_thrown_into_open_shafts_never_leave_the_workings(opened):
    robots, rng = 32, np.random.default_rng(0)
    batch = RobotBatch(load_world(opened.bundle), TaskParams(), RobotParams(), robots)
    here, free = np.arange(robots), opened.free_space.polygon
    rngs = [np.random.default_rng(k) for k in here]
    solid = wall_lines(free, batch.floor).difference(
        shapely.union_all([shapely.LinearRing(o.outline_m) for o in opened.openings])
    )
    for opening in opened.openings:
        middle, angle = np.mean(opening.outline_m, axis=0), rng.uniform(-np.pi, np.pi, robots)
        start = middle + 1.3 * np.column_stack([np.cos(angle), np.sin(angle)])
        batch.reset(here, rngs)
        _throw(batch, here, start, (middle - start) / 1.3, rng)
        lowest = np.inf
        for _ in range(90):
            batch.drive(np.column_stack([np.ones(robots), rng.uniform(-1, 1, robots)]), rngs, here)
            out, _ = _escaped(batch, here, free, solid, batch.robot.radius_m, 3.5)
            assert not out.any()
            lowest = min(lowest, batch.heights(here).min())
        assert lowest == pytest.approx(opening.bottom_m, abs=0.2)
    batch.close()
