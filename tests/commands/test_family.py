"""Families of worlds: seeds of the splits, errors of variants, and builds over cores and a cluster."""

import hashlib
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from minexplore.splits import SEEDS, SIZES, STYLES, mine_name, parse_name, world_folder
from pieces.results import PiecesError
from pieces.work import HERE, Where
from pipeline.build import family
from pipeline.build.family import Member, generated, make_family, to_list, variants, without_rock
from pipeline.build.splits import LIST, Listed, read_list, write_list
from pipeline.commands.worlds import worlds
from pipeline.errors import ArtifactError, GeometryError, InputError, LimitError
from pipeline.geometry.generated.generate import generate_workings
from pipeline.geometry.generated.perturb import displace, perturb_workings
from pipeline.store.locks import hold_lock
from pipeline.survey.load import read_survey
from stages.contours import trace_free_space
from tests.composed import compose
from tests.mines import RING, TEE
from tests.project import ROOT

SHAPE = {
    "size_m": (60.0, 90.0),
    "width_m": (4.0, 6.0),
    "loops": 0.5,
    "dead_ends": 0.3,
    "rib_noise_m": 0.15,
    "pillar_m": 8.0,
    "spacing_m": 24.0,
    "wander": 0.5,
}


def generate(style, seed, **changed):
    return generate_workings(style=style, rng=np.random.default_rng(seed), **{**SHAPE, **changed})


@pytest.mark.parametrize("style", STYLES)
def test_a_procedural_mine_is_connected_and_the_same_for_the_same_seed(style):
    for seed in range(12):
        mine = generate(style, seed)
        assert mine.is_valid
        assert len(mine.geoms) == 1
        assert mine.equals_exact(generate(style, seed), 0)
    assert not mine.equals(generate(style, 99))


@pytest.mark.parametrize("style", STYLES)
def test_drifts_have_the_given_width(style):
    for seed in range(4):
        mine = generate(style, seed, width_m=(4.0, 4.2), rib_noise_m=0.0)
        assert mine.buffer(-1.9).area > 0
        if style != "cave":  # a cave has chambers
            assert mine.buffer(-2.11, join_style="mitre").area < 0.15 * mine.area  # only junctions are wider


def test_more_crosscuts_make_more_loops():
    few, many = (
        sum(len(generate("drift_and_crosscut", s, loops=share, dead_ends=1.0).geoms[0].interiors) for s in range(6))
        for share in (0.0, 1.0)
    )
    assert few == 0
    assert many > 50


def test_rock_too_thin_to_stand_is_removed():
    for seed in range(8):
        (mine,) = generate("drift_and_crosscut", seed, spacing_m=12.0).geoms
        pillars = [shapely.Polygon(ring) for ring in mine.interiors]
        assert all(pillar.buffer(-0.5).area > 0 for pillar in pillars)


def test_a_variant_keeps_the_network_and_is_within_the_errors():
    distances = []
    for seed in range(20):
        perturbed = perturb_workings(RING, 0.3, 0.1, 20.0, np.random.default_rng(seed))
        assert len(perturbed.geoms) == 1
        assert len(perturbed.geoms[0].interiors) == 1
        distances.append(RING.exterior.hausdorff_distance(perturbed.geoms[0].exterior))
    assert 0.2 < np.mean(distances) < 1.5
    moved = [displace(TEE, 0.3, 40.0, np.random.default_rng(s)).exterior.coords[0] for s in range(400)]
    np.testing.assert_allclose(np.std(moved, axis=0), 0.3, rtol=0.15)


def test_errors_that_would_fold_a_plan_or_close_a_drift_are_refused():
    with pytest.raises(GeometryError, match="would fold the plan"):
        displace(TEE, 3.0, 5.0, np.random.default_rng(0))
    with pytest.raises(GeometryError, match="closes or opens a drift"):
        perturb_workings(RING, 0.0, 30.0, 20.0, np.random.default_rng(3))


def test_a_ring_stays_closed_whatever_its_length():
    """A matrix product may round equal rows differently, which is visible at the origin."""
    for length in range(10, 400, 10):
        ring = shapely.Polygon([(0, 0), (length, 0), (length, 5), (0, 5)])
        assert displace(ring, 0.3, 8.0, np.random.default_rng(length)).exterior.is_closed


DIGITS = """
import hashlib
import numpy as np
from pipeline.geometry.generated.generate import generate_workings
from pipeline.geometry.generated.rough_walls import roughen_walls
from tests.composed import compose
rng = np.random.default_rng(2000064)
digest = hashlib.sha256()
for style in ("room_and_pillar", "drift_and_crosscut", "ramp", "cave"):
    mine = compose(["survey=procedural", f"survey.mine.style={style}"]).survey.mine
    workings = generate_workings(rib_noise_m=0.15, rng=rng, **mine.model_dump())
    digest.update(workings.wkb + roughen_walls(workings, 0.06, 0.75, 1.0, 6.0, rng).wkb)
print(digest.hexdigest())
"""


@pytest.mark.slow
def test_a_procedural_mine_has_the_same_digits_with_the_kernels_of_another_processor():
    others = ({}, {"OPENBLAS_CORETYPE": "Haswell"}, {"OPENBLAS_CORETYPE": "Sandybridge"})
    digests = [
        subprocess.run(
            [sys.executable, "-c", DIGITS], env=os.environ | other, cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout.strip()
        for other in others
    ]
    assert len(digests[0]) == hashlib.sha256().digest_size * 2
    assert set(digests) == {digests[0]}


def test_splits_share_no_seed_and_styles_alternate(monkeypatch):
    monkeypatch.chdir(ROOT)
    seeds = [m.seed for split in ("train", "validation", "test") for m in generated(split, 100, [])]
    assert len(set(seeds)) == 300
    assert [m.style for m in generated("train", 5, [])] == [*STYLES, STYLES[0]]
    world_params = {"compile3d.height_m": 2.8, "survey.entrance_m": [1.0, 2.0], "contours.min_island_m2": 1.0}
    members = variants("x", ROOT / "data/x.geojson", "test", 5, 0.1, world_params, [])
    heights = [float(m.overrides[-1].partition("=")[2]) for m in members]
    assert len(set(heights)) == 5
    assert np.mean(heights) == pytest.approx(2.8, abs=0.2)
    for own in ("survey.entrance_m=[1.0,2.0]", "contours.min_island_m2=1"):
        assert all(own in m.overrides for m in members)


def broken_member():
    return Member("broken", "test", 1, "cave", ["survey=procedural", "survey.mine.style=maze"])


def small_members(count):
    """Return the members of small light worlds; a hundred contacts stress the first one, which a sample has."""
    members = without_rock(generated("validation", count, ["survey.mine.size_m=[60,70]"]), stress_tests=1)
    few = [[text.replace("contacts=1000", "contacts=100") for text in member.overrides] for member in members]
    return [replace(member, overrides=overrides) for member, overrides in zip(members, few, strict=True)]


def test_a_world_that_cannot_be_built_is_in_the_manifest_with_its_problem(monkeypatch, tmp_path):
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(family, "FAMILIES", tmp_path)
    with pytest.raises(LimitError, match=r"1 of 1 worlds failed, broken: ParamsError: survey\.mine\.style = 'maze'"):
        make_family([broken_member()], HERE)
    (record,) = json.loads((tmp_path / "manifest.json").read_text()).values()
    assert record["world_sha256"] is None
    assert "maze" in record["problem"]


def test_light_worlds_are_small_and_certified_and_a_second_call_builds_nothing_again(monkeypatch, tmp_path):
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(family, "FAMILIES", tmp_path)
    members = small_members(2)
    first = make_family(members, HERE)
    assert [outcome.member.seed for outcome in first] == [1_000_000, 1_000_001]
    assert all(outcome.certificate for outcome in first)
    contacts = []
    for member in members:
        folder = tmp_path / member.folder
        assert sum(file.stat().st_size for file in (folder / "realism/world").iterdir()) < 500_000
        contacts.append(json.loads((folder / "validation/certificate.json").read_text())["contacts"])
    assert contacts[0] >= 100  # the sample that is stress-tested
    assert contacts[1] == 0
    before = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("manifest.json") if file.parent != tmp_path}
    listed = {(line.split, line.seed): line for line in to_list(first)}
    changed = {**listed, ("validation", 1_000_001): Listed("validation", 1_000_001, "ramp", "0" * 64)}
    with pytest.raises(
        LimitError, match=r"1 of 2 worlds failed, light/validation/0001: world hash .* differs from 000"
    ):
        make_family(members, HERE, changed)
    assert before == {file: file.stat().st_mtime_ns for file in before}
    records = json.loads((tmp_path / "manifest.json").read_text())
    assert [record["world_sha256"] for record in records.values()] == [outcome.world_sha256 for outcome in first]


def test_the_stress_test_of_a_sample_is_spread_over_the_split():
    members = without_rock(generated("train", 1000, []), stress_tests=50)
    tested = [
        number for number, member in enumerate(members) if "validation.certificate.contacts=1000" in member.overrides
    ]
    assert len(tested) == 50
    assert (tested[0], tested[-1]) == (0, 999)
    assert {STYLES[number % 4] for number in tested} == set(STYLES)
    assert all(member.folder.startswith("light/train/") for member in members)


def test_the_committed_list_has_mines_of_the_splits_by_seed_and_style():
    listed = read_list(ROOT / LIST)
    assert len(listed) == sum(SIZES.values())
    for (split, seed), world in listed.items():
        number = seed - SEEDS[split]
        assert 0 <= number < SIZES[split]
        assert world.style == STYLES[number % 4]
    assert len({world.world_sha256 for world in listed.values()}) == len(listed)


def test_the_list_is_written_merged_and_read_back_and_a_broken_line_is_named(tmp_path):
    file = tmp_path / "splits.csv"
    one, two = Listed("test", 2_000_003, "cave", "a" * 64), Listed("train", 7, "cave", "b" * 64)
    write_list([one], file)
    write_list([two], file)
    assert read_list(file) == {("train", 7): two, ("test", 2_000_003): one}
    write_list([Listed("train", 7, "cave", "c" * 64)], file)
    assert read_list(file)["train", 7].world_sha256 == "c" * 64
    for bad, words in (("test,2000200,cave," + "a" * 64, "seed 2000200"), ("test,2000001,cave,no", "no hash")):
        file.write_text(f"split,seed,style,world_sha256\n{bad}\n")
        with pytest.raises(InputError, match=f"splits.csv: world 1: .*{words}"):
            read_list(file)


def test_variants_of_the_embedded_mine_have_their_own_split_and_no_other(monkeypatch):
    monkeypatch.chdir(ROOT)
    for split, of in (("train", "default"), ("test", "default"), ("variants", None), ("variants", "my-mine")):
        with pytest.raises(InputError, match="variants of the default world have the split variants"):
            worlds(1, split, of, 0.1, HERE, [])


def test_the_list_is_not_written_from_worlds_with_other_parameters(monkeypatch):
    monkeypatch.chdir(ROOT)
    with pytest.raises(InputError, match="--list: the list has light generated mines without overrides only"):
        worlds(1, "test", None, 0.1, HERE, ["survey.mine.loops=0.9"], light=True, write=True)


def test_a_mine_has_one_name_and_a_name_that_no_split_has_is_refused(tmp_path):
    assert parse_name(mine_name("test", 7)) == ("test", 7)
    for name in ("test-0200", "variants-0001", "test-7", "test-00071"):
        with pytest.raises(ValueError, match=f"mine = '{name}': want one of train-0000 to train-0999"):
            parse_name(name)
    built = (
        r"mine test-0007 is not built; `python -m benchmarks worlds --count 8 --split test` in a source checkout builds"
    )
    with pytest.raises(FileNotFoundError, match=built):
        world_folder("test-0007", tmp_path)


@pytest.mark.slow
@pytest.mark.ray
def test_a_cluster_of_two_nodes_builds_the_worlds_that_local_processes_build(monkeypatch, tmp_path):
    pytest.importorskip("ray", reason="Ray comes with `make setup-baselines`")
    import ray
    from ray.cluster_utils import Cluster

    monkeypatch.chdir(ROOT)
    members = small_members(4)
    monkeypatch.setattr(family, "FAMILIES", tmp_path / "local")
    local = make_family(members, HERE)
    monkeypatch.setattr(family, "FAMILIES", tmp_path / "cluster")
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    cluster.add_node(num_cpus=1)
    monkeypatch.setenv("RAY_ADDRESS", cluster.address)
    try:
        built = make_family(members, Where(on="ray"))
        ray.init(cluster.address)
        assert len([node for node in ray.nodes() if node["Alive"]]) == 2
        ray.shutdown()
        with pytest.raises(LimitError, match=r"ParamsError: survey\.mine\.style = 'maze'"):
            make_family([broken_member()], Where(on="ray"))
    finally:
        ray.shutdown()
        cluster.shutdown()
    assert [outcome.world_sha256 for outcome in built] == [outcome.world_sha256 for outcome in local]
    assert all(outcome.world_sha256 for outcome in built)


def test_rooms_that_are_more_than_half_of_the_plan_are_no_inverted_plan(monkeypatch):
    monkeypatch.chdir(ROOT)
    (member,) = (m for m in generated("test", 105, []) if m.seed == 2_000_104)
    config = compose(member.overrides)
    read = read_survey(config.survey)
    traced = trace_free_space(config.contours, read)
    frame = traced["free_space"].frame
    assert traced["cleaned"].sum() > 0.5 * frame.width_px * frame.height_px


def _wait(families, again, member):
    time.sleep(60)
    Path("ended").touch()


def _end(families, again, member):
    os._exit(9)


def test_an_interrupt_ends_the_processes_that_build_worlds(monkeypatch, tmp_path):
    def interrupt(kind, frame):
        raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("pipeline.build.family.make_member", _wait)
    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 1.0)
    try:
        with pytest.raises(KeyboardInterrupt):
            make_family(without_rock(generated("train", 6, []), 0), Where(2))
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert not Path("ended").exists()  # nothing waited for the end of the work
    assert multiprocessing.active_children() == []


def test_a_killed_process_and_a_second_command_are_reported_in_one_line(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("pipeline.build.family.make_member", _end)
    members = without_rock(generated("train", 2, []), 0)
    with pytest.raises(PiecesError, match=r"2 of 2 pieces failed, .*its process was ended, perhaps for want of memory"):
        make_family(members, Where(2))
    place = family.FAMILIES / "light" / "train"
    with (
        hold_lock(place / ".lock", "held"),
        pytest.raises(ArtifactError, match=r"light/train: another command is building these worlds \(process"),
    ):
        make_family(members, Where(2))


def test_two_commands_of_two_splits_that_end_at_once_both_enter_the_manifest(monkeypatch, tmp_path):
    monkeypatch.setattr(family, "FAMILIES", tmp_path / "families")
    read, both = json.loads, threading.Barrier(2)

    def read_slowly(text):
        with suppress(threading.BrokenBarrierError):  # without a lock both read before one of them writes
            both.wait(1.0)
        return read(text)

    first, *others = (
        family.MemberOutcome(member, None, None, False, "not built")
        for split in ("validation", "train", "test")
        for member in generated(split, 1, [])
    )
    family.record_outcomes([first])
    monkeypatch.setattr("pipeline.build.family.json.loads", read_slowly)
    commands = [threading.Thread(target=family.record_outcomes, args=([outcome],)) for outcome in others]
    for command in commands:
        command.start()
    for command in commands:
        command.join(60)
    (file,) = family.FAMILIES.iterdir()  # and no lock
    assert sorted(read(file.read_text())) == ["test/0000", "train/0000", "validation/0000"]


@pytest.mark.parametrize("text", ["[]", "{", "[" * 100_000])
def test_a_broken_manifest_is_refused_before_worlds_are_built(monkeypatch, tmp_path, text):
    monkeypatch.setattr(family, "FAMILIES", tmp_path)
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(ArtifactError, match=r"manifest\.json: .*; remove it$"):
        make_family([broken_member()], HERE)
