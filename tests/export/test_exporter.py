"""An export is whole and proved, or nothing is written."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from hashlib import sha256
from importlib.util import find_spec

import numpy as np
import pytest

from minexplore.bundle import MODEL, BundleError
from pipeline.commands.exports import export_
from pipeline.errors import ArtifactError, InputError, LimitError
from pipeline.export.exporter import EXPORT_RECORD, export_world
from pipeline.export.formats.table import FORMATS, require_format
from pipeline.export.scene import ExportScene, Files
from tests.export.rolling import NEWTON, roll_in_mujoco, roll_in_newton
from tests.mines import sealed
from tests.project import ROOT


def stated_in(folder):
    return json.loads((folder / EXPORT_RECORD).read_text())


def bundle_with(world, folder, change):
    """Copy a bundle and write the files that `change` returns of its files."""
    files = {path.relative_to(world).as_posix(): path.read_bytes() for path in world.rglob("*") if path.is_file()}
    for name, data in change(files).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    return folder


def test_the_command_writes_a_proved_export_and_replaces_an_earlier_one(small_world, tmp_path, capsys):
    out = tmp_path / "out"
    for _ in range(2):
        export_(str(small_world), "gltf", out, "CC-BY-4.0", [])
        assert "touched: 10000 of 10000 rays within 0.001 m" in capsys.readouterr().out
    stated, record = stated_in(out), json.loads((small_world / "world.json").read_text())
    assert stated["proof"]["holds"]
    assert {rays["agree"] for rays in stated["proof"]["rays"].values()} == {10_000}
    assert stated["proof"]["not_measured"]
    for name in ("frames", "T_world_mine", "world_sha256", "areas"):
        assert stated["world"][name] == record[name]
    assert stated["world"]["licence"] == "CC-BY-4.0"
    assert json.loads((out / "world.json").read_text()) == record
    assert {name: sha256((out / name).read_bytes()).hexdigest() for name in stated["files"]} == stated["files"]
    assert {path.name for path in out.iterdir()} == {*stated["files"], EXPORT_RECORD}
    assert "world.json" in stated["files"]


def test_an_export_that_loses_a_part_is_refused_and_leaves_nothing(small_world, world, tmp_path, monkeypatch):
    whole = FORMATS["gltf"]

    def write(scene: ExportScene) -> Files:
        return whole.write(replace(scene, parts=scene.parts[1:]))

    monkeypatch.setitem(FORMATS, "gltf", replace(whole, write=write))
    with pytest.raises(LimitError, match=r"nothing is written: .*touched/rock: \d+ pieces .*certificate: missing_mm"):
        export_world(small_world, "gltf", tmp_path / "out", "none", world.params)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["files", "file", "link"])
def test_a_place_that_holds_something_else_is_refused_and_kept(small_world, world, tmp_path, kind):
    out = tmp_path / "out"
    if kind == "file":
        out.write_text("mine")
    else:
        (tmp_path / "other").mkdir()
        (tmp_path / "other" / "thesis.txt").write_text("mine")
        if kind == "link":
            out.symlink_to(tmp_path / "other")
        else:
            (tmp_path / "other").rename(out)
    before = sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*"))
    with pytest.raises(InputError, match="--out"):
        export_world(small_world, "gltf", out, "none", world.params)
    assert sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    "record", ["{}", "[]", "mine", '{"format": "minexplore-export/1", "files": {"thesis.txt": ""}}']
)
def test_files_beside_any_record_of_an_export_are_kept_and_one_is_named(small_world, world, tmp_path, record):
    (tmp_path / EXPORT_RECORD).write_text(record)
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match=rf"--out {tmp_path}: \S+: .*; move it away and run again"):
        export_world(small_world, "gltf", tmp_path, "none", world.params)
    assert (tmp_path / "thesis.txt").read_text() == "mine"
    assert (tmp_path / EXPORT_RECORD).read_text() == record


@pytest.mark.parametrize("licence", ["", "MIT\nmtllib /etc/passwd", "a\x1b[2J", "x" * 201])
def test_a_licence_that_is_no_short_line_is_refused(small_world, world, tmp_path, licence):
    with pytest.raises(InputError, match="--licence"):
        export_world(small_world, "obj", tmp_path / "out", licence, world.params)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["../../escaped", "/tmp/escaped", "a b", "a\nb", ""])
def test_a_name_that_could_leave_the_folder_is_refused(small_world, world, tmp_path, name):
    bundle = bundle_with(small_world, tmp_path / "world", lambda files: sealed(files, name=name))
    with pytest.raises((ArtifactError, BundleError), match="name"):
        export_world(bundle, "gltf", tmp_path / "out", "none", world.params)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["world"]


@pytest.mark.parametrize("target", ["../../../etc/passwd", "meshes/../../secret.msh", "/etc/hostname"])
def test_a_model_that_names_a_file_outside_is_refused(small_world, world, tmp_path, target):
    def point_out(files: Files) -> Files:
        mesh = next(name for name in files if name.startswith("meshes/walls"))
        return sealed({**files, "mine.xml": files["mine.xml"].replace(mesh.encode(), target.encode())})

    bundle = bundle_with(small_world, tmp_path / "world", point_out)
    with pytest.raises((ArtifactError, BundleError), match=r"mine\.xml"):
        export_world(bundle, "gltf", tmp_path / "out", "none", world.params)


def test_a_bundle_with_a_changed_mesh_is_refused(small_world, world, tmp_path):
    bundle = tmp_path / "world"
    shutil.copytree(small_world, bundle)
    mesh = next(bundle.glob("meshes/walls*"))
    mesh.write_bytes(mesh.read_bytes()[:-4] + b"\0\0\0\0")
    with pytest.raises(ArtifactError, match=mesh.name):
        export_world(bundle, "obj", tmp_path / "out", "none", world.params)


@pytest.mark.skipif(find_spec("pxr") is not None, reason="usd-core is installed")
def test_a_format_without_its_package_is_refused_with_the_packages_name():
    with pytest.raises(InputError, match="--to usd: usd-core is not installed"):
        require_format("usd")


@pytest.mark.slow
def test_a_kilometre_of_drift_takes_at_most_2_gb_of_memory_and_100_mb_of_files(tmp_path):
    """For the slowest format: memory and bytes grow with its work, and a busy machine does not change them."""
    bundle = ROOT / "artifacts/realism/world"
    if not bundle.is_dir():
        pytest.skip("the default world is not built (make all)")
    command = [sys.executable, "-m", "pipeline", "export", str(bundle), "--to", "sdf", "--out", str(tmp_path / "out")]
    command += ["--licence", "CC-BY-4.0"]
    process = subprocess.Popen(command, cwd=ROOT, env={**os.environ, "OMP_NUM_THREADS": "1"})
    _, status, used = os.wait4(process.pid, 0)  # of this process alone
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    drift_km = json.loads((bundle / "topology.json").read_text())["total_length_m"] / 1000
    assert drift_km > 1
    assert used.ru_maxrss < 2_000_000  # 1,250,000 kB
    assert sum(path.stat().st_size for path in (tmp_path / "out").rglob("*.*")) / drift_km < 100e6  # 43e6


@pytest.mark.slow
def test_a_ball_rolls_alike_in_newton(world, tmp_path):
    """In 5 s from rest on the tilted floor, Newton's ball stays within 5 mm of MuJoCo's."""
    pytest.importorskip("pxr", reason="usd-core is not installed (extra `export`)")
    if not NEWTON.exists():
        pytest.skip("newton is not installed (make setup-witness)")
    export_world(world.bundle, "usd", tmp_path / "out", "none", world.params)
    stage = tmp_path / "out" / f"{world.scene.facts.name}.usdc"
    record = world.opened.record
    ours, theirs = roll_in_mujoco(world.bundle / MODEL, record), roll_in_newton(stage, record)
    assert np.linalg.norm(ours[-1] - ours[0]) > 1.0
    assert np.linalg.norm(ours - theirs, axis=1).max() < 0.005
