"""Shafts that lean, raises that lean, and stopes: sections that follow a steep leg between two plumb ends."""

import json
import re

import mujoco
import numpy as np
import pytest
import shapely

from minexplore.bundle import COLLAR_CORNERS, RECORD, SLAB_M, BundleError, decode_msh, rock_geom
from minexplore.floors.shaft_axis import aside_at
from minexplore.schema import check_files, hash_files, read_folder
from minexplore.world import load_world
from pipeline.errors import GeometryError, InputError
from pipeline.geometry.floor.mesh import build_floor
from pipeline.geometry.openings.fit import cut_floor, fit_openings
from pipeline.geometry.openings.shaft_parts import count_parts, rows_of, section_at, shaft_parts
from pipeline.metrics.containment import slices_above
from pipeline.mjcf.bundle import OpenedBundle, open_bundle
from pipeline.survey.passages.sheets import lay_out_sheets
from pipeline.survey.stations.table import read_station_legs
from pipeline.types import Openings
from tests.composed import compose
from tests.folded.test_folded_rock import COARSE
from tests.folded.test_openings import broken, validator_of
from tests.folded.test_raises import figures_of
from tests.heights import RAMP, UNDER, MineWithHeights, levels, seam, shelves, spiral, table
from tests.mines import sealed

DRIFT = [("a", 0, 0, 100), ("b", 20, 0, 100), ("c", 40, 0, 100), ("d", 60, 0, 102)]
WINZE = [("a", 0, 0, 100), ("s1", -4, 1, 96), ("s2", -6, 4, 90)]
RAISE = [("b", 20, 0, 100), ("s1", 20, 6, 108), ("s2", 22, 12, 118)]
NARROW_M = 1.4  # left and right together of a leg that is no stope


def lode():
    """Return two drifts on a lode that dips by 43 deg, a ramp between them, and a leg from one to the other."""
    upper = [(f"u{i}", 20.0 * i, 0.0, 0.0) for i in range(4)]
    lower = [(f"l{i}", 20.0 * i, -14.0, -13.0) for i in range(4)]
    ramp = [upper[-1], ("r1", 95, 0, -4.5), ("r2", 108, -7, -6.3), ("r3", 95, -14, -8.4), lower[-1]]
    return {"U": upper, "L": lower, "R": ramp, "S": [upper[1], lower[1]]}


def side_by_side():
    """Return a level drift and three legs up from stations of it that are 2 m apart."""
    up = [("b", 20, 0, 100), ("b2", 22, 0, 100), ("b3", 24, 0, 100)]
    legs = {"A": [DRIFT[0], *up, DRIFT[2], DRIFT[3]]}
    return legs | {f"S{k}": [place, (f"s{k}", place[1], 8.0, 112.0 + k)] for k, place in enumerate(up)}


def narrow(rows, legs="S"):
    """Return a table in which the stations of some legs have walls at 0.7 m."""
    return re.sub(rf"(?m)^([{legs}]\d?,.*),2\.2,2\.2,", r"\1,0.7,0.7,", rows)


def fitted(legs, folder, rows=None):
    path = folder / "mine.csv"
    path.write_text(rows or narrow(table(legs)))
    outline, heights = lay_out_sheets(path, read_station_legs(path))
    openings, left_out = fit_openings(outline, heights)
    return outline, heights, openings.shafts, left_out


def floor_and_parts(outline, heights, shafts):
    openings, lines = Openings(list(shafts)), [np.array(line) for line in heights.lines]
    floor = cut_floor(build_floor(outline, lines, 30.0, heights.offset_m, heights.seams), openings)
    return floor, shaft_parts(openings, floor, 3.5)


@pytest.fixture(scope="module")
def under(mine_of_legs):
    """Return a drift under another, a shaft that leans from the upper to the lower, a winze and a stope over one."""
    legs = {**UNDER, "S": [UNDER["A"][1], UNDER["B"][1]], "W": [("b2", 30, 30, 1), ("w", 30, 36, -5)]}
    legs["V"] = [("a0", 0, 0, 10), ("v", -3, 8, 20)]
    return mine_of_legs(legs, "preset=light")


def test_a_section_is_linear_between_bends_and_plumb_beyond_them():
    bends = [(0, 0, 9.5), (4, 2, 5.5), (4, 8, 1.5)]
    found = aside_at(bends, np.array([12.0, 9.5, 7.5, 5.5, 2.5, 1.5, -3.0]))
    np.testing.assert_allclose(found, [(0, 0), (0, 0), (2, 1), (4, 2), (4, 6.5), (4, 8), (4, 8)])
    assert not aside_at((), np.array([1.0, 2.0])).any()


def test_a_shaft_that_leans_follows_its_leg_between_two_ends_half_a_metre_from_floor_and_roof(tmp_path):
    *_, (shaft,), left_out = fitted(lode(), tmp_path)
    assert not left_out
    assert (shaft.sheet, shaft.below, shaft.top_m, shaft.bottom_m) == (0, 0, 13.0, 0.0)
    assert shaft.bends_m == ((0.0, 0.0, 12.5), (0.0, -14.0, 4.0))  # the roof of the lower drift is at 3.5 m


def test_a_winze_and_a_raise_that_lean_bend_at_their_stations_and_end_blind(tmp_path):
    *_, (winze,), _ = fitted({"A": RAMP["A"], "S": WINZE}, tmp_path)
    assert (winze.sheet, winze.below) == (0, None)
    assert winze.bends_m == ((0.0, 0.0, -0.5), (-4.0, 1.0, -4.0), (-6.0, 4.0, -10.0))
    *_, (blind,), _ = fitted({"A": DRIFT, "S": RAISE}, tmp_path)
    assert (blind.sheet, blind.below, blind.top_m) == (None, 0, 18.0)
    assert blind.bends_m == ((2.0, 12.0, 18.0), (0.0, 6.0, 8.0), (0.0, 0.0, 4.0))


@pytest.mark.parametrize(
    ("leg", "reason"),
    [
        ([DRIFT[1], ("u", 20, 10, 95)], None),
        ([DRIFT[1], ("u", 20, 10, 96)], r"b to u .* leans by 10\.0 m over 3\.5 m of rock, at most 2\.75 of it"),
        ([DRIFT[1], ("u", 20, 6, 104)], r"b to u .* leaves 0\.0 m of rock between its ends"),
        ([DRIFT[1], ("u", 30, 0, 105)], r"b to u .* leans by 10\.0 m over 1\.0 m of rock"),
        ([DRIFT[0], ("u", 20, 0, 91), ("v", 40, 2, 96)], None),
    ],
)
def test_a_leg_too_flat_for_the_rock_between_its_ends_is_left_out_with_its_place(leg, reason, tmp_path, capsys):
    _, heights, *_ = fitted({"A": DRIFT, "S": leg}, tmp_path)
    said = capsys.readouterr().err
    assert bool(heights.shafts) == (reason is None)
    if reason:
        assert re.search(reason, said)


def test_a_shaft_that_leans_into_other_workings_is_left_out_with_its_place(tmp_path, capsys):
    legs = {**UNDER, "S": [("a1", 20, 0, 10), ("s", 40, 0, -2)]}  # through the drift under it
    _, heights, *_ = fitted(legs, tmp_path)
    assert not heights.shafts
    assert "a1 to s at (20.0, 0.0), which meets workings between its ends" in capsys.readouterr().err


def test_a_leg_that_is_surveyed_wide_is_a_stope_as_long_as_that(tmp_path):
    *_, (stope,), _ = fitted(lode(), tmp_path, table(lode()))
    west, south, east, north = shapely.Polygon(stope.outline_m).bounds
    assert (east - west, north - south) == (pytest.approx(4.4), pytest.approx(1.5))


def test_legs_that_leave_a_drift_side_by_side_are_one_stope(tmp_path):
    *_, (stope,), left_out = fitted(side_by_side(), tmp_path)
    assert not left_out
    west, south, east, north = shapely.Polygon(stope.outline_m).bounds
    assert (west, east) == (pytest.approx(20 - NARROW_M / 2), pytest.approx(24 + NARROW_M / 2))
    assert north - south == pytest.approx(NARROW_M)
    assert stope.top_m == 14.0  # as high as the highest of them


def test_a_stope_that_does_not_fit_into_a_bend_is_built_as_a_square_with_a_warning(tmp_path):
    legs = {"A": [("a", 0, 0, 100), ("b", 20, 0, 100), ("c", 38, 6, 100), ("d", 55, 12, 102)]}
    legs["S"] = [("b", 20, 0, 100), ("s", 20, 8, 112)]
    rows = re.sub(r"(?m)^(A,.*),2\.2,2\.2,", r"\1,0.95,0.95,", table(legs))
    rows = re.sub(r"(?m)^(S,.*),2\.2,2\.2,", r"\1,6,6,", rows)
    *_, (shaft,), left_out = fitted(legs, tmp_path, rows)
    assert "the raise from b to s at (20.0, 0.0) is left out: 12.0 m long and 1 m wide, it does not fit" in left_out[0]
    assert shapely.Polygon(shaft.outline_m).area == pytest.approx(1.0)


def test_the_parts_of_a_leaning_shaft_enclose_its_section_at_every_height(tmp_path):
    outline, heights, shafts, _ = fitted(lode(), tmp_path)
    floor, parts = floor_and_parts(outline, heights, shafts)
    assert len(parts) == count_parts(shafts[0]) == 3 * COLLAR_CORNERS
    assert [float(z.max()) for _, z in rows_of(shafts[0], floor, 3.5)] == pytest.approx([13, 12.5, 4, 3.5])
    for height in np.linspace(3.55, 12.95, 41):
        rock = shapely.union_all([cut for part in parts for cut in slices_above(part, np.zeros(3), [float(height)])])
        section = shapely.Polygon(section_at(shafts[0], floor, float(height)))
        assert rock.intersection(section).area < 1e-6
        assert shapely.Polygon(rock.exterior).difference(rock).symmetric_difference(section).area < 1e-5


def test_walls_of_a_leaning_shaft_are_as_thick_as_those_of_a_plumb_one(tmp_path):
    outline, heights, shafts, _ = fitted(lode(), tmp_path)
    _, parts = floor_and_parts(outline, heights, shafts)
    for part in parts[COLLAR_CORNERS : 2 * COLLAR_CORNERS]:  # between the bends: inner corners, then outer ones
        inner, outer = part[:4], part[4:]
        across = np.cross(inner[1] - inner[0], inner[2] - inner[0])
        across /= np.linalg.norm(across)
        assert np.abs((outer - inner[0]) @ across).min() > SLAB_M - 1e-6


def test_the_certificate_of_leaning_shafts_holds_with_all_robots_inside(under, light):
    validator = validator_of(under, light, 500)
    assert broken(validator.certificate) == {}
    assert validator.containment["escapes"] == 0
    record = json.loads((under.bundle / RECORD).read_text())
    assert [(o["sheet"], o["below"], len(o["bends_m"])) for o in record["openings"]] == [
        (None, 0, 2),
        (0, 1, 2),
        (1, None, 2),
    ]


def test_a_stope_from_drift_to_drift_of_one_sheet_holds_its_certificate(light, tmp_path):
    mine = MineWithHeights(lode(), light, tmp_path)
    assert broken(validator_of(mine, light).certificate) == {}
    (opening,) = mine.openings
    assert opening.sheet == opening.below == 0


@pytest.mark.parametrize("number", [2, 5, 8])
def test_the_certificate_misses_a_wall_of_a_leaning_shaft(number, under):
    world = open_bundle(under.bundle)
    fences = 2 * COLLAR_CORNERS
    first = world.record.collision_parts - fences - sum(count_parts(opening) for opening in under.openings)
    spec = mujoco.MjSpec.from_file(str(under.bundle / "mine.xml"))
    spec.delete(spec.geom(rock_geom(first + count_parts(under.openings[0]) + number)))
    assert figures_of(under, OpenedBundle(world.record, spec.compile(), 0, 0))["missing_m2"] > 0.1


def test_shafts_that_lean_keep_their_fences_where_others_have_none(tmp_path):
    config = compose(["preset=light", "realism.fence_openings=false"])
    legs = {"A": DRIFT, "S": [DRIFT[0], ("s", -4, 0, 94)], "T": [DRIFT[1], ("t", 20, 0.1, 90)]}
    mine = MineWithHeights(legs, config, tmp_path)
    leaning, plumb = mine.openings
    assert leaning.bends_m
    assert not plumb.bends_m
    world = load_world(mine.bundle)
    np.testing.assert_allclose(world.open_shafts.outlines_m, [plumb.outline_m])
    assert broken(validator_of(mine, config).certificate) == {}


def test_a_roof_too_high_for_a_leaning_shaft_is_refused_with_its_place(tmp_path):
    config = compose(["preset=light", "compile3d.height_m=6"])
    path = tmp_path / "stations.csv"
    legs = lode()
    with pytest.raises(GeometryError, match=r"shaft at \(20\.0, 0\.0\), which leans, meets a roof 6\.00 m high, want"):
        MineWithHeights(legs, config, tmp_path, {name: None for leg in legs.values() for name, *_ in leg})
    assert path.exists()


def test_forged_bends_are_refused_with_their_field(under):
    files = read_folder(under.bundle)
    record = json.loads(files[RECORD])
    for bends, said in (
        ([[0, 0, 8.5]], r"openings\[1\]\.bends_m = .* 2 to 1000 lists of three numbers"),
        ([[0, 0, 8.5], [1, 0, "4"]], r"openings\[1\]\.bends_m = .* 2 to 1000 lists"),
        ([[0, 0, 4.0], [10, 0, 8.5]], r"openings\[1\]\.bends_m: -4\.5 m from bend to bend, want at least 0\.1 m down"),
        ([[0, 0, 8.5], [30, 0, 4.0]], r"openings\[1\]\.bends_m: leans by 6\.67 of its depth, want at most 2\.8"),
        ([[1, 0, 8.5], [10, 0, 4.0]], r"openings\[1\]\.bends_m: \[1\.0, 0\.0\] beside its outline at its drift"),
        ([[0, 0, 8.5], [10, 0, -4.0]], r"openings\[1\]\.bends_m: from 8\.5 to -4 m, not between 9 and 0 m"),
        ([], r"openings\[1\]\.bends_m"),
    ):
        changed = [*record["openings"][:1], {**record["openings"][1], "bends_m": bends}, *record["openings"][2:]]
        forged = sealed({**files, RECORD: json.dumps({**record, "openings": changed}).encode()})
        with pytest.raises(BundleError, match=said):
            check_files(under.bundle, forged, hash_files(forged))


def test_a_hostile_survey_of_steep_legs_is_built_or_left_out_with_places(light, tmp_path, capsys):
    """Legs to and fro, through each other, into one station, along a drift, without end, and of a stope in a bend."""
    legs = {
        "A": DRIFT,
        "S1": [DRIFT[1], ("x", 26, 3, 106), ("y", 20, 0, 112), ("z", 14, -3, 118)],
        "S2": [DRIFT[2], ("x", 26, 3, 106)],
        "S3": [DRIFT[2], ("v", 41, 0.5, 80), ("w", 60, 0.5, 70), ("q", 61, 40, 55)],
        "S4": [DRIFT[1], ("p", 40.5, 0, 88)],
        "S5": [DRIFT[0], ("o", -900, 0, -300)],
    }
    mine = MineWithHeights(legs, light, tmp_path)
    assert broken(validator_of(mine, light).certificate) == {}
    said = capsys.readouterr().err
    built = len(mine.openings)
    assert built + said.count("is left out") + len(re.findall(r"at \([-\d., ]+\), which", said)) >= 5


def random_legs(seed):
    """Return a mine with up to four ways of steep legs, of 21 to 69 deg, from stations of it, and a half width."""
    rng = np.random.default_rng(seed)
    mines = [UNDER, levels(), shelves(), spiral(2), {k: leg for k, leg in lode().items() if k != "S"}, seam()]
    legs = dict(mines[seed % len(mines)])
    places = list({row[0]: row for leg in legs.values() for row in leg}.values())
    for k in range(rng.integers(1, 5)):
        name, *start = places[rng.integers(len(places))]
        place, heading, up = np.array(start, dtype=float), rng.uniform(0, 2 * np.pi), rng.choice([-1, 1])
        way = [(name, *start)]
        for j in range(rng.integers(1, 4)):
            dip, length = np.radians(rng.uniform(21, 69)), rng.uniform(2, 15)
            heading += rng.normal(0, 0.5)
            level = np.cos(dip) * np.array([np.cos(heading), np.sin(heading)])
            place = place + length * np.array([*level, up * np.sin(dip)])
            way.append((f"x{k}-{j}", *map(float, place)))
        legs[f"X{k}"] = way
    return legs, float(rng.choice([1.2, 2.2, 3.0]))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(60))
def test_steep_legs_in_any_direction_are_built_with_a_certificate_or_left_out(seed, light, tmp_path):
    legs, half_m = random_legs(seed)
    try:
        mine = MineWithHeights(legs, light, tmp_path, half_m=half_m)
    except (InputError, GeometryError) as error:
        said = str(error)
        # A spiral so wide is refused without them too; a steep leg may meet a drift between its stations.
        assert "lie over each other" in said or "without a station" in said
        return
    assert broken(validator_of(mine, light).certificate) == {}


@pytest.mark.slow
def test_the_lining_of_a_leaning_shaft_lies_on_its_walls_and_meets_the_rock_below(tmp_path):
    config = compose(COARSE)
    legs = {**UNDER, "S": [UNDER["A"][1], UNDER["B"][1]], "V": [("a0", 0, 0, 10), ("v", -3, 8, 20)]}
    mine = MineWithHeights(legs, config, tmp_path, report=False)
    files = read_folder(mine.bundle)
    check_files(mine.bundle, files, hash_files(files))
    assert broken(validator_of(mine, config).certificate).keys() <= {"contacts", "escapes", "deepest_m"}
    for number, opening in enumerate(mine.openings):
        vertices = decode_msh(files[f"meshes/shaft_{number:04d}.msh"]).vertices.astype(float)
        upright = shapely.points(vertices[:, :2] - aside_at(opening.bends_m, vertices[:, 2]))
        section = shapely.Polygon(np.array(opening.outline_m) - mine.floor.offset_m[opening.plan_sheet])
        within = 0.3 if opening.sheet is None else 0.0  # the hole of a raise gives way to rock of the walls
        assert shapely.distance(section.exterior, upright).max() < within + 1e-3
        assert set(np.round([z for _, _, z in opening.bends_m], 3)) <= set(vertices[:, 2].round(3))
    low = decode_msh(files["meshes/shaft_0001.msh"]).vertices[:, 2].min()
    assert low == pytest.approx(3.5, abs=0.6)  # the rough roof of the drift below
