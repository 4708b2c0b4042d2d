"""The checks of an export find what a file loses, moves or renames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from minexplore.bundle import MODEL, GeomGroup
from pipeline.errors import ArtifactError
from pipeline.export.checks.clauses import OF_PHYSICS, certify_parts
from pipeline.export.checks.pieces import PART_GROUPS, match_labels, pieces_of_model
from pipeline.export.checks.prove import prove
from pipeline.export.checks.rays import RAYS, RayTest, cast_at_model, starts_in_plan
from pipeline.export.labels import group_of
from pipeline.export.scene import box_corners, hull_triangles, placed_part
from pipeline.mjcf.loading import load_model
from pipeline.proof.rebuilt.remake import read_free_space


def changed(items: list, at: int, **fields: object) -> list:
    """Return a list with changed fields of one item."""
    return [replace(item, **fields) if k == at else item for k, item in enumerate(items)]


def at_label(items: list, label: str) -> int:
    """Return the number of the first item of a label."""
    return next(k for k, item in enumerate(items) if item.label == label)


def test_a_file_that_holds_what_the_world_holds_passes_every_check(world):
    proof = prove(world.bundle, world.opened, world.scene, world.read, world.params)
    assert list(proof.failures()) == []
    assert proof.holds
    assert {name: rays.agree for name, rays in proof.rays.items()} == {"touched": RAYS, "seen": RAYS}
    assert set(proof.certificate.clauses) == set(world.params.certificate.limits) - set(OF_PHYSICS)
    assert {"seen/walls", "seen/roof", "touched/rock", "touched/roof"} <= proof.labels.keys()


def test_a_part_that_is_not_seen_in_a_world_without_visible_rock_is_found(bare):
    kept = [surface for surface in bare.scene.surfaces if surface.label != "roof"]
    failures = list(
        prove(bare.bundle, bare.opened, bare.scene, replace(bare.read, surfaces=kept), bare.params).failures()
    )
    assert any("rays at what is seen differ" in line for line in failures)
    assert any(line.startswith("seen/roof: 0 pieces") for line in failures)


def test_a_lost_light_and_a_changed_friction_fail(world):
    parts = changed(world.scene.parts, 0, friction=0.1)
    read = replace(world.read, lights=world.read.lights - 1, parts=parts)
    failures = list(prove(world.bundle, world.opened, world.scene, read, world.params).failures())
    assert [line.partition(":")[0] for line in failures] == ["frictions", "lights"]


def rays_at(world, groups):
    """Return the test of rays at the geoms of some groups."""
    T, free = np.array(world.opened.record.T_world_mine), read_free_space(world.bundle).polygon
    draw = starts_in_plan(free)
    return RayTest(draw, cast_at_model(load_model(world.bundle / MODEL), T, groups))


@pytest.mark.parametrize(("shift_m", "alike"), [(0.0, True), (1e-6, True), (0.003, False)])
def test_rays_find_rock_that_moved_by_more_than_a_millimetre(world, shift_m, alike):
    test = rays_at(world, PART_GROUPS)
    triangles = np.concatenate([hull_triangles(part) for part in world.scene.parts])
    match = test.compare(triangles + np.array([0.0, 0.0, shift_m]), seed=3)
    assert match.holds == alike
    assert alike or match.worst_m > shift_m


def test_rays_find_a_chunk_of_visible_rock_that_is_missing(world):
    test = rays_at(world, (GeomGroup.ROUGH_SURFACE,))
    lost = at_label(world.scene.surfaces, "walls")
    kept = [surface.triangles_m for k, surface in enumerate(world.scene.surfaces) if k != lost]
    assert not test.compare(np.concatenate(kept), seed=3).holds


def test_labels_find_a_piece_that_is_lost_renamed_or_changed_in_size(world):
    zones = [zone.name for zone in world.opened.record.zones]

    def failing(**fields: object) -> list[str]:
        matches = match_labels(pieces_of_model(load_model(world.bundle / MODEL), zones), replace(world.read, **fields))
        return [label for label, match in matches.items() if not match.holds]

    parts, surfaces = world.scene.parts, world.scene.surfaces
    walls, rock = at_label(surfaces, "walls"), at_label(parts, "rock")
    assert failing() == []
    assert failing(surfaces=surfaces[:walls] + surfaces[walls + 1 :]) == ["seen/walls"]
    assert failing(surfaces=changed(surfaces, walls, label="roof")) == ["seen/roof", "seen/walls"]
    assert failing(parts=changed(parts, rock, corners_m=1.001 * parts[rock].corners_m)) == ["touched/rock"]
    assert failing(parts=changed(parts, rock, label="ore")) == ["touched/ore", "touched/rock"]


def test_the_certificates_clauses_find_a_lost_part_and_a_box_across_a_drift(world):
    def failing(parts: list) -> set[str]:
        read = replace(world.read, parts=parts)
        certificate = certify_parts(world.bundle, world.opened, read, world.params)
        return {name for name, clause in certificate.clauses.items() if not clause.holds}

    parts = world.scene.parts
    rock, roof = at_label(parts, "rock"), at_label(parts, "roof")
    corners = box_corners(np.array([0.3, 4.0, 1.5])) + np.array([32.0, 2.0, 1.5])
    across = placed_part("rock_9999", "rock", "", 1.0, corners, is_box=True)
    assert {"missing_mm"} <= failing(parts[:rock] + parts[rock + 1 :])
    assert {"intrusion_mm", "only_plan_m2"} <= failing([*parts, across])
    assert {"roof_open_m2"} <= failing(changed(parts, roof, centre_m=parts[roof].centre_m + np.array([0.0, 0.0, 0.1])))


def test_a_part_of_a_label_that_no_collision_part_has_is_refused():
    with pytest.raises(ArtifactError, match="label 'ore': a collision part has rock, floor, roof"):
        group_of("ore")
