"""Lights of volumes: along whole drifts of many legs, at even distances, and made again by stage 6."""

import re

import numpy as np
import pytest
from shapely import LineString, Point

from minexplore.bundle import MODEL, RECORD
from minexplore.sealed.files import read_folder
from pipeline.errors import ArtifactError
from pipeline.volume.world.bundle import bundle_volume
from pipeline.volume.world.drifts.lamps import lights_of
from pipeline.volume.world.proof.again.remodelled import require_same_model
from pipeline.volume.world.proof.certificate import open_volume
from pipeline.volume.world.topology import LegNetwork
from tests.composed import compose
from tests.mines import sealed
from tests.volume_worlds import CONFIG, HEADER, VolumeWorld, write

LIGHTS = CONFIG.realism.lights
HEIGHTS = compose(["+mine=heights", "preset=light"])
BEND = [(3.0 * k, 0.0) for k in range(21)] + [(60.0, 3.0 * k) for k in range(1, 14)]  # 99 m in legs of 3 m


def row(leg, station, place, up_m=4):
    return f"{leg},{station},{place[0]:g},{place[1]:g},0,2,2,{up_m},0\n"


def short_legs(up_m=4):
    return HEADER + "".join(row("A", f"a{k}", place, up_m) for k, place in enumerate(BEND))


TEE = short_legs() + row("B", "a10", BEND[10]) + row("B", "b1", (30, -12)) + row("B", "b2", (30, -24))


def lit(world, **values):
    return lights_of(LIGHTS.model_copy(update=values), world.decoded("topology.json", LegNetwork))


def along(places, line):
    """Return how far along a line places are, m, each of which is on it."""
    shape = LineString(line)
    assert max(shape.distance(Point(place)) for place in places) < 2e-3
    return np.array([shape.project(Point(place)) for place in places])


@pytest.fixture(scope="module")
def bend(tmp_path_factory):
    return VolumeWorld(short_legs(), tmp_path_factory.mktemp("short"))


@pytest.fixture(scope="module")
def tee(tmp_path_factory):
    """Return a drift with a crosscut, lit along all of its network."""
    built = VolumeWorld(TEE, tmp_path_factory.mktemp("tee"))
    write(built.bundle, bundle_volume(HEIGHTS.realism, built.survey, built.traced["free_space"], built.compiled))
    return built


def test_lights_stand_at_even_distances_through_legs_shorter_than_half_a_distance(bend):
    offset = np.array(bend.decoded("topology.json", LegNetwork).stations_m["a0"])
    lights = lit(bend, along="network")
    assert along([np.array(light.place_m) - offset for light in lights], BEND) == pytest.approx(
        [9.5, 29.5, 49.5, 69.5, 89.5], abs=2e-3
    )
    for light, way in zip(lights, [(1, 0)] * 3 + [(0, 1)] * 2, strict=True):
        assert np.array(light.direction[:2]) / np.linalg.norm(light.direction[:2]) == pytest.approx(way)


def test_lights_hang_as_high_as_stated_or_at_four_fifths_of_a_lower_roof(bend, tmp_path):
    floor_m = bend.decoded("topology.json", LegNetwork).stations_m["a0"][2]
    assert {round(light.place_m[2] - floor_m, 6) for light in lit(bend)} == {3.0}
    low = VolumeWorld(short_legs(up_m=2), tmp_path)
    floor_m = low.decoded("topology.json", LegNetwork).stations_m["a0"][2]
    assert {round(light.place_m[2] - floor_m, 6) for light in lit(low)} == {1.6}


def test_the_network_has_lights_in_every_drift_and_the_main_drift_only_its_own(tee):
    offset = np.array(tee.decoded("topology.json", LegNetwork).stations_m["a0"])
    whole = [np.array(light.place_m) - offset for light in lit(tee, along="network")]
    main = [np.array(light.place_m) - offset for light in lit(tee, along="main_drift")]
    assert along(main, BEND) == pytest.approx([9.5, 29.5, 49.5, 69.5, 89.5], abs=2e-3)
    assert sorted(along([p for p in whole if p[1] > -1], BEND)) == pytest.approx(
        [5, 25, 34.5, 54.5, 74.5, 94.5], abs=2e-3
    )
    assert sorted(p[1] for p in whole if p[1] < -1) == pytest.approx([-22, -2], abs=2e-3)


def test_a_volume_is_lit_along_its_network_and_as_level_mines_where_that_is_stated(tee):
    assert HEIGHTS.realism.lights.along == "network"
    assert open_volume(tee.bundle).record.lights == len(lit(tee, along="network")) == 8


def test_a_shaft_alone_has_no_light_and_a_drift_below_it_has(tmp_path):
    table = HEADER + "S,s1,0,0,30,2,2,1,0\nS,s2,0,0,0,2,2,3,0\n" + row("A", "s2", (0, 0)) + row("A", "a2", (30, 0))
    network = VolumeWorld(table, tmp_path).decoded("topology.json", LegNetwork)
    only = LegNetwork(**{**vars(network), "legs": [leg for leg in network.legs if leg.grade > 1]})
    assert not lights_of(LIGHTS, only)
    assert len(lights_of(LIGHTS, network)) == 2


@pytest.mark.parametrize(
    "values", [{}, {"along": "main_drift"}, {"spacing_m": 7.7777}, {"count": 2}, {"height_m": 9.0}]
)
def test_stage_6_places_the_lights_again_whatever_the_configuration(tee, tmp_path, values):
    lights = HEIGHTS.realism.lights.model_copy(update=values)
    params = HEIGHTS.realism.model_copy(update={"lights": lights})
    write(tmp_path, bundle_volume(params, tee.survey, tee.traced["free_space"], tee.compiled))
    require_same_model(tmp_path, open_volume(tmp_path), 0.0)


LIGHT = re.compile(r'\s*<light name="spot_\d+"[^>]*/>')


def moved(text, number, axis):
    """Return a model whose light of a number is 2 cm off along an axis."""
    light = LIGHT.findall(text)[number]
    place = [float(word) for word in re.search(r' pos="([^"]*)"', light).group(1).split()]
    place[axis] += 0.02
    return text.replace(
        light, re.sub(r' pos="[^"]*"', f' pos="{place[0]:.12g} {place[1]:.12g} {place[2]:.12g}"', light)
    )


@pytest.mark.parametrize("number", [0, 3, 7])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_light_that_was_moved_is_refused(tee, tmp_path, number, axis):
    refused(tee, tmp_path, lambda text: moved(text, number, axis))


def refused(world, folder, change, lights=8):
    files = read_folder(world.bundle)
    record = re.sub(rb'"lights": ?\d+', b'"lights": %d' % lights, files[RECORD])
    changed = change(files[MODEL].decode())
    assert changed != files[MODEL].decode()
    write(folder, sealed({**files, MODEL: changed.encode(), RECORD: record}))
    with pytest.raises(ArtifactError, match=r"mine\.xml"):
        require_same_model(folder, open_volume(folder), 0.0)


@pytest.mark.parametrize("number", [0, 3, 7])
def test_a_light_that_was_taken_away_or_added_is_refused(tee, tmp_path, number):
    light = LIGHT.findall((tee.bundle / MODEL).read_text())[number]
    refused(tee, tmp_path / "fewer", lambda text: text.replace(light, ""), 7)
    refused(tee, tmp_path / "more", lambda text: text.replace(light, light + light.replace("spot_", "spot_9")), 9)
