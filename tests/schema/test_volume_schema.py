"""Bundles of volumes that no builder writes are refused before anything uses them, with what is wrong."""

import io
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from minexplore.bundle import BundleError
from minexplore.sealed.files import read_folder
from minexplore.sealed.sizes import most_bytes
from pipeline.errors import ArtifactError
from pipeline.schema import check_world
from pipeline.volume.world.proof.again.remodelled import require_same_model
from pipeline.volume.world.proof.certificate import open_volume
from tests.mines import put, require_allowed, sealed
from tests.mines import refusal as refusal_of

FOLDER = Path("w")


@pytest.fixture(scope="module")
def files(box) -> dict[str, bytes]:
    return read_folder(box)


def refusal(files: dict[str, bytes]) -> str:
    """Return the message with which a sealed world is refused."""
    message = refusal_of(files)
    assert message.startswith("w/")
    assert "\n" not in message
    return message


def with_arrays(files: dict[str, bytes], name: str, **changes) -> dict[str, bytes]:
    """Return the files with other arrays in an archive; None leaves one out."""
    with np.load(io.BytesIO(files[name])) as archive:
        arrays = {key: archive[key].copy() for key in archive.files}
    for key, change in changes.items():
        arrays[key] = change(arrays[key]) if callable(change) else change
    stream = io.BytesIO()
    np.savez_compressed(stream, **{key: value for key, value in arrays.items() if value is not None})
    return {**files, name: stream.getvalue()}


def test_a_volume_of_the_builder_is_allowed(box):
    found = check_world(box)
    assert len(found.volume.parts) == found.record["collision_parts"]


def test_files_that_are_missing_or_that_a_volume_has_not_are_refused(files):
    for name in ("volume.npz", "parts.npz", "cells.npz", "mine.xml", "topology.json", "free_space.bt"):
        assert f"{name}: missing" in refusal({key: data for key, data in files.items() if key != name})
    for name in ("occupancy.npz", "map_01.png", "preview.png", "meshes/smooth_walls.msh"):
        assert f"{name}: no file of a world that is one volume" in refusal({**files, name: b"1"})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"vertices": None}, "holds ["),
        ({"vertices": lambda a: a.astype("f4")}, "vertices is <f4"),
        ({"vertices": lambda a: a[:, :2].copy()}, "shapes {"),
        ({"vertices": put((0, 0), np.nan)}, "vertices: want finite numbers"),
        ({"faces": put((0, 0), 99)}, "faces[0, 0] = 99: want 0 to"),
        ({"label": put(0, 3)}, "label[0] = 3: want 0 to 2"),
        ({"leg": put(0, -1)}, "leg[0] = -1: want 0 to"),
        ({"label": lambda a: np.ones_like(a)}, "no facet is a floor"),
        ({"faces": lambda a: np.vstack([a[:1, ::-1], a[1:]])}, "the mesh is not closed"),
        ({"faces": lambda a: a[:, ::-1].copy()}, "normals point into the free space"),
        ({"faces": put((0, slice(None)), 0)}, "names vertex 0 twice"),
        ({"vertices": lambda a: np.vstack([a, a[:1]])}, "vertices: 1 belong to no facet"),
        ({"vertices": lambda a: a * [1, 1, 2]}, "volume.high_m = 3.0: the bundle's arrays have 6.0"),
    ],
)
def test_a_mesh_that_is_not_closed_or_whose_arrays_are_others_is_refused(files, changes, message):
    assert message in refusal(with_arrays(files, "volume.npz", **changes))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"corners": put((3, 1), np.inf)}, "part 0 has a corner at"),
        ({"corners": lambda a: a * [1, 1, 0]}, "part 0 is 0 m thick"),
        ({"first": put(1, 2)}, "first: want numbers from 0 to"),
        ({"first": lambda a: a[:-1].copy()}, "shapes ("),
        ({"label": put(0, -1)}, "label[0] = -1: want 0 to 2"),
        ({"label": lambda a: np.where(a == 0, 1, a).astype("<i4")}, "volume.floors = "),
    ],
)
def test_parts_without_a_volume_or_far_from_the_mine_are_refused(files, changes, message):
    assert message in refusal(with_arrays(files, "parts.npz", **changes))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"cell_m": np.array(0.0)}, "cell_m = 0.0, want 0.05 to 2"),
        ({"origin_m": np.array([-1e6, 0.0])}, "origin_m = [-1000000.0, 0.0], want at most 10 m"),
        ({"column": put(0, 10**6)}, "column[0] = 1000000: want 0 to"),
        ({"floor_m": put(0, -5.0)}, "span 0: floor_m = -5.0"),
        ({"headroom_m": put(0, 50.0)}, "headroom_m = 50.0"),
        ({"clearance_m": put(0, np.inf)}, "clearance_m = inf"),
        ({"aside_m": put(0, 1.0)}, "aside_m = [1.0, 1.0, 1.0]"),
        ({"way_m": put(0, -1.0)}, "way_m = [-1.0, -1.0, -1.0, -1.0]"),
        ({"way_m": lambda a: a[:, :3].copy()}, "want aside_m of three columns and way_m of 4"),
        ({"column": put(slice(0, 2), 0), "row": put(slice(0, 2), 0)}, "spans 0 and 1 are in one column and overlap"),
        ({"storey": put(0, 5)}, "volume.storeys = 1: the bundle's arrays have 6"),
        ({"row": lambda a: a[:-1].copy()}, "of which all arrays have as many"),
    ],
)
def test_floors_outside_of_the_volume_are_refused(files, changes, message):
    assert message in refusal(with_arrays(files, "cells.npz", **changes))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: r.update(more=1), "more = 1: unknown"),
        (lambda r: r.pop("volume"), "volume: missing"),
        (lambda r: r["volume"].update(facets=5), "volume.facets = 5: the bundle's arrays have"),
        (lambda r: r["volume"].update(closed_ends=[{"station": 1}]), "volume.closed_ends[0] = "),
        (lambda r: r["spawn"].update(anchor_m=[1.0, 0.0, 90.0]), "spawn.anchor_m = [1.0, 0.0, 90.0]: want a place"),
        (lambda r: r.update(tilt_deg=5.0), "tilt_deg = 5.0"),
        (lambda r: r.update(overlay="seen"), "overlay = 'seen'"),
        (lambda r: r.update(drifts=7), "as many legs as world.json has drifts, 7"),
        (lambda r: r["gain_m"].update(whole_frame=9.0), "gain_m.whole_frame = 9.0: want 3.000"),
        (lambda r: r.update(format="minexplore-world/2"), "volume.npz: "),
        (lambda r: r.update(format="minexplore-world/4"), "format 'minexplore-world/4'"),
    ],
)
def test_a_record_with_other_fields_or_figures_is_refused(files, change, message):
    record = json.loads(files["world.json"])
    change(record)
    found = refusal({**files, "world.json": json.dumps(record).encode()})
    assert message in found or (record["format"].endswith("/2") and "world.json: " in found)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name="rock_0000" type', 'name="rock_0000" contype="0" type', "geom[rock_0000]@contype = 0, want None"),
        ('name="rock_0001" type', 'name="rock_0002" type', "geom[rock_0002]: the builder writes no such element here"),
        ('mesh="rock_0001"', 'mesh="rock_0002"', "geom[rock_0001]@mesh = rock_0002, want rock_0001"),
        ('model="test"', 'model="other"', "mujoco@model = other, want test"),
        (' pos="', ' pos="9', "body[mine]@pos = 9"),
        ("<worldbody>", '<worldbody><geom type="plane" size="1 1 1"/>', "geom: the builder writes no such element"),
    ],
)
def test_a_model_that_the_builder_does_not_write_is_refused_with_its_path(box, files, old, new, message):
    assert old.encode() in files["mine.xml"]
    changed = replace(open_volume(box), model=files["mine.xml"].replace(old.encode(), new.encode(), 1))
    with pytest.raises(ArtifactError, match=re.escape(message)):
        require_same_model(box, changed, 0.0)


@pytest.mark.parametrize("tag", ["mesh", "geom"])
def test_a_part_that_is_moved_in_the_model_or_missing_is_refused(box, files, tag):
    attribute = {"mesh": "vertex", "geom": "pos"}[tag]
    world, text = open_volume(box), files["mine.xml"].decode()
    found = re.search(rf'<{tag} name="rock_0000"[^>]* {attribute}="-?', text)
    assert found is not None
    moved = replace(world, model=f"{text[: found.end()]}9{text[found.end() :]}".encode())
    with pytest.raises(ArtifactError, match=rf"{tag}\[rock_0000\]@{attribute} = "):
        require_same_model(box, moved, 0.0)
    last = re.findall(rf'<{tag} name="(?:rock|floor)_[^>]*>', text)[-1]
    with pytest.raises(ArtifactError, match="missing"):
        require_same_model(box, replace(world, model=text.replace(last, "").encode()), 0.0)


def test_a_model_may_have_the_text_of_as_many_parts_as_a_volume_may_have(ramp):
    """A cave of 13.6 km has 152 MB, which a limit of 64 MiB refused."""
    files = read_folder(ramp)
    large = files["mine.xml"].replace(b"\n", b"\n" + b" " * 900_000)
    assert 50 << 20 < len(large) < 152_000_000 <= most_bytes("mine.xml")
    changed = sealed({**files, "mine.xml": large})
    assert require_allowed(FOLDER, changed).volume is not None


@pytest.mark.parametrize(
    "network", [[], {"legs": []}, {"legs": [{"start": "1", "end": "9"}], "stations_m": {"1": [0, 0, 0]}}, {"legs": 3}]
)
def test_a_network_without_its_legs_is_refused(files, network):
    assert "topology.json: " in refusal({**files, "topology.json": json.dumps(network).encode()})


def test_a_byte_that_is_changed_is_one_error_in_every_file(files):
    rng = np.random.default_rng(0)
    for name in sorted(set(files) - {"made_by.json"}):
        for _ in range(3):
            data = bytearray(files[name])
            data[rng.integers(len(data))] ^= 1 << rng.integers(8)
            changed = {**files, name: bytes(data)}
            with pytest.raises(BundleError) as caught:
                require_allowed(FOLDER, changed)
            assert "\n" not in str(caught.value)


def test_a_sealed_file_with_changed_bytes_is_read_or_refused_but_nothing_else(files):
    rng = np.random.default_rng(1)
    for name in ("volume.npz", "parts.npz", "cells.npz", "mine.xml", "topology.json", "map_00.png", "map_00.yaml"):
        for _ in range(8):
            data = bytearray(files[name])
            data[rng.integers(len(data))] ^= 1 << rng.integers(8)
            changed = sealed({**files, name: bytes(data)})
            try:
                require_allowed(FOLDER, changed)
            except BundleError as error:
                assert "\n" not in str(error)  # noqa: PT017
