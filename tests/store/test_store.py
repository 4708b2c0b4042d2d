import ast
import dataclasses
import io
import json
import os
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest
import shapely

from pipeline.errors import ArtifactError, InputError
from pipeline.report.results import read_metrics
from pipeline.store.codecs import Meshes, decode, encode
from pipeline.store.files import replace_folder, write_atomically
from pipeline.store.hashing import _imported_names, import_closure, sha256_bytes, sha256_file, sha256_named
from pipeline.store.manifest import read_manifest
from pipeline.store.registry import read_registry, register, verify_input
from pipeline.store.verify import verify_certificate, verify_chain
from pipeline.types import ConvexParts, DriftNetwork, FreeSpace, Image, Mask, Mesh, Occupancy, Survey
from tests.mines import BuiltMine
from tests.project import ROOT


def round_trip(tmp_path, name, value, kind):
    path = tmp_path / name
    path.write_bytes(encode(path, value))
    return decode(path, kind)


def test_every_kind_of_artifact_survives_writing_and_reading(tmp_path, tee: BuiltMine):
    assert round_trip(tmp_path, "a.json", tee.survey, Survey) == tee.survey
    assert round_trip(tmp_path, "b.json", tee.network, DriftNetwork) == tee.network
    free = round_trip(tmp_path, "c.geojson", tee.free_space, FreeSpace)
    assert shapely.equals_exact(free.polygon, tee.free_space.polygon)
    assert (free.areas, free.frame, free.tolerance_m) == (
        tee.free_space.areas,
        tee.free_space.frame,
        tee.free_space.tolerance_m,
    )
    assert (round_trip(tmp_path, "d.png", tee.cleaned, Mask) == tee.cleaned).all()
    parts = round_trip(tmp_path, "e.npz", tee.compiled["collision.npz"], ConvexParts)
    assert (parts.vertices == tee.compiled["collision.npz"].vertices).all()
    grid = round_trip(tmp_path, "f.npz", tee.compiled["occupancy.npz"], Occupancy)
    assert grid.cell_m == tee.compiled["occupancy.npz"].cell_m
    assert (grid.clearance_m == tee.compiled["occupancy.npz"].clearance_m).all()
    meshes = round_trip(tmp_path, "g.npz", tee.surface["smooth.npz"], Meshes)
    assert set(meshes) == set(tee.surface["smooth.npz"])
    assert isinstance(meshes["walls"], Mesh)
    assert (meshes["walls"].faces == tee.surface["smooth.npz"]["walls"].faces).all()


def test_a_broken_artifact_is_named_and_a_pickle_is_never_opened(tmp_path):
    for name, data in {"a.json": b"{", "b.png": b"x", "c.npz": b"PK", "d.geojson": b"[]"}.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(ArtifactError, match=name):
            decode(tmp_path / name, Mask if name == "b.png" else ConvexParts if name == "c.npz" else Survey)
    np.savez(tmp_path / "p.npz", vertices=np.array([print], dtype=object), offsets=np.zeros(1, np.int32))
    with pytest.raises(ArtifactError, match=r"p\.npz"):
        decode(tmp_path / "p.npz", ConvexParts)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not a manifest: not JSON; its stage must run again$"),
        ("{}", "not a manifest: 'stage' is missing, unknown or of another kind; its stage must run again$"),
    ],
)
def test_a_broken_manifest_is_refused_in_our_own_words(tmp_path, text, message):
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(ArtifactError, match=message):
        read_manifest(tmp_path / "manifest.json")


def test_nan_is_never_written_to_json(tmp_path):
    with pytest.raises(ValueError, match=r"not JSON compliant|Out of range"):
        encode(tmp_path / "x.json", {"a": float("nan")})


def test_a_folder_with_an_empty_one_in_it_is_replaced(tmp_path):
    folder = tmp_path / "surface"
    replace_folder(folder, {"a.txt": b"light", "rock/": b""}, {})
    replace_folder(folder, {"a.txt": b"rough", "rock/b.txt": b"rough"}, {"a.txt": None, "rock/": None})
    assert (folder / "rock/b.txt").read_bytes() == b"rough"
    assert [path.name for path in tmp_path.iterdir()] == ["surface"]


def test_a_folder_is_replaced_completely_or_not_at_all(tmp_path, monkeypatch):
    folder = tmp_path / "stage"
    replace_folder(folder, {"a.txt": b"old", "sub/b.txt": b"old"}, {})
    ours = {"a.txt": None, "sub/b.txt": None}
    written = []
    real = os.fsync

    def full_disk(descriptor):
        written.append(descriptor)
        if len(written) > 1:
            raise OSError(28, "No space left on device")
        real(descriptor)

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(ArtifactError, match="the disk is full"):
        replace_folder(folder, {"a.txt": b"new", "c.txt": b"new"}, ours)
    assert {p.name: p.read_bytes() for p in folder.rglob("*.txt")} == {"a.txt": b"old", "b.txt": b"old"}
    assert [p.name for p in tmp_path.iterdir()] == ["stage"]


def test_a_file_is_written_completely_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "params.yaml"
    write_atomically(path, b"old")

    def full_disk(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(ArtifactError, match=r"params\.yaml: cannot be written, the disk is full"):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_message_states_that_something_earlier_is_kept_only_where_there_is_some(tmp_path):
    broken = {"b/c": b"", "b": b""}
    (tmp_path / "file").write_text("")
    for write in (
        lambda: replace_folder(tmp_path / "stage", broken, {}),
        lambda: write_atomically(tmp_path / "file" / "a.txt", b"new"),
    ):
        with pytest.raises(ArtifactError, match="cannot be written") as caught:
            write()
        assert "the earlier one is kept" not in str(caught.value)
    replace_folder(tmp_path / "stage", {"b": b"old"}, {})
    with pytest.raises(ArtifactError, match=r"cannot be written, .*; the earlier one is kept"):
        replace_folder(tmp_path / "stage", broken, {"b": None})
    assert (tmp_path / "stage" / "b").read_bytes() == b"old"


def test_a_pipe_in_place_of_a_file_is_not_called_missing(registry_folder):
    (registry_folder / "data/raw/plan.png").write_bytes(b"1")
    register(Path("data/raw/plan.png"), "drawn", "CC0")
    (registry_folder / "data/raw/plan.png").unlink()
    os.mkfifo(registry_folder / "data/raw/plan.png")
    for use in (
        lambda: verify_input(Path("data/raw/plan.png"), read_registry()),
        lambda: register(Path("data/raw/plan.png"), "drawn", "CC0"),
    ):
        with pytest.raises(InputError, match=r"plan\.png: not a plain file"):
            use()


def test_a_hash_of_named_hashes_is_the_sha256_of_their_listing():
    assert sha256_named({"b": "2", "a": "1"}) == sha256_bytes(b"1  a\n2  b\n")


def test_the_import_closure_follows_imports_inside_functions_and_packages():
    closure = {p.as_posix() for p in import_closure(ROOT / "stages/compile3d.py", ROOT)}
    assert {"stages/__init__.py", "pipeline/geometry/rock/decompose.py", "pipeline/types.py"} <= closure
    assert "pipeline/mjcf/world.py" not in closure


def test_imports_are_those_that_pythons_parser_finds_in_every_module_of_the_stages():
    for path in import_closure(ROOT / "stages/validation.py", ROOT):
        source = (ROOT / path).read_text()
        wanted = set()
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.Import):
                wanted |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                wanted |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        named = {node.value for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Constant)}
        wanted |= {text.partition(":")[0] for text in named if re.fullmatch(r"[a-z_][\w.]+\.\w+:\w+", str(text))}
        assert _imported_names(source) == wanted, path


def test_an_import_over_several_lines_counts_and_prose_does_not():
    source = "import a.b, c  # one\nif x:\n    from d import (\n        e,\n        f,\n    )\n"
    source += "from g import \\\n    h; import i\n"
    prose = '"""Read\nfrom the file of the user\nimport of mines\n"""\n'
    assert _imported_names(source + prose) == {"a.b", "c", "d", "d.e", "d.f", "g", "g.h", "i"}


@pytest.fixture
def registry_folder(tmp_path, monkeypatch):
    (tmp_path / "data" / "raw").mkdir(parents=True)
    (tmp_path / "data" / "registry.txt").write_text("# name\tsha256\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_registered_file_verifies_until_it_changes(registry_folder):
    from pathlib import Path

    path = Path("data/raw/plan.png")
    path.write_bytes(b"plan")
    register(path, "my mine", "CC0")
    assert verify_input(path, read_registry()) == sha256_bytes(b"plan")
    register(path, "my mine", "CC0")
    assert len(read_registry()) == 1
    path.write_bytes(b"other")
    with pytest.raises(InputError, match=r"plan\.png: sha256 .* \(5 bytes\) is not the registered .* \(4 bytes\)"):
        verify_input(path, read_registry())
    with pytest.raises(InputError, match="remove that line first"):
        register(path, "my mine", "CC0")
    path.unlink()
    with pytest.raises(InputError, match="missing; restore it from git"):
        verify_input(path, read_registry())


def test_an_unregistered_file_and_a_broken_registry_are_named(registry_folder):
    from pathlib import Path

    with pytest.raises(InputError, match="python -m pipeline register"):
        verify_input(Path("data/raw/x.png"), read_registry())
    with pytest.raises(InputError, match="below data/"):
        register(Path("elsewhere.png"), "-", "-")
    Path("data/registry.txt").write_text("one two\n")
    with pytest.raises(InputError, match=r"registry\.txt:1"):
        read_registry()


def test_a_mesh_survives_a_round_trip_and_a_truncated_file_is_refused(tmp_path):
    rng = np.random.default_rng(0)
    vertices = rng.uniform(-9, 9, (5, 3)).astype(np.float32).astype(float)
    mesh = Mesh(vertices, np.array([[0, 1, 2], [2, 3, 4]], np.int32), rng.uniform(0, 1, (5, 2)))
    path = tmp_path / "a.msh"
    path.write_bytes(encode(path, mesh))
    assert decode(path, Mesh).normals is None
    mesh = dataclasses.replace(mesh, normals=np.eye(3)[[0, 1, 2, 1, 0]])
    path.write_bytes(encode(path, mesh))
    read = decode(path, Mesh)
    np.testing.assert_array_equal(read.normals, mesh.normals)
    np.testing.assert_array_equal(read.vertices, mesh.vertices)
    np.testing.assert_array_equal(read.faces, mesh.faces)
    np.testing.assert_allclose(read.texcoords, mesh.texcoords, atol=1e-6)
    path.write_bytes(path.read_bytes()[:-4])
    with pytest.raises(ArtifactError, match=r"a\.msh: not a readable Mesh: .* do not match its size"):
        decode(path, Mesh)


def test_the_header_of_a_packed_array_is_the_same_in_every_version_of_python(tmp_path):
    data = encode(tmp_path / "p.npz", ConvexParts(np.zeros((4, 3)), np.array([0, 4], np.int32)))
    name = b"vertices.npy"
    # Signature, version 2.0, no flags, deflate, 1980-01-01 00:00; then no extra field for sizes of 64 bits.
    assert data[:14] == b"PK\x03\x04" + bytes([20, 0, 0, 0, 8, 0, 0, 0, 0x21, 0])
    assert data[26:30] == len(name).to_bytes(2, "little") + b"\0\0"
    assert data[30 : 30 + len(name)] == name


def test_devices_pipes_and_folders_in_place_of_artifacts_are_refused_by_name(tmp_path):
    # /dev/null ends at once; /dev/zero and a pipe without a writer, which never end, are refused in the same way.
    def null(path):
        path.symlink_to("/dev/null")

    readers = {
        "manifest.json": read_manifest,
        "metrics.json": lambda path: read_metrics(path.parent),
        "certificate.json": lambda path: verify_certificate(path, "0" * 64),
        "plan.png": lambda path: decode(path, Image),
        "data.bin": sha256_file,
    }
    for name, read in readers.items():
        for put in (null, Path.mkdir, os.mkfifo):
            path = tmp_path / put.__name__ / name
            path.parent.mkdir(exist_ok=True)
            put(path)
            with pytest.raises(ArtifactError, match=rf"{name}: not a plain file"):
                read(path)


def test_figures_and_manifests_of_absurd_size_are_refused_before_they_are_read(tmp_path):
    for name, read in (("manifest.json", read_manifest), ("metrics.json", lambda path: read_metrics(path.parent))):
        with (tmp_path / name).open("wb") as stream:
            stream.truncate(10**12)  # a sparse file
        with pytest.raises(ArtifactError, match=rf"{name}: 1000000000000 bytes, want at most"):
            read(tmp_path / name)


def test_parameters_that_are_no_yaml_are_named(tmp_path):
    for data in (b"[" * 20_000, b"\xff\xfe\xff", b"a: ["):
        (tmp_path / "dvc.yaml").write_bytes(data)
        with pytest.raises(ArtifactError, match=r"dvc\.yaml: not YAML"):
            verify_chain(tmp_path)


def _array(shape, descr="<f8", data=b""):
    head = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\x01\0" + len(head).to_bytes(2, "little") + head + data


def _archive(data, method=zipfile.ZIP_DEFLATED):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        archive.writestr("vertices.npy", data)
    return stream.getvalue()


@pytest.mark.parametrize(
    "data",
    [
        _archive(_array((10**12,))),
        _archive(_array((-1,))),
        _archive(_array((2,), "|O", b"\x80\x04.")),
        _archive(_array((1,), "<U4", bytes(16))),
        _archive(b"no array"),
        _archive(_array((2,), data=bytes(16)), zipfile.ZIP_LZMA),
        _archive(_array((2,), data=bytes(16)))[:60] + b"\xff" * 20 + _archive(_array((2,), data=bytes(16)))[80:],
    ],
    ids=["terabytes", "negative", "objects", "text", "bytes", "lzma", "broken"],
)
def test_a_forged_archive_of_arrays_is_refused_in_one_line(tmp_path, data):
    path = tmp_path / "mesh.npz"
    path.write_bytes(data)
    with pytest.raises(ArtifactError, match=r"mesh\.npz: not a readable") as caught:
        decode(path, Meshes)
    assert str(caught.value).isprintable()


def test_a_free_space_that_is_no_polygon_is_refused(tmp_path, tee: BuiltMine):
    path = tmp_path / "free_space.geojson"
    content = json.loads(encode(path, tee.free_space))
    content["features"][0]["geometry"] = {"type": "Point", "coordinates": [0, 0]}
    path.write_text(json.dumps(content))
    with pytest.raises(ArtifactError, match="a Point, want a Polygon or a MultiPolygon"):
        decode(path, FreeSpace)
