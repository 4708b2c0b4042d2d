"""Worlds scanned again from where the scanner of their scan was."""

import numpy as np
import pytest
import trimesh

from pipeline.types import ClosedMesh, Mesh
from pipeline.volume.world.proof.scan import measure_rays
from pipeline.volume.world.solid import volume_of_solid

SIZE_M = np.array([20.0, 4.0, 3.0])


@pytest.fixture(scope="module")
def volume():
    box = trimesh.creation.box(SIZE_M, trimesh.transformations.translation_matrix(SIZE_M / 2))
    return volume_of_solid(ClosedMesh(np.asarray(box.vertices), box.faces.astype(np.int32), 0.0), 0.36)


@pytest.fixture(scope="module")
def rays():
    """Return 2000 rays from places along the box to places on its sides."""
    rng = np.random.default_rng(0)
    starts = np.column_stack([rng.uniform(1, 19, 2000), np.full(2000, 2.0), np.full(2000, 1.3)])
    way = rng.standard_normal((2000, 3))
    with np.errstate(divide="ignore"):
        far = np.where(way > 0, (SIZE_M - starts) / way, -starts / way).min(axis=1)
    return np.stack([starts, starts + far[:, None] * way], axis=1)


def longer(rays, by_m):
    """Return rays whose measured ranges are longer."""
    way = rays[:, 1] - rays[:, 0]
    unit = way / np.linalg.norm(way, axis=1, keepdims=True)
    return np.stack([rays[:, 0], rays[:, 1] + np.broadcast_to(by_m, len(rays))[:, None] * unit], axis=1)


def test_rays_of_the_world_itself_have_its_ranges(volume, rays):
    found = measure_rays(volume, {}, rays)
    assert np.abs(found.off_m).max() < 1e-4
    assert found.figures["within_5cm"] == 1
    assert (found.figures["through_share"], found.figures["short_share"]) == (0, 0)


def test_differences_are_positive_where_the_world_is_farther(volume, rays):
    found = measure_rays(volume, {}, longer(rays, -0.04))
    assert found.figures["median_mm"] == pytest.approx(40, abs=0.1)
    assert found.figures["rms_mm"] == pytest.approx(40, abs=0.1)
    assert found.figures["p95_mm"] == pytest.approx(40, abs=0.1)


def test_a_wall_that_is_missing_and_one_that_was_not_there_are_told_apart_and_placed(volume, rays):
    by = np.where(rays[:, 0, 0] > 15, -0.5, 0.0)  # the scanner saw something before these walls
    through = measure_rays(volume, {}, longer(rays, by)).figures
    far = float((rays[:, 0, 0] > 15).mean())
    assert (through["through_share"], through["short_share"]) == (pytest.approx(far, abs=1e-6), 0)
    assert through["worst_within_10cm"] == pytest.approx(0.5, abs=0.1)
    assert 12 < through["worst_x_m"] < 18
    short = measure_rays(volume, {}, longer(rays, -by)).figures
    assert (short["through_share"], short["short_share"]) == (0, pytest.approx(far, abs=1e-6))


def test_rays_stop_at_the_visible_rock_and_at_the_floor(volume, rays):
    inner = trimesh.creation.box(SIZE_M - [0.2, 0.2, 0], trimesh.transformations.translation_matrix(SIZE_M / 2))
    upright = np.abs(inner.face_normals[:, 2]) < 0.5
    rock = {"rock": Mesh(np.asarray(inner.vertices), inner.faces[upright].astype(np.int32), np.zeros((8, 2)))}
    found = measure_rays(volume, rock, rays)
    floor = rays[:, 1, 2] < 1e-6
    inside = (np.abs(rays[:, 1, :2] - SIZE_M[:2] / 2) < SIZE_M[:2] / 2 - 0.2).all(axis=1)
    assert np.abs(found.off_m[floor & inside]).max() < 1e-4
    sides = (rays[:, 1, 1] < 1e-6) | (rays[:, 1, 1] > SIZE_M[1] - 1e-6)
    assert found.off_m[sides].max() <= -0.1 + 1e-4


def test_few_rays_have_no_worst_place(volume, rays):
    assert "worst_within_10cm" not in measure_rays(volume, {}, rays[:50]).figures
