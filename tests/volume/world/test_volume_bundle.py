"""The bundle of a volume world: what its files agree on, where robots start, and messages about bad surveys."""

import dataclasses
import json

import mujoco
import numpy as np
import pytest
import trimesh

from minexplore.bundle import CELLS, MODEL, PARTS, TOPOLOGY, VOLUME
from minexplore.floors.volume_arrays import FacetLabel, FloorSpans, Parts, VolumeFacets
from pipeline.errors import ArtifactError, GeometryError
from pipeline.mjcf.bundle import read_record
from pipeline.volume.world.compile import compile_volume
from pipeline.volume.world.parts import collect_labelled, cut_floors
from pipeline.volume.world.topology import LegNetwork
from tests.volume_worlds import CONFIG, HEADER, RAMP, VolumeWorld, legs_of_table

ADIT = HEADER + "A,1,0,0,900,2,2,3,0\nA,2,30,0,900,2,2,3,0\nA,3,60,0,894,2,2,3,0\n"


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    return VolumeWorld(ADIT, tmp_path_factory.mktemp("adit"))


def test_mujoco_loads_the_model_by_itself_with_a_geom_for_each_part(world):
    model = mujoco.MjModel.from_xml_path(str(world.bundle / MODEL))
    parts = world.decoded(PARTS, Parts)
    names = [model.geom(k).name for k in range(model.ngeom)]
    assert len(names) == len(parts)
    assert sum(name.startswith("floor_") for name in names) == (parts.label == FacetLabel.FLOOR).sum()
    zones = {name.split("_")[1] for name in names if name.startswith("floor_")}
    assert zones == {"dry", "mud", "water"}  # floors are cut where zones meet


def test_the_mine_frame_has_the_surveys_places_and_its_lowest_floor_at_zero(world):
    record = json.loads((world.bundle / "world.json").read_text())
    volume, legs = world.decoded(VOLUME, VolumeFacets), world.decoded(TOPOLOGY, LegNetwork)
    assert record["volume"]["datum_m"] == 894
    assert legs.stations_m["1"] == pytest.approx((0, 0, 6))
    assert volume.vertices[:, 2].min() == pytest.approx(0, abs=1e-6)
    assert legs.dead_ends == ["1", "3"]
    assert [end["station"] for end in record["volume"]["closed_ends"]] == ["1", "3"]


def test_robots_start_at_the_highest_end_or_where_the_user_states(world, tmp_path):
    record = json.loads((world.bundle / "world.json").read_text())
    assert record["spawn"]["anchor_m"][0] < 8
    assert record["spawn"]["anchor_m"][2] == pytest.approx(6, abs=0.01)
    files = compile_volume(CONFIG.compile3d, legs_of_table(ADIT, tmp_path), [55.0, 0.0, 1.0])
    assert json.loads(files["spawn.json"])["anchor_m"][0] == pytest.approx(55, abs=8)


def test_a_start_far_from_all_floors_is_refused_with_file_place_limit_and_option(tmp_path):
    legs = legs_of_table(ADIT, tmp_path)
    with pytest.raises(GeometryError, match=r"a\.csv: survey\.entrance_m = \[500\.0, 0\.0, 895\.0\]: within 15 m"):
        compile_volume(CONFIG.compile3d, legs, [500.0, 0.0, 1.0], "a.csv")


def test_a_mine_that_is_a_crawl_throughout_is_refused_with_what_a_robot_needs(tmp_path):
    legs = legs_of_table(RAMP.replace(",2,2,3,0", ",0.3,0.3,0.5,0"), tmp_path)
    with pytest.raises(GeometryError, match=r"no floor is 0\.5 m from rock with a robot's height over it"):
        compile_volume(CONFIG.compile3d, legs)


STEEP = {
    "a plumb leg": (["A,a,0,0,100,1.5,1.5,,", "A,b,0,0,50,1.5,1.5,,"], "a to b, rises by 90.0 deg"),
    "60 deg": (["A,a,0,0,100,1.5,1.5,,", "A,b,28.868,0,50,1.5,1.5,,"], "a to b, rises by 60.0 deg"),
    "two plumb legs": (
        ["A,a,0,0,100,1.5,1.5,,", "A,b,0,0,50,1.5,1.5,,", "B,b,0,0,50,1.5,1.5,,", "B,c,0,0,20,1.5,1.5,,"],
        "a to b, rises by 90.0 deg",
    ),
    "a zigzag": (
        ["A,a,0,0,100,2,2,,", "A,b,20,0,80,2,2,,", "A,c,40,0,105,2,2,,", "A,d,60,0,80,2,2,,"],
        "a to b, rises by 45.0 deg",
    ),
}


@pytest.mark.parametrize("case", STEEP)
def test_a_mine_of_steep_legs_only_is_refused_with_the_flattest(tmp_path, case):
    rows, flattest = STEEP[case]
    legs = legs_of_table(HEADER + "".join(f"{row}\n" for row in rows), tmp_path)
    with pytest.raises(GeometryError, match=rf"a\.csv: no leg is flat enough .* {flattest}, a floor by at most 20 deg"):
        compile_volume(CONFIG.compile3d, legs, subject="a.csv")


def test_a_steep_mine_with_one_flat_leg_is_built(tmp_path):
    rows = "A,a,0,0,100,1.5,1.5,,\nA,b,0,0,50,1.5,1.5,,\nB,b,0,0,50,1.5,1.5,,\nB,c,20,0,50,1.5,1.5,,\n"
    start = json.loads(compile_volume(CONFIG.compile3d, legs_of_table(HEADER + rows, tmp_path))["spawn.json"])
    assert start["anchor_m"][2] == pytest.approx(0, abs=0.01)


def test_floor_parts_are_cut_at_the_borders_and_halves_without_a_floor_over_them_are_left_out():
    room = trimesh.creation.box(bounds=[[0, 0, 0], [10, 2, 3]])
    none = np.zeros(len(room.faces), np.int32)
    volume = VolumeFacets(np.array(room.vertices), room.faces.astype(np.int32), none, none)
    corners = np.array([[x, y, z] for x in (0.0, 10.0) for y in (0.0, 2.0) for z in (-0.3, 0.0)])
    corners[corners[:, 2] < 0, 0] *= 1.2  # below, the part reaches 2 m beyond the floor
    parts = collect_labelled([corners, corners + 20], [FacetLabel.FLOOR, FacetLabel.WALL])
    cut = cut_floors(parts, [4.0, 7.0, 11.0, 25.0], volume)
    spans = [(cut[k][:, 0].min(), cut[k][:, 0].max()) for k in range(len(cut))]
    spans[2:] = [(low, round(high)) for low, high in spans[2:]]
    assert spans == [(0, 4), (4, 7), (7, 11), (20, 32)]
    assert cut.label.tolist() == [0, 0, 0, 1]


def test_cells_cover_the_floors_area_and_state_their_height(world):
    cells = world.decoded(CELLS, FloorSpans)
    assert len(cells.column) * cells.cell_m**2 == pytest.approx(60 * 4, rel=0.01)
    level = cells.places_m[:, 0] < 29
    assert np.allclose(cells.floor_m[level], 6, atol=0.01)
    assert cells.headroom_m.max() == pytest.approx(3, abs=1e-3)


def test_a_command_that_reads_no_volumes_refuses_one_in_one_line(world):
    with pytest.raises(ArtifactError, match=r"a world of one volume \(minexplore-world/3\), which this"):
        read_record(world.bundle, checked=False)


def test_what_a_survey_lacks_is_listed_by_station_and_built(tmp_path, capsys):
    bad = ADIT.replace("A,3,", "A,2b,30.0001,0,900,2,2,3,0\nA,3,") + "B,3,60,0,894,0,0,3,0\nB,4,60,20,894,0,0,3,0\n"
    compile_volume(CONFIG.compile3d, legs_of_table(bad, tmp_path))
    said = capsys.readouterr().err
    assert "4: its walls are 0.00 m apart, 0.05 m are taken" in said
    assert "2 to 2b: no length, left out" in said


def test_a_survey_whose_legs_have_no_length_is_refused_with_its_file(tmp_path):
    legs = dataclasses.replace(legs_of_table(ADIT, tmp_path), positions_m=np.zeros((3, 3)))
    with pytest.raises(GeometryError, match=r"a\.csv: no leg of 1 has a length"):
        compile_volume(CONFIG.compile3d, legs, subject="a.csv")
