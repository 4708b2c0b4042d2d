"""Raises: openings in the roof of a drift with walls up to a cap; they take nothing of the floor."""

import json
import re

import mujoco
import numpy as np
import pytest
import shapely

from minexplore.bundle import RECORD, SLAB_M, BundleError, rock_geom
from minexplore.envs.robot_batch import RobotBatch
from minexplore.physics.robot import RobotParams
from minexplore.schema import check_files, hash_files, read_folder
from minexplore.task import TaskParams
from minexplore.world import load_world
from pipeline.geometry.openings.fit import fit_openings
from pipeline.mjcf.bundle import OpenedBundle, open_bundle, placed_parts
from pipeline.mjcf.world import GeomGroup
from pipeline.proof.floor import enclosure_of_floor
from pipeline.survey.passages.sheets import lay_out_sheets
from pipeline.survey.stations.table import read_station_legs
from tests.composed import compose
from tests.folded.test_openings import broken, validator_of
from tests.heights import RAMP, MineWithHeights, levels, table
from tests.mines import sealed

_SLICES_M = (0.05, 0.5, 1.0, 3.45)


LEVEL = [("a", 0, 0, 100), ("q", 10, 0, 100), *RAMP["A"][1:]]  # a ramp far from q


def with_raises():
    """Return three levels: a raise over the highest, one over its shaft's collar, and one from the lowest level."""
    legs = levels()
    legs["U"] = [("m01", 20, 0, 0), ("u1", 20.4, 0.1, 9), ("u2", 20.2, 0.3, 25)]
    legs["V"] = [("m00", 0, 0, 0), ("v1", 0, 0, 12)]
    legs["W"] = [("c21", 20, 20, -12), ("w1", 20.5, 20, -7.5)]
    return legs


@pytest.fixture(scope="module")
def raised(mine_of_legs):
    return mine_of_legs(with_raises(), "preset=light")


@pytest.fixture(scope="module")
def bare(mine_of_legs):
    return mine_of_legs(levels(), "preset=light")


def shafts_of(legs, tmp_path, **values):
    path = tmp_path / "mine.csv"
    path.write_text(table(legs, **values))
    outline, heights = lay_out_sheets(path, read_station_legs(path))
    return outline, heights


def raises_of(heights):
    return {shaft.stations: shaft for shaft in heights.shafts if shaft.sheet is None}


def test_a_raise_follows_the_highest_shots_up_to_an_end_in_no_working(tmp_path):
    _, heights = shafts_of(with_raises(), tmp_path)
    found = {ends: (shaft.below, shaft.top_m, shaft.bottom_m) for ends, shaft in raises_of(heights).items()}
    assert found == {("u2", "m01"): (0, 37.0, 12.0), ("v1", "m00"): (0, 24.0, 12.0), ("w1", "c21"): (2, 4.5, 0.0)}
    assert [shaft.sheet is None for shaft in heights.shafts] == [False, True, True, True]


def test_a_plumb_shot_up_is_a_raise_as_high_as_its_upper_station(tmp_path):
    rows = table({"A": RAMP["A"], "S": [("b", 20, 0, 100), ("s", 20, 0, 130)]}).replace(",130.0000,3.5,0", ",130,0,1.5")
    path = tmp_path / "mine.csv"
    path.write_text(rows)
    _, heights = lay_out_sheets(path, read_station_legs(path))
    (shaft,) = heights.shafts
    assert (shaft.sheet, shaft.below, shaft.top_m, shaft.bottom_m) == (None, 0, 30.0, 0.0)


@pytest.mark.parametrize(
    ("leg", "reason"),
    [
        (
            [("m01", 20, 0, 0), ("u", 30, 0, 5)],
            r"m01 to u at \(20\.0, 0\.0\), which leans by 10\.0 m over 1\.0 m of rock",
        ),
        ([("m01", 20, 0, 0), ("u", 20, 0, 0.9)], r"m01 to u at \(20\.0, 0\.0\), which is 0\.9 m high, want 1 m"),
        ([("m11", 20, 0, -6), ("u", 20, 0, -0.9)], r"m11 to u .* ends less than 1 m below some"),
        ([("m11", 20, 0, -6), ("u", 20, 0.2, 9)], r"m11 to u .* which meets workings between its ends"),
    ],
)
def test_a_raise_that_leans_is_low_or_meets_workings_is_left_out_with_its_place(leg, reason, tmp_path, capsys):
    _, heights = shafts_of({**levels(), "U": leg}, tmp_path)
    assert not raises_of(heights)
    assert "1 shafts are left out, the first " in (said := capsys.readouterr().err)
    assert re.search(reason, said)


@pytest.mark.parametrize(
    ("width", "side"),
    [("1,1", 2.0), ("0.4,0.4", 0.8), ("2.2,2.2", 1.5), (",", 1.5)],
)
def test_a_raise_is_as_wide_as_surveyed_where_that_fits_into_the_roof(width, side, tmp_path):
    rows = table({"A": RAMP["A"], "S": [("b", 20, 0, 100), ("s", 20.1, 0, 130)]})
    path = tmp_path / "mine.csv"
    path.write_text(rows.replace("S,b,20.0000,0.0000,2.2,2.2", f"S,b,20.0000,0.0000,{width}") if width != "," else rows)
    openings, left_out = fit_openings(*lay_out_sheets(path, read_station_legs(path)))
    (opening,) = openings.shafts
    assert not left_out
    outline = shapely.Polygon(opening.outline_m)
    assert outline.area == pytest.approx(side**2)
    assert outline.centroid.coords[0] == pytest.approx((20, 0))


def test_a_raise_at_a_wall_or_the_end_of_a_drift_is_moved_as_little_as_needed(tmp_path):
    drift = [("a", 0, 0, 100), ("b", 20, 0, 100), ("c", 40, 0, 102)]
    rows = table({"A": drift, "S": [("a", 0, 0, 100), ("s", 0, 0.1, 120)]}, half_m=0.9)
    path = tmp_path / "mine.csv"
    path.write_text(rows.replace("A,a,0.0000,0.0000,0.9,0.9", "A,a,0.0000,0.0000,0.2,1.6"))
    outline, heights = lay_out_sheets(path, read_station_legs(path))
    openings, _ = fit_openings(outline, heights)
    (opening,) = openings.shafts
    collar = shapely.Polygon(opening.outline_m)
    assert outline.buffer(-0.1).contains(collar)
    assert collar.distance(shapely.Point(0, 0)) <= 0.25
    assert outline.buffer(-0.1).distance(shapely.Point(0, 0)) < 0.15


def test_a_raise_in_too_narrow_a_drift_or_beside_another_is_left_out_with_its_place(tmp_path):
    up = {"S": [("b", 20, 0, 100), ("s", 20, 0.1, 130)]}
    _, left_out = fit_openings(*shafts_of({"A": RAMP["A"], **up}, tmp_path, half_m=0.55))
    assert "the raise from b to s at (20.0, 0.0) is left out: 1 m wide, it does not fit into the roof" in left_out[0]
    twice = {**up, "T": [("b", 20, 0, 100), ("t", 20.2, 0, 120)]}
    openings, left_out = fit_openings(*shafts_of({"A": RAMP["A"], **twice}, tmp_path))
    assert len(openings.shafts) == len(left_out) == 1
    assert "or is too near to another shaft" in left_out[0]


def test_a_raise_that_ends_in_or_just_over_the_roof_is_left_out_with_its_place(light, tmp_path, capsys):
    mine = MineWithHeights({"A": LEVEL, "S": [LEVEL[1], ("s", 10, 0.1, 104)]}, light, tmp_path)
    assert not mine.openings
    assert "the raise at (10.0, 0.0) is left out: it ends 0.5 m over the roof of its drift, want 1 m" in (
        capsys.readouterr().err
    )
    assert "openings" not in json.loads((mine.bundle / RECORD).read_text())


def test_an_uneven_roof_is_cut_so_that_nothing_hangs_into_the_drift(light, tmp_path):
    """The roof falls from 9 m to 2 m over 3 m on either side of the raise."""
    drift = [("a", 0, 0, 100), ("b", 17, 0, 100), ("c", 20, 0, 100), ("d", 23, 0, 100), ("e", 40, 0, 102)]
    legs = {"A": drift, "S": [("c", 20, 0, 100), ("s", 20, 0.1, 130)]}
    roofs = {"a": 3.5, "b": 3.2, "c": 3.5, "d": 3.2, "e": 3.2, "s": 3.5}
    mine = MineWithHeights(legs, light, tmp_path, roofs)
    assert len(mine.openings) == 1
    assert broken(validator_of(mine, light).certificate) == {}


def test_the_certificate_of_raises_holds_with_all_robots_inside(raised, light):
    validator = validator_of(raised, light, 500)
    assert broken(validator.certificate) == {}
    assert validator.containment["escapes"] == 0
    record = json.loads((raised.bundle / RECORD).read_text())
    assert [(o["sheet"] is None, o["below"]) for o in record["openings"]] == [
        (False, 1),
        (True, 0),
        (True, 0),
        (True, 2),
    ]


def test_raises_leave_the_floor_and_everything_in_plan_as_it_is(raised, bare, light):
    for name in ("floor.npz", "free_space.geojson", "occupancy.npz", "topology.json", "map.png"):
        assert (raised.bundle / name).read_bytes() == (bare.bundle / name).read_bytes()
    one, two = (validator_of(mine, light) for mine in (raised, bare))
    np.testing.assert_array_equal(one.world_free, two.world_free)
    assert one.measure("navigability") == two.measure("navigability")


def test_there_is_no_roof_under_a_raise_and_a_cap_at_its_end(raised):
    model = open_bundle(raised.bundle).model
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    record = json.loads((raised.bundle / RECORD).read_text())
    T = np.array(record["T_world_mine"])
    for opening in record["openings"][1:]:
        offset = raised.floor.offset_m[opening["below"]]
        for corner in np.vstack([opening["outline_m"], np.mean(opening["outline_m"], axis=0)]):
            place = corner + 0.02 * (np.mean(opening["outline_m"], axis=0) - corner) - offset
            start = T[:3, :3] @ [*place, opening["bottom_m"] + 1.2] + T[:3, 3]
            far = mujoco.mj_ray(model, data, start, T[:3, 2].copy(), None, 1, -1, np.zeros(1, np.int32))
            assert far == pytest.approx(opening["top_m"] - opening["bottom_m"] - 1.2, abs=1e-3)


@pytest.mark.parametrize("part", ["cap", "wall"])
def test_the_certificate_misses_a_cap_and_a_wall(part, raised):
    world = open_bundle(raised.bundle)
    last = world.record.collision_parts - 1 - 4  # the fence has four parts, each raise a cap after its walls
    spec = mujoco.MjSpec.from_file(str(raised.bundle / "mine.xml"))
    spec.delete(spec.geom(rock_geom({"cap": last, "wall": last - 1}[part])))
    figures = figures_of(raised, OpenedBundle(world.record, spec.compile(), 0, 0))
    assert figures["missing_m2"] > 0.1


def test_the_certificate_sees_a_roof_left_under_a_raise(raised, bare):
    """The walls are those of the raise, the roof is that without it."""
    world, other = open_bundle(raised.bundle), open_bundle(bare.bundle)
    assert figures_of(raised, world)["intrusion_m2"] < 1e-3
    spec = mujoco.MjSpec.from_file(str(raised.bundle / "mine.xml"))
    mine = spec.body("mine")
    for number, wedge in enumerate(placed_parts(other.model, GeomGroup.ROOF, np.array(other.record.T_world_mine))):
        spec.add_mesh(name=f"whole_{number}", uservert=wedge.ravel().tolist())
        mine.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"whole_{number}", group=GeomGroup.ROOF, contype=0, conaffinity=0
        )
    assert figures_of(raised, OpenedBundle(world.record, spec.compile(), 0, 0))["intrusion_m2"] > 0.5


def figures_of(mine, world):
    parts = placed_parts(world.model, GeomGroup.COLLISION, np.array(world.record.T_world_mine))
    return enclosure_of_floor(world, mine.free_space.polygon, mine.floor, parts, _SLICES_M)


def test_forged_raises_are_refused_with_their_field(raised):
    files = read_folder(raised.bundle)
    record = json.loads(files[RECORD])
    far = [[x + 300.0, y] for x, y in record["openings"][1]["outline_m"]]
    for field, value, said in (
        ("outline_m", far, r"openings\[1\]\.outline_m: a corner that is not over sheet 0"),
        ("below", 1, r"openings\[1\]\.outline_m: a corner that is not over sheet 1"),
        ("below", None, r"openings\[1\]: from sheet None to None"),
        ("below", 7, r"openings\[1\]: from sheet None to 7"),
        ("top_m", 15.0, r"openings\[1\]\.top_m = 15\.0: want more than the roof's 15\.500 m"),
        ("sheet", -1, r"openings\[1\]\.sheet"),
    ):
        changed = [record["openings"][0], {**record["openings"][1], field: value}, *record["openings"][2:]]
        forged = sealed({**files, RECORD: json.dumps({**record, "openings": changed}).encode()})
        with pytest.raises(BundleError, match=said):
            check_files(raised.bundle, forged, hash_files(forged))


def test_nothing_falls_where_there_are_raises_only(tmp_path):
    config = compose(["preset=light", "realism.fence_openings=false"])
    mine = MineWithHeights({"A": LEVEL, "S": [LEVEL[1], ("s", 10.5, 0, 130)]}, config, tmp_path)
    assert len(mine.openings) == 1
    world = load_world(mine.bundle)
    assert len(world.open_shafts) == 0
    batch = RobotBatch(world, TaskParams(), RobotParams(), 1)
    rngs = [np.random.default_rng(0)]
    batch.reset(np.arange(1), rngs)
    batch.place(0, 8.0, 0.0, 0.0)
    for _ in range(60):
        batch.drive(np.array([[1.0, 0.0]]), rngs, np.arange(1))
    assert batch.poses()[0, 0] > 12.0
    assert batch.heights(np.arange(1))[0] == pytest.approx(0.0, abs=0.2)
    batch.close()


def test_a_raise_ends_at_its_surveyed_height_in_the_collision_parts(raised):
    highest = max(float(part[:, 2].max()) for part in raised.parts)
    assert highest == pytest.approx(37.0 + SLAB_M)
