"""Roofs of mines with heights: they follow the survey, up to its limits, and walls and rock follow them."""

import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

from minexplore.bundle import FLOOR, RECORD, BundleError, GeomGroup, decode_msh, mesh_file
from minexplore.floors.floor import Floor
from minexplore.floors.folding import Folding
from minexplore.schema import check_files, hash_files, read_folder
from minexplore.schema.readers.json_text import read_json
from minexplore.sensing.lidar import floor_meshes
from minexplore.world import load_world
from pipeline.errors import GeometryError
from pipeline.geometry.floor.mesh import build_floor
from pipeline.mjcf.bundle import open_bundle, read_record
from pipeline.proof.rebuilt.remake import read_free_space
from pipeline.proof.rebuilt.visible import require_visible, rough_meshes
from pipeline.proof.validator import Validator
from pipeline.report.figures.levels import draw_long_section
from pipeline.store.codecs import decode, encode
from pipeline.survey.passages.sheets import lay_out_sheets
from pipeline.survey.solved.plan_view import plan_legs
from pipeline.survey.stations.table import read_station_legs, read_station_survey
from pipeline.types import Occupancy
from tests.composed import compose
from tests.folded.test_folded_rock import COARSE
from tests.heights import RAMP, UNDER, MineWithHeights, certificate_params, table
from tests.mines import STRAIGHT, sealed
from tests.octomap import FREE, OCCUPIED, BinaryTree

HALL = {"a": 2.5, "b": 2.5, "c": 6.0, "d": 6.0}  # over the ramp, from 20 to 30 m, the roof rises by 5 m
LOW = {"a": 1.5, "b": 1.7, "c": None, "d": 2.0}
OVER = {"a0": 3.0, "a1": 5.0, "a2": 2.2, "a3": 2.2, "b0": 2.5, "b1": 6.5, "b2": 4.0}
ALONG_M = np.array([3.0, 10.0, 17.0, 22.0, 25.0, 28.0, 33.0, 50.0, 57.0])  # along the ramp, away from its ends


def config_of(*overrides):
    return compose(list(overrides))


@pytest.fixture(scope="module")
def rock():
    return config_of(*COARSE)


@pytest.fixture(scope="module")
def hall(mine_of_legs):
    return mine_of_legs(RAMP, "preset=light", roofs=HALL)


@pytest.fixture(scope="module")
def over(mine_of_legs):
    return mine_of_legs(UNDER, "preset=light", roofs=OVER)


def broken(mine, config, contacts=0):
    validator = Validator(certificate_params(config, contacts), mine.bundle, mine.cleaned, mine.raw, mine.survey)
    return {name: clause.value for name, clause in validator.certificate.clauses.items() if not clause.holds}


def surveyed_m(along_m):
    """Return the roof of `HALL` over the floor along the ramp."""
    return np.interp(along_m, [20.0, 30.0], [2.5, 6.0])


def test_the_roof_that_robots_touch_is_as_high_over_the_floor_as_surveyed(hall):
    model = open_bundle(hall.bundle).model
    data, groups = mujoco.MjData(model), np.zeros(mujoco.mjNGROUP, np.uint8)
    mujoco.mj_forward(model, data)
    groups[[GeomGroup.FLOOR, GeomGroup.ROOF]] = 1
    T, geom = np.array(read_record(hall.bundle).T_world_mine), np.zeros(1, np.int32)
    for x in ALONG_M:
        eye = hall.floor.fold(np.array([[x, 0.3, 1.0]]))[0]
        reach = [
            mujoco.mj_ray(model, data, T[:3, :3] @ eye + T[:3, 3], way * T[:3, 2], groups, 1, -1, geom)
            for way in (-1.0, 1.0)
        ]
        assert sum(reach) == pytest.approx(surveyed_m(x), abs=0.01)


@pytest.mark.parametrize("roofs", [HALL, LOW])
def test_the_certificate_of_a_drift_holds_whose_roof_is_high_low_or_unknown(roofs, light, mine_of_legs):
    mine = mine_of_legs(RAMP, "preset=light", roofs=roofs)
    assert broken(mine, light, contacts=100) == {}
    over_m = 3.5 + mine.floor.lifts_m(3.5)
    wanted = [roof for roof in (3.5 if roof is None else roof for roof in roofs.values())]
    np.testing.assert_allclose([over_m.min(), over_m.max()], [min(wanted), max(wanted)], atol=1e-9)
    assert read_record(mine.bundle).heights.roof_m == pytest.approx((min(wanted), max(wanted)))


def test_the_certificate_of_drifts_with_roofs_over_each_other_holds(over, light):
    assert len(over.floor.offset_m) == 2
    assert broken(over, light, contacts=100) == {}


def test_a_roof_that_no_station_knows_has_the_stated_height(mine_of_legs):
    mine = mine_of_legs(RAMP, "preset=light", roofs=LOW)
    np.testing.assert_allclose(mine.floor.raised(3.5).heights_at(np.array([[30.0, 0.0]])), 1.5 + 3.5, atol=0.02)
    np.testing.assert_allclose(mine.floor.raised(3.5).heights_at(np.array([[25.0, 0.0]])), 0.75 + 2.6, atol=0.02)


@pytest.mark.parametrize("roofs", [dict.fromkeys(HALL, 3.5), dict.fromkeys(HALL)])
def test_roofs_at_the_stated_height_or_unknown_ones_change_no_byte(roofs, light, hall, tmp_path):
    mine = MineWithHeights(RAMP, light, tmp_path, roofs)
    hashes = [json.loads((folder / RECORD).read_text())["world_sha256"] for folder in (mine.bundle, hall.bundle)]
    assert hashes[0] == "e7e56cc591c49c1817caf81ab37b9a40f328946b7c82888f7a0ef00b89487792"
    assert hashes[0] != hashes[1]
    assert "roof_m" not in json.loads((mine.bundle / RECORD).read_text())["heights"]
    assert len(decode(mine.bundle / FLOOR, Floor).stretch) == 0


def visible_roof_m(mine):
    """Return how high over the floor the visible roof is along the ramp's middle, m."""
    names = rough_meshes(name[7:-4] for name in read_record(mine.bundle).files if name.startswith("meshes/"))
    meshes = [decode_msh((mine.bundle / mesh_file(name)).read_bytes()) for name in names if name.startswith("roof")]
    roof = trimesh.util.concatenate([trimesh.Trimesh(mesh.vertices, mesh.faces, process=False) for mesh in meshes])
    eyes = mine.floor.fold(np.column_stack([ALONG_M, np.zeros((len(ALONG_M), 2))]))
    hits, rays, _ = roof.ray.intersects_location(eyes, np.tile([0.0, 0.0, 1.0], (len(eyes), 1)), multiple_hits=False)
    assert sorted(rays) == list(range(len(eyes)))
    return hits[np.argsort(rays), 2] - eyes[:, 2]


def test_the_visible_roof_is_as_high_as_surveyed_within_the_relief_of_the_rock(rock, tmp_path, mine_of_legs):
    """The relief is that of the same rock over a roof of 3.5 m, stretched as the roof is."""
    mines = [mine_of_legs(RAMP, *COARSE), MineWithHeights(RAMP, rock, tmp_path, HALL, report=False)]
    level, found = map(visible_roof_m, mines)
    stretch = (surveyed_m(ALONG_M) - 1) / (3.5 - 1)
    np.testing.assert_allclose(found - surveyed_m(ALONG_M), (level - 3.5) * stretch, atol=0.02)
    assert np.abs(level - 3.5).max() < 0.6  # the rock's relief, and the arch
    assert np.ptp(found) > 3.0
    bundle, grid = mines[1].bundle, decode(mines[1].bundle / "occupancy.npz", Occupancy)
    require_visible(bundle, read_record(bundle), read_free_space(bundle).polygon, grid)
    assert broken(mines[1], rock, contacts=100) == {}


@pytest.mark.slow
def test_rock_over_a_low_and_a_very_high_roof_is_one_surface_along_the_walls(rock, tmp_path):
    for name, roofs in (("low", LOW), ("high", {"a": 2.0, "b": 2.0, "c": 30.0, "d": 30.0})):
        (tmp_path / name).mkdir()
        bundle = MineWithHeights(RAMP, rock, tmp_path / name, roofs, report=False).bundle
        grid = decode(bundle / "occupancy.npz", Occupancy)
        require_visible(bundle, read_record(bundle), read_free_space(bundle).polygon, grid)


def test_a_level_floor_leaves_bodies_and_its_roof_as_they_are():
    body, flat = np.array([[1.0, 2, 0], [3, 2, 3.5], [1, 5, 1]]), Floor()
    (found,) = flat.unfold_bodies([body], 1.75)
    np.testing.assert_array_equal(found, body)
    assert flat.raised(3.5).is_flat
    np.testing.assert_array_equal(flat.lifts_at(body[:, :2], 3.5), 0)


def test_what_robots_drive_by_is_not_stretched_and_folding_returns(over):
    rng, folding = np.random.default_rng(1), Folding(over.floor)
    row, col = np.nonzero(load_world(over.bundle).clearance_m > 0.3)
    world = load_world(over.bundle)
    free = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
    places = np.column_stack([free[rng.choice(len(free), 400)], rng.uniform(0.1, 3.4, 400)])
    np.testing.assert_allclose(over.floor.unfold(over.floor.fold(places), 1.75), places, atol=1e-9)
    np.testing.assert_allclose(folding.fold(places), over.floor.fold(places), atol=1e-9)
    low = places[:, 2] <= 1.0
    level = over.floor.heights_at(places[low, :2])
    np.testing.assert_allclose(over.floor.fold(places[low])[:, 2] - level, places[low, 2], atol=1e-12)
    high = places[places[:, 2] > 3.0]
    assert np.ptp(over.floor.fold(high)[:, 2] - over.floor.heights_at(high[:, :2])) > 2.0


def test_a_low_roof_makes_a_drift_under_a_drift_legal_and_a_high_one_refused(light, tmp_path):
    """The floors are 3 m apart: too little for 3.5 m, and for 2.6 m, but not for 2.2 m."""
    legs = {leg: [(n, x, y, 1 + (z - 1) / 3) for n, x, y, z in stations] for leg, stations in UNDER.items()}
    lower = dict.fromkeys(("r2", "r3", "r4", "b0", "b1", "b2"))
    for name, roof_m, rock_m in (("default", None, r"-0\.50"), ("high", 2.6, r"0\.40")):
        (tmp_path / name).mkdir()
        with pytest.raises(GeometryError, match=rf"pillar: workings 3\.00 m above others .* leave {rock_m} m of rock"):
            MineWithHeights(legs, light, tmp_path / name, lower | {key: roof_m for key in lower})
    mine = MineWithHeights(legs, light, tmp_path, dict.fromkeys(lower, 2.2))
    assert len(mine.floor.offset_m) == 2
    assert broken(mine, light) == {}


@pytest.mark.parametrize(("roof_m", "kept"), [(2.2, True), (2.6, False), (None, False)])
def test_a_passage_over_another_is_kept_if_the_surveyed_roof_leaves_rock_between(roof_m, kept, tmp_path, capsys):
    legs = {
        "M": [("a", 0, 0, 0), ("b", 20, 0, 0), ("c", 60, 0, 0)],
        "S": [("b", 20, 0, 0), ("d", 20, 20, 2), ("e", 5, 20, 3), ("f", 5, -15, 3)],
    }
    path = tmp_path / "stations.csv"
    path.write_text(table(legs, roofs={"a": roof_m, "b": roof_m}))
    lay_out_sheets(path, plan_legs(path, read_station_survey(path)), 4.0)
    assert ("are left out" in capsys.readouterr().err) != kept


def test_roofs_beyond_the_limits_are_clamped_to_them_with_a_warning(tmp_path, capsys):
    path = tmp_path / "mine.csv"
    path.write_text(table(RAMP, roofs={"a": 1.2, "b": 0.9, "c": 47.0}))
    _, heights = lay_out_sheets(path, read_station_legs(path))
    told = capsys.readouterr().err
    assert (
        "mine.csv: 2 stations have roofs lower over the floor than 1.5 m; they are clamped to 1.5 m, the first a from "
        in told
    )
    assert (
        "1 stations have roofs higher over the floor than 30 m; they are clamped to 30 m, the first c from 47.00 m"
        in told
    )
    known = np.concatenate(heights.roofs)
    assert (known[:, 0].min(), known[:, 0].max()) == (1.5, 30.0)


@pytest.mark.parametrize(("height_m", "limits"), [(1.2, r"1\.5 to 6\.00"), (8.0, r"1\.5 to 6\.00")])
def test_a_stated_height_from_which_a_roof_cannot_be_made_is_refused_with_its_limits(height_m, limits):
    line = np.array([[0, 2.5, 0, 1.5], [100, 2.5, 5.0, 4.0]])
    with pytest.raises(GeometryError, match=rf"roof: 1\.50 m .* compile3d\.height_m = {height_m:g} must be {limits} m"):
        build_floor(STRAIGHT, [line], 30.0, height_m=height_m)


@pytest.mark.parametrize(
    ("change", "roof_m", "message"),
    [
        (lambda s: s, None, r"heights\.roof_m missing: floor\.npz has a stretch"),
        (lambda s: s[:0], (2.5, 6.0), r"heights\.roof_m = \[2\.5, 6\.0\]: floor\.npz has no stretch"),
        (lambda s: s[:-1], (2.5, 6.0), r"stretch has shape \(\d+,\) for \d+ vertices"),
        (lambda s: s * np.nan, (2.5, 6.0), r"a stretch that is no number from 0\.2 to 11\.6"),
        (lambda s: 0 * s, (2.5, 6.0), r"a stretch that is no number from 0\.2 to 11\.6"),
        (lambda s: s + 20, (2.5, 6.0), r"a stretch that is no number from 0\.2 to 11\.6"),
        (lambda s: s, (2.5, 5.0), r"heights\.roof_m = \[2\.5, 5\.0\]: floor\.npz has \[2\.5, 6\.0\]"),
        (lambda s: s, (2.5, 1e9), r"heights\.roof_m = \[2\.5, 1000000000\.0\]: want a list of 2"),
        (lambda s: np.maximum(s, 0.8), (3.0, 6.0), r"roof_\d{5}.* above the roof of floor\.npz"),
    ],
)
def test_a_roof_that_no_builder_writes_is_one_error(hall, change, roof_m, message):
    floor = replace(hall.floor, stretch=change(hall.floor.stretch))
    files = {**read_folder(hall.bundle), FLOOR: encode(Path(FLOOR), floor)}
    heights = dict(read_json(RECORD, files[RECORD])["heights"])
    del heights["roof_m"]
    files = sealed(files, heights=heights if roof_m is None else {**heights, "roof_m": list(roof_m)})
    with pytest.raises(BundleError, match=message):
        check_files(Path("bundle"), files, hash_files(files))


def test_a_step_of_the_roof_at_a_seam_is_refused(over):
    sheet = np.zeros(len(over.floor.vertices), int)
    sheet[over.floor.faces.ravel()] = np.repeat(over.floor.sheet, 3)
    _, numbers = np.unique(over.floor._joined, return_inverse=True)
    twin = np.flatnonzero((np.bincount(numbers)[numbers] == 2) & (sheet == 1))[0]
    stretch = over.floor.stretch.copy()
    stretch[twin] += 0.01
    files = {**read_folder(over.bundle), FLOOR: encode(Path(FLOOR), replace(over.floor, stretch=stretch))}
    files = sealed(files)
    with pytest.raises(BundleError, match=r"floor\.npz: two stretches at one place of a seam"):
        check_files(Path("bundle"), files, hash_files(files))


def test_octree_beams_and_long_section_end_at_the_roof(hall):
    tree = BinaryTree((hall.bundle / "free_space.bt").read_bytes())
    feet = hall.floor.fold(np.column_stack([ALONG_M, np.zeros((len(ALONG_M), 2))]))
    even = (ALONG_M < 18) | (ALONG_M > 32)  # between, a cell's roof is that of its middle
    for beyond_m, state in ((-0.3, FREE), (0.1, OCCUPIED)):
        above = np.outer(surveyed_m(ALONG_M) + beyond_m, [0.0, 0.0, 1.0])
        assert (tree.query((feet + above)[even]) == state).all()
    meshes = floor_meshes(load_world(hall.bundle))
    np.testing.assert_allclose(meshes["roof 0"][0], hall.floor.raised(3.5).vertices, atol=1e-12)
    axis = draw_long_section(hall.floor, 3.5, 100.0).axes[0]
    assert axis.get_ylim() == pytest.approx((99.0, 100 + 1.5 + 6.0 + 1.0))
