"""Worlds that no builder writes are refused before MuJoCo sees them, with the path of what is wrong."""

import io
import json
import os
import shutil
import struct
import tracemalloc
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest

from benchmarks.faults.injection import edit_model, seal
from minexplore.bundle import BundleError
from minexplore.sealed.files import read_folder
from minexplore.world import load_world
from pipeline.schema import check_world
from tests.mines import BuiltMine, model_refusal, refusal, require_allowed

FOLDER = Path("w")


@pytest.fixture(scope="module")
def files(tee: BuiltMine) -> dict[str, bytes]:
    return read_folder(tee.bundle)


def replaced(files: dict[str, bytes], name: str, old: str, new: str, count: int = 1) -> dict[str, bytes]:
    assert old.encode() in files[name], old
    return {**files, name: files[name].replace(old.encode(), new.encode(), count)}


def test_a_world_of_the_builder_is_allowed_and_so_is_its_text_written_again(tee: BuiltMine, tmp_path):
    check_world(tee.bundle)
    shutil.copytree(tee.bundle, tmp_path / "w")
    edit_model(lambda spec: None)(tmp_path / "w")
    seal(tmp_path / "w")
    check_world(tmp_path / "w")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<body name="mine"', '<geom name="more" size="1"/><body name="mine"', "geoms: 'more' is one too many"),
        ('<geom name="floor_dry"', '<geom name="floor_dry" group="1"', "geom_group"),
        ('<geom name="rock_0000"', '<geom name="rock_0000" friction="0.1"', "geom_friction"),
        ('<geom name="rock_0000"', '<geom name="prop_1"', "collision parts, want rock_0000 to"),
        ('mesh="rock_0001"', 'mesh="rock_0002"', "geom rock_0001: want a mesh of its name"),
        ('<mesh name="smooth_walls"', '<mesh name="smooth_wall"', "mesh 'smooth_walls' is missing"),
        ('friction="0.55"', 'friction="0.5"', "geom floor_mud: geom_friction[7, 0] = 0.5, want 0.55"),
        ('<compiler angle="radian"/>', "", "compiler: want angle = radian"),
        ('zfar="200"', 'zfar="2"', "vis.map.zfar = 2.0, want 200.0"),
        ('model="test"', 'model="other"', "name_bodyadr[0] = 6, want 5"),
        ('<light name="spot_00"', '<light name="spot_00" mode="track"', "@mode: 'track' is not allowed"),
    ],
)
def test_a_model_that_the_builder_does_not_write_is_refused_with_the_field(files, tmp_path, old, new, message):
    found = model_refusal(tmp_path / "w", replaced(files, "mine.xml", old, new))
    assert "mine.xml: " in found
    assert message in found


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: r.update(more=1), "more = 1: unknown"),
        (lambda r: r.pop("loops"), "loops: missing"),
        (lambda r: r.update(tilt_deg=4.0), "T_world_mine[0][0]"),
        (lambda r: r.update(name="a/b"), "name = 'a/b': want 1 to 64 letters"),
        (lambda r: r["frames"].update(mine="other"), "frames = "),
        (lambda r: r["spawn"].update(anchor_m=[1e5, 0.0]), "spawn.anchor_m = [100000.0, 0.0]: want a place in"),
        (lambda r: r["zones"][1].update(east_m=50.0), "zones[1].east_m = 50.0: want "),
        (lambda r: r["zones"][1].update(name="Mud"), "zones[1].name = 'Mud': want"),
        (lambda r: r.update(format="minexplore-world/9"), "format 'minexplore-world/9'"),
    ],
)
def test_a_record_with_other_fields_or_values_is_refused_with_the_field(files, change, message):
    record = json.loads(files["world.json"])
    change(record)
    found = refusal({**files, "world.json": json.dumps(record).encode()})
    assert found.startswith("w/")
    assert message in found


@pytest.mark.parametrize(
    "text", ["[]", "[" * 100_000, '{"a": NaN}', '{"a": 1, "a": 2}', "\xff", '{"files": {}}', "9" * 5000]
)
def test_a_record_that_is_no_record_is_one_error(files, text):
    changed = {**files, "world.json": text.encode("latin1")}
    with pytest.raises(BundleError, match=r"^w/world\.json: "):
        require_allowed(FOLDER, changed)


def mesh_with(data: bytes, at: int, value: bytes) -> bytes:
    return data[:at] + value + data[at + len(value) :]


def grid_with(files: dict[str, bytes], **values: np.ndarray) -> bytes:
    with np.load(io.BytesIO(files["occupancy.npz"])) as grid:
        arrays = {name: grid[name] for name in grid.files} | values
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def test_binary_files_are_checked_before_anything_decodes_them(files):
    mesh, nan = files["meshes/smooth_walls.msh"], np.float32(np.nan).tobytes()
    far, face = np.float32(1e6).tobytes(), np.int32(10**6).tobytes()
    zeros = np.zeros((30_000, 10_000), dtype=bool)
    for name, data, message in (
        ("meshes/smooth_walls.msh", mesh_with(mesh, 16, nan), "vertices from nan"),
        ("meshes/smooth_walls.msh", mesh_with(mesh, 16, far), "the rock ends at"),
        ("meshes/smooth_walls.msh", mesh_with(mesh, len(mesh) - 4, face), "a face of vertex"),
        ("meshes/smooth_walls.msh", mesh[:-4], "do not match its size"),
        ("occupancy.npz", b"no archive", "cannot be read: no archive of arrays, or damaged"),
        ("occupancy.npz", b"MZ" + files["occupancy.npz"], "holds other bytes than its arrays"),
        ("occupancy.npz", files["occupancy.npz"] + bytes(1000), "holds other bytes than its arrays"),
        ("occupancy.npz", grid_with(files, free=zeros), "at most 100000000 values"),
        ("occupancy.npz", grid_with(files, cell_m=np.array(1e-9)), "cell_m = 1e-09, want 0.05 to 2"),
        ("occupancy.npz", grid_with(files, more=np.zeros(1)), "holds"),
        ("occupancy.npz", grid_with(files, origin_m=np.array([1.0, 2.0])), "from [1.0, 2.0] m"),
        ("preview.png", files["preview.png"][:-20], "a chunk ends beyond the file"),
        ("textures/rock.png", mesh_with(files["textures/rock.png"], 60, b"\0\1\2"), "checksum"),
    ):
        found = refusal({**files, name: data})
        assert found.startswith(f"w/{name}: "), found
        assert message in found, found


def test_a_negative_shape_does_not_unpack_what_follows_it(files):
    """A size below zero must not read as no limit: three megabytes of the archive unpack to three gigabytes."""
    with zipfile.ZipFile(io.BytesIO(files["occupancy.npz"])) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    header = np.lib.format.header_data_from_array_1_0(np.zeros((1, 5), np.float32)) | {"shape": (-1, 5)}
    array, packed = io.BytesIO(), io.BytesIO()
    np.lib.format.write_array_header_1_0(array, header)
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in (members | {"clearance_m.npy": array.getvalue() + bytes(100_000_000)}).items():
            archive.writestr(name, data)
    tracemalloc.start()
    assert "of shape (-1, 5)" in refusal({**files, "occupancy.npz": packed.getvalue()})
    assert tracemalloc.get_traced_memory()[1] < 50_000_000
    tracemalloc.stop()


def test_what_a_file_says_adds_neither_lines_nor_control_characters_to_an_error(files):
    record = json.loads(files["world.json"]) | {"a\nb\x1b[31m": 1}
    found = refusal({**files, "world.json": json.dumps(record).encode()})
    assert "a\\nb\\x1b[31m" in found
    assert found.isprintable()
    assert len(str(BundleError("x" * 10_000))) < 2_100


def test_a_picture_of_a_billion_pixels_is_refused_by_its_header(files):
    head = b"IHDR" + (40_000).to_bytes(4, "big") * 2 + bytes([8, 2, 0, 0, 0])
    picture = b"\x89PNG\r\n\x1a\n" + (13).to_bytes(4, "big") + head + zlib.crc32(head).to_bytes(4, "big")
    assert "40000 x 40000 px" in refusal({**files, "preview.png": picture})


def test_a_picture_of_countless_empty_chunks_is_refused_before_they_are_read(files):
    empty = bytes(4) + b"IDAT" + zlib.crc32(b"IDAT").to_bytes(4, "big")
    picture = files["preview.png"]
    many = picture[:33] + empty * 100_000 + picture[33:]
    assert "chunks in" in refusal({**files, "preview.png": many})


def picture_of(image: bytes, size_px: int) -> bytes:
    """Return a square picture of three colours whose image holds these bytes."""
    head = struct.pack(">IIBBBBB", size_px, size_px, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(image, 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body)) for kind, body in chunks
    )


@pytest.mark.parametrize("name", ["textures/rock.png", "preview.png"])
def test_a_picture_that_unpacks_to_more_than_its_header_says_is_refused_at_load(files, name):
    """MuJoCo would unpack all of it: 6 MB of the texture became 6.5 GB."""
    bomb = picture_of(bytes(200_000_000), 256)
    tracemalloc.start()
    assert "the image has" in refusal({**files, name: bomb})
    assert tracemalloc.get_traced_memory()[1] < 20_000_000
    tracemalloc.stop()
    assert "want 196864" in refusal({**files, name: picture_of(bytes(1000), 256)})


def test_a_world_that_was_edited_after_it_was_loaded_is_noticed_at_the_next_load(tee: BuiltMine, tmp_path):
    world = tmp_path / "w"
    shutil.copytree(tee.bundle, world)
    loaded = load_world(world)
    assert load_world(world) is loaded
    path = world / "mine.xml"
    before = path.stat()
    path.write_bytes(path.read_bytes().replace(b'zfar="200"', b'zfar="201"'))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    with pytest.raises(BundleError, match=r"mine\.xml: sha256"):
        load_world(world)
    with pytest.raises(BundleError, match=r"mine\.xml: changed since the world was loaded"):
        loaded.spec()
    seal(world)
    assert load_world(world) is not loaded
