"""Bundles of volumes whose survey nobody has are certified against the legs that they state."""

import dataclasses
import json
import shutil

import pytest

from minexplore.bundle import PARTS
from minexplore.floors.volume_arrays import Parts
from pipeline.commands.proofs import certify
from pipeline.errors import ArtifactError, LimitError
from pipeline.store.codecs import decode, encode
from pipeline.volume.world.bundle import bundle_volume
from pipeline.volume.world.parts import collect_labelled
from pipeline.volume.world.proof.alone import certify_alone, stated_legs
from pipeline.volume.world.proof.derived_content import require_remade
from tests.solved import needs_cavern
from tests.volume_worlds import CONFIG, HEADER, RAMP, VolumeWorld, proof

BEND = RAMP.replace("-6", "-3") + "B,3,60,0,-3,1.5,2,3,0\nB,4,60,20,-3,1.5,2,3,0\n"
SPLAYS = ((0, 2), (180, 2), (40, 3.1), (140, 3.1), (220, 3.1), (320, 3.1), (15, 3.1), (165, 3.1))  # turn, deg; m


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    return VolumeWorld(BEND, tmp_path_factory.mktemp("bend"))


@pytest.mark.slow
def test_the_command_certifies_a_bundle_alone_with_its_legs_as_the_survey(world, tmp_path, capsys):
    certify(world.bundle, 100, tmp_path / "certificate.json", [])
    found = json.loads(capsys.readouterr().out)
    assert found["holds"] is True
    assert found["contacts"] >= 100
    assert {"survey.share_built", "floor.error_mm", "enclosure.gap_mm", "robots.escapes"} <= set(found["clauses"])
    assert json.loads((tmp_path / "certificate.json").read_text()) == found


@pytest.mark.slow
def test_a_bundle_without_a_part_is_one_error_that_names_the_clause(world, tmp_path):
    compiled = tmp_path / "compiled"
    shutil.copytree(world.compiled, compiled)
    whole = decode(compiled / PARTS, Parts)
    kept = range(1, len(whole))
    parts = collect_labelled([whole[k] for k in kept], [int(whole.label[k]) for k in kept])
    (compiled / PARTS).write_bytes(encode(compiled / PARTS, parts))
    bundle = tmp_path / "world"
    bundle.mkdir()
    for name, data in bundle_volume(CONFIG.realism, world.survey, world.traced["free_space"], compiled).items():
        (bundle / name).write_bytes(data)
    with pytest.raises(LimitError, match=r"the certificate does not hold: .*enclosure\.gap_mm"):
        certify(bundle, 1, None, [])


def test_floors_that_are_not_those_of_the_stated_legs_break_their_clause(world):
    opened = world.opened()
    lower = {name: (x, y, z - 0.05) for name, (x, y, z) in opened.legs.stations_m.items()}
    moved = dataclasses.replace(opened, legs=dataclasses.replace(opened.legs, stations_m=lower))
    found = certify_alone(moved, proof())
    assert not found.clauses["floor.error_mm"].holds
    assert not found.holds


def test_the_stated_legs_are_the_chains_of_the_survey(world):
    legs = stated_legs(world.opened().legs)
    assert legs.first.tolist() == world.shape.first.tolist()
    assert legs.positions_m == pytest.approx(world.shape.positions_m)
    assert legs.lrud_m == pytest.approx(world.shape.lrud_m)


def test_four_rows_that_end_at_one_station_are_the_legs_that_the_bundle_states(tmp_path):
    places = {"a": (-20, 0), "b": (0, 0), "c": (20, 1), "d": (0, -20), "e": (1, 20)}
    rows = [
        f"{ends},{name},{places[name][0]},{places[name][1]},0,2,2,3,0\n"
        for ends in ("ab", "db", "bc", "be")
        for name in ends
    ]
    crossing = VolumeWorld(HEADER + "".join(rows), tmp_path).opened()
    require_remade(tmp_path / "world", crossing, proof(), stated_legs(crossing.legs))


@needs_cavern
def test_a_survey_whose_walls_are_those_of_splays_is_remade_from_the_places_that_the_bundle_states(tmp_path):
    shots = "".join(f"{k} {k + 1} 12 90 0\n" for k in range(1, 4))
    splays = "".join(f"{k} .. {length} {turn} 0\n" for k in range(1, 5) for turn, length in SPLAYS)
    plumb = "".join(f"{k} .. 2 0 90\n{k} .. 1 0 -90\n" for k in range(1, 5))
    (tmp_path / "a.svx").write_text(f"*fix 1 0 0 0\n{shots}*flags splay\n{splays}{plumb}")
    opened = VolumeWorld(tmp_path / "a.svx", tmp_path).opened()
    assert set(opened.legs.stations_m) - set(opened.legs.between) == {"1", "2", "3", "4"}
    require_remade(tmp_path / "world", opened, proof(), stated_legs(opened.legs))
    all_surveyed = dataclasses.replace(opened.legs, between=[])
    with pytest.raises(ArtifactError, match=r"beyond the legs seen from above|as the legs have"):
        require_remade(
            tmp_path / "world", dataclasses.replace(opened, legs=all_surveyed), proof(), stated_legs(all_surveyed)
        )
