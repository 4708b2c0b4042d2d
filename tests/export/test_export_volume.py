"""Worlds that are one volume in other formats: what is read back is theirs, and a fault is found."""

import dataclasses
import json

import numpy as np
import pytest

from pipeline.commands.exports import export_
from pipeline.errors import LimitError
from pipeline.export.checks.prove_volume import compare_parts, prove_volume
from pipeline.export.exporter import EXPORT_RECORD, export_world
from pipeline.export.extract import load_checked
from pipeline.export.extract_volume import arrays_of, read_volume_scene
from pipeline.export.formats.table import FORMATS
from pipeline.export.scene import ReadScene, box_corners, placed_part
from tests.composed import compose


@pytest.fixture(scope="module")
def bundle(ramp):
    return ramp


@pytest.fixture(scope="module")
def arrays(bundle):
    return arrays_of(load_checked(bundle))


@pytest.fixture(scope="module")
def scene(bundle):
    return read_volume_scene(load_checked(bundle), "CC-BY-4.0")


def read_of(scene, **changed):
    """Return a scene as a loader without faults reads it, with changes."""
    read = ReadScene(scene.facts.to_json(), scene.parts, scene.surfaces, len(scene.lights))
    return dataclasses.replace(read, **changed)


@pytest.mark.parametrize("to", FORMATS)
def test_a_volume_is_exported_with_its_parts_and_bare_facets_and_proved(bundle, tmp_path, capsys, to):
    if FORMATS[to].module == "pxr":
        pytest.importorskip("pxr", reason="usd-core is not installed (extra `export`)")
    export_(str(bundle), to, tmp_path / "out", "CC-BY-4.0", [])
    said = capsys.readouterr().out
    for what in ("touched", "seen"):
        assert f"{what}: 10000 of 10000 rays within 0.001 m" in said
    stated = json.loads((tmp_path / "out" / EXPORT_RECORD).read_text())
    assert stated["proof"]["holds"]
    assert stated["world"]["format"] == "minexplore-world/3"
    assert stated["proof"]["labels"]["seen/walls"]["pieces"] == 1


def test_floors_have_the_label_friction_and_zone_of_the_world(scene, arrays):
    floors = [part for part in scene.parts if part.label == "floor"]
    assert len(floors) == int((arrays.parts.label == 0).sum())
    assert all(part.zone and part.friction for part in floors)
    assert {surface.label for surface in scene.surfaces} == {"floor", "walls", "roof"}
    seen = sum(len(surface.triangles_m) for surface in scene.surfaces)
    assert seen == len(arrays.facets.faces)


def test_facets_are_seen_from_the_free_space(scene):
    floor = next(surface for surface in scene.surfaces if surface.label == "floor").triangles_m
    assert np.cross(floor[:, 1] - floor[:, 0], floor[:, 2] - floor[:, 0])[:, 2].min() > 0


def test_a_part_that_is_lost_moved_or_besides_is_found(arrays, scene):
    parts = scene.parts
    block = placed_part("rock_9999", "rock", "", 1.0, box_corners(np.ones(3)) + np.array([10.0, 0.0, 1.5]))
    moved = dataclasses.replace(parts[0], centre_m=parts[0].centre_m + np.array([0.0, 0.0, 1e-3]))
    assert compare_parts(scene, read_of(scene)).holds
    assert not compare_parts(scene, read_of(scene, parts=parts[1:])).clauses["parts.unlike"].holds
    assert not compare_parts(scene, read_of(scene, parts=[moved, *parts[1:]])).clauses["parts.off_mm"].holds
    params = compose(["+mine=heights"]).validation.volume
    failures = list(prove_volume(arrays, scene, read_of(scene, parts=[*parts, block]), params).failures())
    assert any("rays at what is touched differ" in line for line in failures)
    assert any("touched/rock" in line for line in failures)


def test_an_export_that_loses_a_surface_leaves_nothing(bundle, tmp_path, monkeypatch):
    whole = FORMATS["gltf"]
    lossy = dataclasses.replace(
        whole, write=lambda scene: whole.write(dataclasses.replace(scene, surfaces=scene.surfaces[:-1]))
    )
    monkeypatch.setitem(FORMATS, "gltf", lossy)
    with pytest.raises(LimitError, match=r"nothing is written: .*seen"):
        export_world(bundle, "gltf", tmp_path / "out", "none", compose(["+mine=heights"]).validation)
    assert list(tmp_path.iterdir()) == []
