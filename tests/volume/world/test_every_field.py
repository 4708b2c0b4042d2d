"""Every field of a volume's bundle is made again, or is a claim that docs/security.md lists."""

import dataclasses
import json
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
import shapely

from benchmarks.faults.judge import CAUGHT, CLAIM, judge_fields, prove_volume
from minexplore.bundle import MESHES, MODEL, RECORD, TOPOLOGY, BundleError, TriangleMesh, decode_msh, encode_msh
from minexplore.floors.volume_arrays import FacetLabel
from minexplore.sealed.files import read_folder
from pipeline.errors import ArtifactError, MineError
from pipeline.mjcf.scene import SpotLight
from pipeline.proof.claims import STATED
from pipeline.proof.rebuilt.lights import remake_lights
from pipeline.proof.rebuilt.same_model import model_difference
from pipeline.store.codecs import encode
from pipeline.store.mine_survey import WORKINGS
from pipeline.volume.world.drifts.lamps import lit_lines
from pipeline.volume.world.proof.again.seen import require_surveyed_plan
from pipeline.volume.world.proof.alone import certify_alone, survey_alone
from pipeline.volume.world.proof.certificate import open_volume
from pipeline.volume.world.proof.derived_content import require_remade
from pipeline.volume.world.topology import LegNetwork, LegRecord
from tests.composed import compose
from tests.mines import require_allowed, sealed
from tests.volume_worlds import HEADER, VolumeWorld, proof, with_rock, write

BENT = HEADER + "A,1,0,0,0,2,2,3,0\nA,2,11,0,0,2,2,3,0\nA,3,22,4,-1,1.5,2,2.5,0\n"


@pytest.fixture(scope="module")
def params():
    return compose(["+mine=heights"]).validation


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """Return the bundle of a bent drift with visible rock and lights."""
    return with_rock(BENT, tmp_path_factory.mktemp("bent")) / "rocky"


@pytest.fixture(scope="module")
def light(tmp_path_factory):
    return VolumeWorld(BENT, tmp_path_factory.mktemp("light")).bundle


@pytest.fixture(scope="module")
def files(seen):
    return read_folder(seen)


def refusal(files, folder: Path, params) -> str:
    """Return the one line with which a sealed bundle is refused."""
    write(folder, sealed(files))
    with pytest.raises(MineError) as caught:
        prove_volume(folder, params)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def with_json(files, name, change):
    content = json.loads(files[name])
    change(content)
    return {**files, name: json.dumps(content).encode()}


def with_text(files, pattern, new, count=0):
    """Return the files with a model in which a pattern is replaced, which must be there."""
    text, times = re.subn(pattern, new, files[MODEL].decode(), count=count)
    assert times
    return {**files, MODEL: text.encode()}


def with_mesh(files, **changes):
    """Return the files with a wall of which arrays are changed."""
    name = min(name for name in files if name.startswith(f"{MESHES}walls"))
    mesh = decode_msh(files[name])
    arrays = {key: np.array(getattr(mesh, key)) for key in ("vertices", "faces", "texcoords", "normals")}
    return {**files, name: encode_msh(TriangleMesh(**{**arrays, **{k: c(arrays[k]) for k, c in changes.items()}}))}


def one(change):
    """Return a change of one row of an array."""

    def changed(array):
        array[len(array) // 2] = change(array[len(array) // 2])
        return array

    return changed


def test_what_the_builder_writes_is_certified(seen, light, params):
    for folder in (seen, light):
        prove_volume(folder, params)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: with_text(f, r'(light name="spot_\d+" type="spot" pos=")(\S+)', r"\g<1>9.5", 1), "even distances"),
        (lambda f: with_text(f, r'(<light [^>]*dir="\S+ \S+ )-', r"\g<1>"), "lights look up by"),
        (lambda f: with_text(f, r'(<light [^>]*cutoff=")45', r"\g<1>9", 1), "cutoff"),
        (lambda f: with_text(f, r'(name="entrance"[^>]*xyaxes=")[^"]*', r"\g<1>1 0 0 0 0 1"), "@xyaxes"),
        (lambda f: with_text(f, r'(name="overview"[^>]*pos=")\S+', r"\g<1>3"), "@pos"),
        (lambda f: with_mesh(f, normals=lambda a: -a), "the normal at"),
        (lambda f: with_mesh(f, normals=one(lambda row: -row)), "the normal at"),
        (lambda f: with_mesh(f, texcoords=lambda a: 0 * a), "the texture"),
        (lambda f: with_mesh(f, texcoords=lambda a: 50 * a), "the texture"),
        (lambda f: with_mesh(f, texcoords=one(lambda row: row + 0.6)), "the texture"),
        (lambda f: with_mesh(f, faces=one(lambda row: row[::-1])), "one is turned over"),
    ],
)
def test_what_is_seen_in_another_way_is_refused(files, tmp_path, params, change, message):
    assert message in refusal(change(files), tmp_path, params)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: r["areas"].update(tunnel_m2=400.0), "areas.tunnel_m2 = 400.0, want"),
        (lambda r: r["areas"].update(islands=3), "areas.islands = 3, want 0"),
        (lambda r: r["areas"].update(unconnected_m2=3.0), "unconnected_m2 = 3.0; want"),
        (lambda r: r["plan_frame"].update(px_per_m=9.0), "plan_frame reaches"),
        (lambda r: r["plan_frame"].update(origin_col=r["plan_frame"]["origin_col"] + 40), "plan_frame reaches"),
        (lambda r: r["spawn"].update(anchor_clearance_m=0.9), "spawn.anchor_clearance_m = 0.9, want"),
        (lambda r: r["spawn"].update(clearance_m=3.0), "no floor is 3 m from rock"),
        (lambda r: r["spawn"].update(centre_m=[500.0, 0.0, 0.0]), "spawn.centre_m[0] = 500.0, want"),
        (lambda r: r["volume"].update(piece_m=15.0, built_m=15.0), "piece_m = 15.0, want"),
    ],
)
def test_a_figure_of_the_record_that_the_legs_do_not_give_is_refused(light, tmp_path, params, change, message):
    assert message in refusal(with_json(read_folder(light), RECORD, change), tmp_path, params)


def test_walls_and_roofs_are_not_exchanged(light, tmp_path, params):
    """Rays of a LiDAR meet the group of walls, and the groups follow from the labels."""
    world = open_volume(light)
    label = np.array([FacetLabel.FLOOR, FacetLabel.ROOF, FacetLabel.WALL], np.int32)[world.mine.label]
    mine = dataclasses.replace(world.mine, label=label)
    changed = {**read_folder(light), "volume.npz": encode(Path("volume.npz"), mine)}
    assert "volume.npz: label[" in refusal(changed, tmp_path, params)


@pytest.mark.parametrize("number", [0, 1])
def test_a_leg_whose_ends_are_exchanged_is_refused(light, tmp_path, params, number):
    def exchange(network):
        leg = network["legs"][number]
        leg["start"], leg["end"] = leg["end"], leg["start"]

    found = refusal(with_json(read_folder(light), TOPOLOGY, exchange), tmp_path, params)
    assert re.search(r"topology\.json: legs\[|plan_frame reaches|lights: not at even", found), found


@pytest.mark.parametrize("x", [1e8, 3e6, 1e24, -5e4, 300.0])
def test_a_station_beyond_the_mesh_is_refused_before_its_leg_is_laid_out(light, x):
    def move(network):
        network["stations_m"]["3"][0] = x

    changed = sealed(with_json(read_folder(light), TOPOLOGY, move))
    with pytest.raises(BundleError, match=r"topology\.json: stations_m\['3'\] = .* at most 10 m beyond the mesh"):
        require_allowed(Path("w"), changed)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda n: n["legs"][0].update(length_m=9e5), r"legs\[0\]\.length_m = 900000\.0: its stations are"),
        (lambda n: n["legs"][0]["lrud_m"][0].__setitem__(2, 1e5), r"legs\[0\]\.lrud_m\[0\]\[2\] = 100000\.0: want"),
        (lambda n: n["legs"][0].update(more=1), r"legs\[0\]\.more = 1: unknown"),
        (lambda n: n.update(total_length_m=1e5), r"total_length_m = 100000\.0: its legs have"),
        (lambda n: n.update(junctions=["nowhere"]), r"junctions: 'nowhere' is none of stations_m"),
        (lambda n: n.update(loops=10**24), r"loops = 1000000000000000000000000: want"),
        (lambda n: n["legs"][0].update(grade=1e300), r"legs\[0\]\.grade = 1e\+300: want"),
    ],
)
def test_a_network_that_no_survey_of_the_mesh_has_is_refused(light, change, message):
    changed = sealed(with_json(read_folder(light), TOPOLOGY, change))
    with pytest.raises(BundleError, match=message):
        require_allowed(Path("w"), changed)


def test_a_mesh_with_more_floor_than_spans_is_refused_before_cells_are_made(light):
    world = open_volume(light)
    names = ("column", "row", "floor_m", "headroom_m", "clearance_m", "aside_m", "way_m")
    cells = dataclasses.replace(world.cells, **{name: getattr(world.cells, name)[:9] for name in names})
    cells = dataclasses.replace(cells, storey=np.zeros(9, np.int32))
    changed = sealed({**read_folder(light), "cells.npz": encode(Path("cells.npz"), cells)})
    with pytest.raises(BundleError, match=r"cells\.npz: cell_m = 0\.25 and 9 spans: the mesh has floors of"):
        require_allowed(Path("w"), changed)


def test_a_network_whose_lists_have_the_order_of_another_file_is_made_again(light, tmp_path, params):
    """Stations have the order of their file, which nobody has who certifies a bundle: Wheal Pell was refused."""

    def turn(network):
        network["dead_ends"].reverse()

    turned = with_json(read_folder(light), TOPOLOGY, turn)
    write(tmp_path, sealed(with_json(turned, RECORD, lambda record: record["volume"]["closed_ends"].reverse())))
    world = open_volume(tmp_path)
    require_remade(tmp_path, world, proof(), survey_alone(world, proof()))


def test_stage_6_compares_the_plan_with_that_of_the_survey(light, tmp_path_factory):
    built = VolumeWorld(BENT, tmp_path_factory.mktemp("plan"))
    record, drawn = open_volume(light).record, built.traced["traced"][WORKINGS].polygons
    require_surveyed_plan(light, record, built.survey.frame, shapely.union_all(drawn))
    moved = dataclasses.replace(built.survey.frame, origin_col=3.25)
    with pytest.raises(ArtifactError, match=r"world\.json: plan_frame = .*, the survey has"):
        require_surveyed_plan(light, record, moved, drawn)


def lit(places):
    """Return lights at places along the x axis, and the network of a level leg of 100 m."""
    network = LegNetwork(
        {"a": (0.0, 0.0, 0.0), "b": (100.0, 0.0, 0.0)},
        [leg_of_100_m()],
        [],
        ["a", "b"],
        [],
        0,
        1,
        100.0,
    )
    way = (np.cos(np.radians(20)), 0.0, -np.sin(np.radians(20)))
    return [SpotLight((x, 0.0, 3.0), way, 45.0) for x in places], network


def again(lights, network):
    return remake_lights(Path(MODEL), lights, [lit_lines(network, "network")], 1e-6, 1e-6)


def leg_of_100_m():
    return LegRecord("0", "a", "b", 100.0, 0.0, [(2.0, 2.0, 4.0, 0.0)] * 2)


@pytest.mark.parametrize("places", [[10, 30, 50, 70, 90], [50], [37.5, 50, 62.5], [0, 25, 50, 75, 100]])
def test_lights_at_even_distances_are_placed_again(places):
    lights, network = lit(places)
    assert len(again(lights, network)) == len(places)


@pytest.mark.parametrize("places", [[10, 30, 51, 70, 90], [49], [10, 30, 50, 70], [10, 30, 50, 70, 90, 95]])
def test_lights_at_other_distances_are_refused(places):
    lights, network = lit(places)
    with pytest.raises(ArtifactError, match="not at even distances"):
        again(lights, network)


def test_the_models_that_are_written_and_made_again_compile_to_the_same_fields(seen):
    """The model follows from its text and the files that this names; a field of MuJoCo that does not fails this."""
    one, other = (mujoco.MjModel.from_xml_path(str(seen / MODEL)) for _ in range(2))
    assert model_difference(one, other) is None


def test_one_change_of_ninety_of_a_light_volume_is_refused_or_a_claim(light):
    judged = list(judge_fields(light, every=90))
    assert len(judged) > 4
    assert not [verdict for verdict in judged if verdict[1] not in (CAUGHT, CLAIM)]


@pytest.mark.slow
def test_every_change_of_a_volume_is_refused_or_a_claim(seen):
    judged = list(judge_fields(seen))
    assert not [verdict for verdict in judged if verdict[1] not in (CAUGHT, CLAIM)]
    assert sum(outcome == CAUGHT for _, outcome, _ in judged) > 400


def test_the_page_on_security_lists_every_claim():
    page = (Path(__file__).parents[3] / "docs/security.md").read_text()
    assert not [claim for claim in STATED.values() if f"| {claim} |" not in page]


def test_a_bundle_alone_has_the_certificate_of_its_own_legs(light):
    assert certify_alone(open_volume(light), proof()).holds
