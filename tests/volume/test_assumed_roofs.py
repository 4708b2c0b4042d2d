"""Roofs that nobody measured, under surveyed floors: they are lowered, or the list says that they are assumed."""

import numpy as np
import pytest

from pipeline.survey.passages.legs import legs_of
from pipeline.volume.floor_error import measure_floor
from pipeline.volume.floors import solve_floors
from pipeline.volume.height_field.assumed_roofs import ROCK_M, lower_assumed_roofs
from pipeline.volume.network import network_of
from pipeline.volume.world.proof.floor import floor_figures
from pipeline.volume.world.topology import mine_network
from tests.volume_worlds import CONFIG, HEADER, VolumeWorld, legs_of_table


def helix(pitch_m, turns=2, up=""):
    """Return the table of a decline of 20 m radius whose roofs are `up` over the floor; empty: not measured."""
    angles = np.arange(16 * turns + 1) * np.pi / 8
    places = np.column_stack([20 * np.cos(angles), 20 * np.sin(angles), 100 - pitch_m * angles / (2 * np.pi)])
    rows = [f"H,s{k},{x:.3f},{y:.3f},{z:.3f},2,2,{up}," for k, (x, y, z) in enumerate(places.tolist())]
    return HEADER + "".join(f"{row}\n" for row in rows)


def crossing(gap_m, up=""):
    """Return the table of two level drifts that cross, one so far under the other; a ramp joins their far ends."""
    over = f"A,1,-30,0,{gap_m},2,2,3,0\nA,2,30,0,{gap_m},2,2,3,0\nA,3,60,30,{gap_m / 2},2,2,3,0\n"
    under = f"B,3,60,30,{gap_m / 2},2,2,{up},\nB,4,30,60,0,2,2,{up},\nB,5,0,50,0,2,2,{up},\nB,6,0,-30,0,2,2,{up},\n"
    return HEADER + over + under


def network_with(text, folder):
    before = network_of(legs_of(legs_of_table(text, folder)), 3.5, 1.0)
    return before, lower_assumed_roofs(before)


def tall_of(network, leg):
    names = [network.leg_name(k) for k in range(len(network.shots))]
    return network.lrud_m[names.index(leg), :, 2:].sum(axis=1)


def test_turns_of_a_helix_of_3_m_keep_all_floors_and_rock_between_them(tmp_path):
    before, lowered = network_with(helix(3.0), tmp_path)
    cut = measure_floor(solve_floors(before), before)
    assert min(one.off_m for one in cut.elsewhere) < -2.5  # what the assumed roofs of 3.5 m cut away
    volume = solve_floors(lowered)
    found = measure_floor(volume, lowered)
    assert found.elsewhere == ()
    assert found.error_m < 0.01
    assert found.over_floor == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("gap_m", [1.5, 2.0, 3.5])
def test_an_assumed_roof_ends_half_a_metre_under_the_floor_over_it(tmp_path, gap_m):
    before, lowered = network_with(crossing(gap_m), tmp_path)
    assert tall_of(before, "5 to 6") == pytest.approx(3.5)
    assert tall_of(lowered, "5 to 6") == pytest.approx(gap_m - ROCK_M)
    assert tall_of(lowered, "1 to 2") == pytest.approx(3)
    assert measure_floor(solve_floors(lowered), lowered).elsewhere == ()


@pytest.mark.parametrize(("gap_m", "up"), [(2.0, "3.5"), (3.6, ""), (1.4, "")])
def test_measured_roofs_and_those_under_rock_or_under_a_floor_too_near_for_robots_stay(tmp_path, gap_m, up):
    before, lowered = network_with(crossing(gap_m, up), tmp_path)
    assert lowered is before


def test_legs_that_meet_lower_no_roof(tmp_path):
    steep = HEADER + "A,1,0,0,0,2,2,,\nA,2,10,0,0,2,2,,\nA,3,13,0,1.05,2,2,,\nA,4,0.5,0.1,3,2,2,,\n"
    before, _ = network_with(steep, tmp_path)
    names = [before.leg_name(k) for k in range(len(before.shots))]
    assert names == ["1 to 2", "2 to 3", "3 to 4"]
    joined = HEADER + "A,1,0,0,0,2,2,,\nA,2,20,0,0,2,2,,\nB,2,20,0,0,2,2,,\nB,3,0,1,4,2,2,,\n"
    before, lowered = network_with(joined, tmp_path)
    assert lowered is before


def test_stage_3_says_how_many_roofs_are_lower_than_assumed_and_where_the_lowest_is(tmp_path, capsys):
    VolumeWorld(crossing(2.0), tmp_path)
    line = next(line for line in capsys.readouterr().err.splitlines() if "without a measured roof" in line)
    assert line == (
        "compile3d: 2 stations without a measured roof have a lower one, as floors pass over them: "
        "1.50 m over the floor at 5, with 0.5 m of rock over it"
    )


@pytest.mark.parametrize(
    ("up", "why"), [("", "1 of them under an assumed roof (up_m, compile3d.height_m)"), ("3.5", "as surveyed")]
)
def test_a_floor_that_an_assumed_roof_cuts_is_listed_with_the_option(tmp_path, capsys, up, why):
    world = VolumeWorld(crossing(1.4, up), tmp_path)
    params = CONFIG.validation.volume
    figures = floor_figures(*mine_network(world.shape, params.height_m, params.volume), world.opened().mine)
    (through,) = (line for line in figures["through"] if line.startswith("1 to 2 through 5 to 6"))
    assert ("whose roof is assumed" in through) == (not up)
    assert f"1 pairs of legs break through each other's floors, {why}: 1 to 2" in capsys.readouterr().err
