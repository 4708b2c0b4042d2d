"""Each format keeps what is written: read by its own loader, and by the checkers of others where they are installed."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import ArtifactError
from pipeline.export.checks.pieces import triangle_area_m2
from pipeline.export.checks.prove import prove
from pipeline.export.checks.rays import RAYS
from pipeline.export.formats.sdf import WORLD_FILE
from pipeline.export.formats.table import FORMATS
from pipeline.export.frames import turn_to
from pipeline.export.scene import Files
from tests.project import ROOT

NEAR_M = 2e-5  # float32 over the length of a mine

CHECK_GLTF = """
const check = require('gltf-validator'), read = require('fs').readFileSync;
check.validateBytes(new Uint8Array(read(process.argv[1]))).then(found => console.log(JSON.stringify(found.issues)));
"""
CHECK_SDF = """
#include <iostream>
#include <sdf/sdf.hh>
int main(int, char **names) {
  sdf::Root root;
  for (const auto &error : root.Load(names[1])) std::cout << error.Message() << std::endl;
  if (!root.WorldCount()) return 0;
  const auto *link = root.WorldByIndex(0)->ModelByIndex(0)->LinkByIndex(0);
  std::cout << link->CollisionCount() << " " << link->VisualCount() << " " << root.WorldByIndex(0)->LightCount();
}
"""


@pytest.fixture(params=FORMATS)
def chosen(request):
    """Return the name of a format, or skip where its package is not installed."""
    if FORMATS[request.param].module == "pxr":
        pytest.importorskip("pxr", reason="usd-core is not installed (extra `export`)")
    return request.param


def put(folder: Path, files: Files) -> Path:
    """Write files to a folder."""
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    return folder


def test_a_file_read_back_has_every_part_surface_label_and_light(world, chosen, tmp_path):
    scene, form = world.scene, FORMATS[chosen]
    read = form.read(put(tmp_path, form.write(scene)), scene.facts)
    wanted, found = ({part.name: part for part in parts} for parts in (scene.parts, read.parts))
    assert found.keys() == wanted.keys()
    for name, part in wanted.items():
        assert (found[name].label, found[name].zone, found[name].is_box) == (part.label, part.zone, part.is_box)
        assert found[name].friction is None or found[name].friction == pytest.approx(part.friction, abs=1e-6)
        for side in (np.min, np.max):
            assert side(found[name].vertices_m, axis=0) == pytest.approx(side(part.vertices_m, axis=0), abs=NEAR_M)
    surfaces = {surface.name.removeprefix("visual_"): surface for surface in read.surfaces}
    assert surfaces.keys() == {surface.name for surface in scene.surfaces}
    for surface in scene.surfaces:
        same = surfaces[surface.name]
        assert (same.label, same.zone) == (surface.label, surface.zone)
        area = triangle_area_m2(surface.triangles_m)
        assert triangle_area_m2(same.triangles_m) == pytest.approx(area, rel=1e-5)
        assert same.triangles_m.mean(axis=(0, 1)) == pytest.approx(surface.triangles_m.mean(axis=(0, 1)), abs=1e-4)
    assert read.lights == (None if chosen == "obj" else len(scene.lights))


def test_a_world_without_visible_rock_shows_its_parts_in_their_colours(bare, chosen, tmp_path):
    scene, form = bare.scene, FORMATS[chosen]
    assert scene.texture is None
    floors = {surface.zone: scene.materials[surface.material].rgba for surface in scene.surfaces if surface.zone}
    assert floors == {zone.name: tuple(zone.rgba) for zone in bare.opened.record.zones}
    proof = prove(
        bare.bundle, bare.opened, scene, form.read(put(tmp_path, form.write(scene)), scene.facts), bare.params
    )
    assert list(proof.failures()) == []
    assert {name: rays.agree for name, rays in proof.rays.items()} == {"touched": RAYS, "seen": RAYS}
    assert {"seen/walls", "seen/roof"} <= proof.labels.keys()


def test_the_same_world_gives_the_same_bytes(world, chosen):
    assert FORMATS[chosen].write(world.scene) == FORMATS[chosen].write(world.scene)


def test_a_zone_with_an_underscore_keeps_its_name(world, chosen, tmp_path):
    parts = [replace(part, zone=f"old_{part.zone}_1" if part.zone else "") for part in world.scene.parts]
    scene = replace(world.scene, parts=parts, surfaces=[])
    read = FORMATS[chosen].read(put(tmp_path, FORMATS[chosen].write(scene)), scene.facts)
    assert {part.name: part.zone for part in read.parts} == {part.name: part.zone for part in parts}


def test_a_file_that_states_another_world_is_refused(world, chosen, tmp_path):
    put(tmp_path, FORMATS[chosen].write(world.scene))
    other = replace(world.scene.facts, world_sha256="0" * 64)
    with pytest.raises(ArtifactError, match="facts of the world differ"):
        FORMATS[chosen].read(tmp_path, other)


def test_a_light_points_where_the_world_lets_it_even_half_a_turn_away():
    axis = np.array([0.0, 0.0, -1.0])
    for direction in (axis, -axis, np.array([0.6, 0.0, 0.8]), np.array([0.0, -1.0, 0.0])):
        rotation = turn_to(axis, direction)
        assert rotation @ axis == pytest.approx(direction)
        assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_the_khronos_validator_finds_nothing_in_a_gltf(world, tmp_path):
    node, paths = shutil.which("node"), {**os.environ, "NODE_PATH": str(ROOT / ".venv" / "node_modules")}
    asked = [node, "-e", "require('gltf-validator')"]
    if node is None or subprocess.run(asked, env=paths, capture_output=True).returncode:
        pytest.skip("node or its package gltf-validator is not installed (make setup-witness)")
    files = FORMATS["gltf"].write(world.scene)
    put(tmp_path, files)
    for name in files:
        command = [node, "-e", CHECK_GLTF, tmp_path / name]
        done = subprocess.run(command, env=paths, capture_output=True, text=True, check=True)
        issues = json.loads(done.stdout)
        assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"][:3]


def test_libsdformat_reads_an_sdf_without_errors(world, tmp_path):
    packages = [f"sdformat{version}" for version in range(12, 17)]
    tool = shutil.which("pkg-config")
    found = [name for name in packages if tool and not subprocess.run([tool, "--exists", name]).returncode]
    if not found or shutil.which("g++") is None:
        pytest.skip("libsdformat-dev, pkg-config or g++ is not installed (make setup-witness)")
    (tmp_path / "check.cc").write_text(CHECK_SDF)
    flags = subprocess.run([tool, "--cflags", "--libs", found[-1]], capture_output=True, text=True, check=True)
    command = ["g++", "-std=c++17", "check.cc", *flags.stdout.split(), "-o", "check"]
    subprocess.run(command, cwd=tmp_path, check=True)
    put(tmp_path, FORMATS["sdf"].write(world.scene))
    done = subprocess.run(["./check", WORLD_FILE], cwd=tmp_path, capture_output=True, text=True, check=True)
    scene = world.scene
    assert done.stdout == f"{len(scene.parts)} {len(scene.surfaces)} {len(scene.lights)}"


def test_the_validators_of_usd_find_nothing_in_a_stage(world, tmp_path):
    pytest.importorskip("pxr", reason="usd-core is not installed (extra `export`)")
    from pxr import Usd, UsdGeom, UsdValidation

    put(tmp_path, FORMATS["usd"].write(world.scene))
    stage = Usd.Stage.Open(str(tmp_path / f"{world.scene.facts.name}.usdc"))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    check = UsdValidation.ValidationContext(validators)
    assert len(validators) > 10
    assert [error.GetErrorAsString() for error in check.Validate(stage)] == []
    for mesh in map(UsdGeom.Mesh, filter(lambda prim: prim.IsA(UsdGeom.Mesh), stage.Traverse())):
        normals, corners = mesh.GetNormalsAttr().Get(), len(mesh.GetFaceVertexIndicesAttr().Get())
        flat = mesh.GetNormalsInterpolation() == UsdGeom.Tokens.faceVarying
        assert len(normals) == (corners if flat else len(mesh.GetPointsAttr().Get())), mesh.GetPath()
    stage.ClearDefaultPrim()
    stage.ClearMetadata(UsdGeom.Tokens.upAxis)
    assert check.Validate(stage)  # the validators do find what is missing


@pytest.mark.parametrize("name", ["world", "bare"])
def test_nvidias_asset_validator_finds_no_fault_in_a_stage(name, request, tmp_path):
    pytest.importorskip("pxr", reason="usd-core is not installed (extra `export`)")
    validator = pytest.importorskip(
        "omni.asset_validator", reason="omniverse-asset-validator is not installed (make setup)"
    )
    scene = request.getfixturevalue(name).scene
    put(tmp_path, FORMATS["usd"].write(scene))
    issues = list(validator.ValidationEngine().validate(str(tmp_path / f"{scene.facts.name}.usdc")))
    severe = [str(issue) for issue in issues if issue.severity.name != "WARNING"]
    assert severe == []
    # Chunks touch themselves in points where tiles cut them; a point for each side would be welded again.
    assert {issue.rule.__name__ for issue in issues} <= {"ManifoldChecker"}
