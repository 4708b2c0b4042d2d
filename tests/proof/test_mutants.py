"""Faults of every kind in a small world: each is refused with one line that names the file, or changes nothing."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import shapely

from benchmarks.faults.changes import random_change
from benchmarks.faults.injection import edit_record, seal
from benchmarks.faults.judge import CAUGHT, CRASHED, MISSED, judge, prove
from minexplore.bundle import MODEL, TriangleMesh, decode_msh, encode_msh
from minexplore.sealed.files import read_folder
from pipeline.errors import ArtifactError, MineError
from pipeline.geometry.rock.extrude import section_footprint
from pipeline.mjcf.bundle import obstacles, open_bundle
from pipeline.mjcf.loading import load_model
from pipeline.proof.rebuilt.same_model import model_difference
from pipeline.store.verify import verify_certificate
from tests.composed import compose


@pytest.fixture(scope="session")
def small(small_world) -> Path:
    return small_world


@pytest.fixture(scope="session")
def params():
    return compose([]).validation


def refusal(small, tmp_path, params, change) -> str:
    """Return the message with which a sealed world is refused after a change of its folder."""
    shutil.copytree(small, tmp_path / "w")
    change(tmp_path / "w")
    seal(tmp_path / "w")
    with pytest.raises(MineError) as caught:
        prove(tmp_path / "w", params)
    return str(caught.value)


def test_a_good_world_is_proved(small, params):
    assert prove(small, params).warnings == 0


def test_random_mutants_are_refused_or_harmless(small, params):
    verdicts = [judge(small, params, seed) for seed in range(16)]
    assert not [v for v in verdicts if v.outcome in (MISSED, CRASHED)]
    caught = [v for v in verdicts if v.outcome == CAUGHT]
    assert len(caught) > 13
    assert all("\n" not in v.reason and v.reason.startswith("w/") for v in caught), [v.reason for v in caught]


@pytest.mark.slow
def test_four_hundred_random_mutants_are_refused_or_harmless(small, params):
    verdicts = [judge(small, params, seed) for seed in range(10_000, 10_400)]
    assert not [v for v in verdicts if v.outcome in (MISSED, CRASHED)]


def test_the_same_seed_gives_the_same_mutant_and_another_seed_another(small):
    files = read_folder(small)
    assert random_change(files, 3) == random_change(files, 3)
    assert len({random_change(files, seed)[0] for seed in range(30)}) > 25


def test_two_models_differ_in_the_first_field_that_differs(small):
    one, two = (load_model(small / MODEL) for _ in range(2))
    assert model_difference(one, two) is None
    two.geom_friction[1, 0] = 0.3
    assert model_difference(one, two) == "geom rock_0001: geom_friction[1, 0] = 1.0, want 0.3"
    two.geom_friction[:] = one.geom_friction
    two.opt.timestep = 0.1
    assert model_difference(one, two) == "opt.timestep = 0.002, want 0.1"


def moved(path: Path, change) -> None:
    mesh = decode_msh(path.read_bytes())
    vertices, faces = mesh.vertices.copy(), mesh.faces.copy()
    vertices, faces = change(vertices, faces)
    path.write_bytes(encode_msh(TriangleMesh(vertices, faces, mesh.texcoords, mesh.normals)))


@pytest.mark.parametrize(
    ("mesh", "change", "message"),
    [
        ("walls_00_00", lambda v, f: (v, f[:-1]), "a hole at|vertices that belong to no face"),
        ("walls_00_00", lambda v, f: (v, f[:, ::-1]), "two faces on one side|a hole|a normal behind its face"),
        ("walls_00_00", lambda v, f: (v + np.float32([0, 0.02, 0]), f), "a hole at"),
        ("roof_00_00", lambda v, f: (v - np.float32([0, 0, 1.5]), f), "from the smooth surface"),
        ("smooth_walls", lambda v, f: (v, f[:, ::-1]), "faces the wrong way"),
        ("smooth_roof", lambda v, f: (v - np.float32([0, 0, 0.2]), f), "chamfers of|from where it should be"),
    ],
)
def test_visible_rock_with_a_hole_a_panel_or_its_inside_out_is_refused(small, tmp_path, params, mesh, change, message):
    found = refusal(small, tmp_path, params, lambda w: moved(w / f"meshes/{mesh}.msh", change))
    assert re.search(message, found), found


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: r["areas"].update(tunnel_m2=1.0), "areas.tunnel_m2 = 1.0"),
        (lambda r: r.update(loops=2), "loops = 2, drifts"),
        (lambda r: r["spawn"].update(anchor_clearance_m=9.0), "spawn.anchor_clearance_m = 9.0, want"),
        (lambda r: r["spawn"].update(anchor_m=[2.0, 2.0]), "spawn.anchor_m[0] = 2.0, want"),
        (lambda r: r["plan_frame"].update(px_per_m=8.1), "plan_frame.px_per_m = 8.1, want 8.0"),
    ],
)
def test_a_figure_of_the_record_that_the_outline_does_not_have_is_refused(small, tmp_path, params, change, message):
    assert message in refusal(small, tmp_path, params, edit_record(change))


def test_an_outline_with_a_wide_tolerance_is_refused(small, tmp_path, params):
    def widen(world: Path) -> None:
        path = world / "free_space.geojson"
        path.write_text(path.read_text().replace('"tolerance_m": 0.16', '"tolerance_m": 40.0'))

    assert "tolerance_m = 40.0, want 0 to 0.16" in refusal(small, tmp_path, params, widen)


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("free_space.geojson", b"[" * 100_000, "free_space.geojson: not JSON of a world"),
        ("free_space.geojson", b"[]", "free_space.geojson: not a readable FreeSpace"),
        ("topology.json", b'{"a":' * 100_000, "topology.json: not JSON of a world"),
        ("topology.json", b"{}", "topology.json: not a readable DriftNetwork: '"),
        ("free_space.bt", b"", "free_space.bt: not the octree of the clearance grid"),
    ],
)
def test_a_file_that_no_reader_reads_is_one_error_line(small, tmp_path, params, name, data, message):
    found = refusal(small, tmp_path, params, lambda w: (w / name).write_bytes(data))
    assert message in found
    assert "\n" not in found


def added_part(box: tuple[float, float, float, float, float, float]):
    """Return a fault that adds a box of collision rock: west, east, south, north, low, high (m)."""
    west, east, south, north, low, high = box
    corners = [f"{x} {y} {z}" for x in (west, east) for y in (south, north) for z in (low, high)]

    def change(world: Path) -> None:
        record = json.loads((world / "world.json").read_text())
        number = record["collision_parts"]
        text = (world / "mine.xml").read_text()
        last = f'<mesh name="rock_{number - 1:04d}"'
        name = f"rock_{number:04d}"
        at = text.index("\n", text.index(last)) + 1
        text = text[:at] + f'<mesh name="{name}" vertex="{" ".join(corners)}"/>\n' + text[at:]
        geom = f'<geom name="{name}" class="rock" type="mesh" mesh="{name}"/>\n'
        at = text.index("\n", text.index(f'<geom name="rock_{number - 1:04d}"')) + 1
        (world / "mine.xml").write_text(text[:at] + geom + text[at:])
        (world / "world.json").write_text(json.dumps(record | {"collision_parts": number + 1}))

    return change


@pytest.mark.parametrize("heights", [(0.0, 0.04), (0.6, 0.7), (3.46, 3.5)])
def test_a_bar_of_rock_between_two_slices_is_found(small, tmp_path, params, heights):
    assert "not an upright prism" in refusal(small, tmp_path, params, added_part((1.0, 1.2, 0.0, 4.0, *heights)))
    world = open_bundle(tmp_path / "w", checked=False)
    free = shapely.box(0.5, 0.5, 3.0, 3.0)
    solid = shapely.union_all(
        [
            section_footprint(part)
            for part in obstacles(world.model, np.array(world.record.T_world_mine), world.record.height_m)
        ]
    )
    assert solid.intersection(free).area == pytest.approx(0.2 * 2.5, rel=1e-3)


def test_a_certificate_of_another_world_is_noticed(tmp_path):
    path = tmp_path / "certificate.json"
    path.write_text(json.dumps({"world_sha256": "a" * 64, "holds": True}))
    verify_certificate(path, "a" * 64)
    with pytest.raises(ArtifactError, match=r"certificate\.json: world_sha256 = a+, the certified world must be b+"):
        verify_certificate(path, "b" * 64)
    path.write_text(json.dumps({"world_sha256": "a" * 64, "holds": False}))
    with pytest.raises(ArtifactError, match=r"holds = False, want true"):
        verify_certificate(path, "a" * 64)


def test_a_world_of_another_survey_is_refused(tee, ring, config):
    from pipeline.proof.validator import Validator

    with pytest.raises(ArtifactError, match=r"plan_frame = .*, the survey has"):
        Validator(config.validation, ring.bundle, tee.cleaned, tee.raw, tee.survey)
