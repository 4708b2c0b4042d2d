"""What a load refuses of a bundle from a stranger, sealed as it is, before MuJoCo reads a file."""

import json
import os
import shutil
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from minexplore.bundle import BundleError, decode_msh, encode_msh
from minexplore.sealed import xml
from minexplore.sealed.files import read_folder
from minexplore.sealed.json_text import read_json
from minexplore.sealed.sizes import most_bytes
from minexplore.sealed.world import hash_files, open_files
from minexplore.sealed.xml import walk_xml
from minexplore.sensing.lidar import shared_lidar
from minexplore.world import load_world
from tests.mines import BuiltMine, sealed


@pytest.fixture(scope="module")
def files(tee: BuiltMine) -> dict[str, bytes]:
    return read_folder(tee.bundle)


def refusal(files: dict[str, bytes]) -> str:
    """Return the message with which files are refused that have the hashes that the record states."""
    with pytest.raises(BundleError) as caught:
        open_files(Path("w"), files, hash_files(files))
    assert str(caught.value).isprintable()
    return str(caught.value)


def test_a_world_that_differs_from_its_hashes_or_has_other_files_is_refused(files):
    name = "meshes/smooth_walls.msh"
    assert f"w/{name}: sha256" in refusal({**files, name: files[name][:-1] + b"1"})
    assert f"w/{name}: missing" in refusal({key: data for key, data in files.items() if key != name})
    assert "w/map_00.png: not listed in world.json" in refusal({**files, "map_00.png": b""})
    for path in ("../secret.msh", "/etc/passwd", "meshes/../../secret.msh", "..\\secret.msh"):
        record = json.loads(files["world.json"])
        record["files"][path] = "0" * 64
        assert "leads out of the bundle" in refusal({**files, "world.json": json.dumps(record).encode()})
    record = json.loads(files["world.json"]) | {"loops": 7}
    assert "the world's hash" in refusal({**files, "world.json": json.dumps(record).encode()})


@pytest.mark.parametrize(
    ("new", "message"),
    [
        ('<include file="more.xml"/>', "include: <include> is not allowed"),
        ('<extension><plugin plugin="x"/></extension>', "extension: <extension> is not allowed"),
        ('<asset><model file="mine.xml"/></asset>', "asset/model: <model> is not allowed"),
        ('<asset><mesh name="m" plugin="x"/></asset>', "asset/mesh[m]@plugin: 'x' is not allowed"),
        ('<asset><skin file="a.skn"/></asset>', "asset/skin: <skin> is not allowed"),
        ('<asset><texture builtin="flat" width="90000" height="90000"/></asset>', "@builtin: 'flat' is not allowed"),
        ('<asset><hfield name="h" nrow="90000" ncol="90000" size="1 1 1 1"/></asset>', "@nrow: '90000' is not allowed"),
        ('<asset><mesh name="m" file="../secret.msh"/></asset>', "mesh[m]@file: '../secret.msh', want a file of the"),
        ('<asset><mesh name="m" file="/etc/passwd"/></asset>', "mesh[m]@file: '/etc/passwd', want a file of the"),
        (
            '<asset><texture name="t" file="preview.png"/></asset>',
            "@file: 'preview.png', want a file of the bundle",
        ),
        (
            '<asset><texture name="t" file="meshes/smooth_walls.msh" content_type="image/png"/></asset>',
            "texture[t]@file: 'meshes/smooth_walls.msh', want a file of the bundle for a <texture>",
        ),
        (
            '<asset><mesh name="m" file="meshes/smooth_walls.msh" content_type="model/obj"/></asset>',
            "mesh[m]@content_type: 'model/obj', want model/vnd.mujoco.msh or image/png",
        ),
        ('<compiler meshdir="/etc"/>', "compiler@meshdir: '/etc' is not allowed"),
        ('<visual><global offwidth="99999"/></visual>', "global@offwidth: '99999', want at most 4096"),
        ('<visual><global offwidth="1e9"/></visual>', "global@offwidth: '1e9', want plain numbers"),
        ('<visual><quality shadowsize="99999"/></visual>', "quality: <quality> is not allowed"),
        ('<statistic extent="nan"/>', "statistic@extent: 'nan', want plain numbers"),
        (
            '<worldbody><replicate count="1000000"/></worldbody>',
            "<replicate> is not allowed",
        ),
        ('<size memory="1T"/>', "size: <size> is not allowed"),
        ("<!-- more -->", "'<!' is not allowed"),
        ("text", "text 'text'; a world has none"),
        (f'<statistic extent="1"/><custom a="{"1" * 999}"/>', "custom: <custom> is not allowed"),
    ],
)
def test_a_model_that_reaches_outside_or_sizes_a_buffer_is_refused(files, new, message):
    model = files["mine.xml"].replace(b"<worldbody>", new.encode() + b"<worldbody>", 1)
    found = refusal(sealed({**files, "mine.xml": model}))
    assert found.startswith("w/mine.xml: ")
    assert message in found


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: r.update(format="minexplore-world/9"), "format 'minexplore-world/9'"),
        (lambda r: r.update(name="a/b"), "name = 'a/b': want 1 to 64 letters"),
        (lambda r: r.update(height_m=1e9), "height_m = 1000000000.0: want a number from 0.5 to 50"),
        (lambda r: r.update(world_m=[0, 0, 1e5, 1e5]), "world_m"),
        (lambda r: r.update(world_m=[0, 0, 1e9, 1]), "world_m[2] = 1000000000.0: want a number from"),
        (lambda r: r.update(T_world_mine=[[1]]), "T_world_mine = [[1]]: want a list of 4"),
        (lambda r: r.pop("spawn"), "spawn.anchor_clearance_m = None: want a number"),
        (lambda r: r["spawn"].update(anchor_m=[1e5, 0.0]), "spawn.anchor_m = [100000.0, 0.0]: want a place in"),
        (lambda r: r.update(zones=r["zones"] * 1000), "want a list of 1 to 1000 zones"),
        (lambda r: r.update(overlay="seen"), "overlay = 'seen': want 'rough' or 'none'"),
    ],
)
def test_a_record_without_what_an_environment_reads_is_refused(files, change, message):
    record = json.loads(files["world.json"])
    change(record)
    assert message in refusal(sealed({**files, "world.json": json.dumps(record).encode()}))


def test_a_mesh_with_a_face_of_a_vertex_that_is_not_there_is_refused_before_it_is_used(tee: BuiltMine, files, tmp_path):
    name = next(name for name in files if name.startswith("meshes/walls_"))
    mesh = decode_msh(files[name])
    faces, vertices = mesh.faces.copy(), mesh.vertices.copy()
    faces[0, 0], vertices[0, 0] = 10**6, np.nan
    for number, change in enumerate(({"faces": faces}, {"vertices": vertices})):
        shutil.copytree(tee.bundle, tmp_path / str(number))
        for path, data in sealed({**files, name: encode_msh(type(mesh)(**{**vars(mesh), **change}))}).items():
            (tmp_path / str(number) / path).write_bytes(data)
        world = load_world(tmp_path / str(number))
        with pytest.raises(BundleError, match=rf"{name}: a place that is not finite, or a face of a vertex"):
            shared_lidar(world.folder, world.record["world_sha256"], 10.0, "auto")


@pytest.mark.parametrize(
    "name", ["world.json", "mine.xml", "map.yaml", "free_space.geojson", "topology.json", "free_space.bt", "map.png"]
)
def test_a_file_larger_than_a_builder_writes_it_is_refused_before_it_is_read(tee: BuiltMine, tmp_path, name):
    world = tmp_path / "w"
    shutil.copytree(tee.bundle, world)
    os.truncate(world / name, most_bytes(name) + 1)  # without blocks on the disk
    tracemalloc.start()
    with pytest.raises(BundleError, match=rf"/{name}: {most_bytes(name) + 1} bytes, at most {most_bytes(name)}"):
        read_folder(world)
    assert tracemalloc.get_traced_memory()[1] < 20_000_000
    tracemalloc.stop()


def _attributes(count: int) -> bytes:
    return b"<a " + b" ".join(b"a%x=''" % number for number in range(count)) + b"/>"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"<m>\n<a b='" + bytes([48]) * 1_100_000 + b"'/></m>", "line 2: an element of more than 1048576 bytes"),
        (b"<m>\n" + _attributes(200_000) + b"</m>", "line 2: an element of more than 1048576 bytes"),
        (b"<m>" + 3 * _attributes(400) + b"</m>", "more than 1000 attributes"),
        (b"<m>" + 100 * b"<a/>" + b"</m>", "more than 100 elements"),
        (b"<m>" * 20, "more than 100 elements, or more than 12 within"),
    ],
)
def test_a_model_that_would_take_more_memory_than_its_text_is_refused(text, message, monkeypatch):
    monkeypatch.setattr(xml, "MOST_ELEMENTS", 100)
    monkeypatch.setattr(xml, "MOST_ATTRIBUTES", 1000)
    with pytest.raises(BundleError, match=rf"^mine\.xml: ({message})"):
        walk_xml("mine.xml", text, xml.BoundedReader("mine.xml"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"a": [1, {"b": NaN}]}', r"a\[1\]\.b = NaN: want a finite number"),
        ('{"a": 1e400}', "a = 1e400: want a finite number of at most 25 characters"),
        ('{"a": -Infinity}', "a = -Infinity: want a finite number"),
        ('{"a": ' + "9" * 400 + "}", "a = 9{40}: want a finite number of at most 25 characters"),
        ('{"a": {"b": 1, "b": 2}}', r"a\.b stands twice"),
        ('{"a": ' + "[" * 20 + "]" * 20 + "}", "nested deeper than 16 levels"),
        ('{"]]]]": ' + "[" * 16 + "]" * 16 + "}", "nested deeper than 16 levels"),
        ('{"\\"]]]]": ' + "[" * 16 + "]" * 16 + "}", "nested deeper than 16 levels"),
        ('{"a":\n 1', "not JSON from line 2, character 3 on$"),
    ],
)
def test_json_that_no_builder_writes_is_refused_with_its_field(text, message):
    with pytest.raises(BundleError, match=rf"^topology\.json: .*{message}|^topology\.json: {message}"):
        read_json("topology.json", text.encode())


def test_json_of_a_builder_is_read_whatever_its_texts_hold():
    content = {"[[[[{{{{" * 9: [1, -2.5, 1.7976931348623157e308, -2.2250738585072014e-308], '"\\': None}
    assert read_json("topology.json", json.dumps(content).encode()) == content


def test_links_pipes_and_unknown_files_are_refused(tee: BuiltMine, tmp_path):
    secret = tmp_path / "secret.msh"
    shutil.copy(tee.bundle / "meshes/smooth_walls.msh", secret)
    for number, change in enumerate(
        (
            lambda w: ((w / "meshes/smooth_walls.msh").unlink(), (w / "meshes/smooth_walls.msh").symlink_to(secret)),
            lambda w: (shutil.rmtree(w / "textures"), (w / "textures").symlink_to(tee.bundle / "textures")),
            lambda w: os.mkfifo(w / "more.xml"),
            lambda w: (w / "meshes" / "more").mkdir(),
            lambda w: (w / "plugin.so").write_bytes(b""),
        )
    ):
        world = tmp_path / f"w{number}"
        shutil.copytree(tee.bundle, world)
        change(world)
        with pytest.raises(BundleError, match=str(world)):
            load_world(world)


def test_a_world_whose_floor_an_older_version_folded_is_refused_in_one_line(tee: BuiltMine, files, tmp_path):
    shutil.copytree(tee.bundle, tmp_path / "old")
    folded = sealed({**files, "floor.npz": b"triangles"}, heights={"low_m": 0.0, "high_m": 5.0})
    for name in ("floor.npz", "world.json"):
        (tmp_path / "old" / name).write_bytes(folded[name])
    with pytest.raises(BundleError, match=r"old/floor\.npz: of a world whose floor an older version folded; make the"):
        load_world(tmp_path / "old")
