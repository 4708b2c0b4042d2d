"""Random points on triangles."""

import numpy as np
import pytest

from pipeline.metrics.rock.sampling import _search_sums, add_noise, sample_triangles, unit_normals


@pytest.mark.parametrize("spread", [0.0, 1.0, 12.0])  # of the logarithms of the areas
def test_sums_are_found_as_numpy_finds_them(spread):
    rng = np.random.default_rng(3)
    total = np.cumsum(np.exp(spread * rng.standard_normal(5000)))
    wanted = np.concatenate([rng.random(20_000) * total[-1], total, [0.0]])
    assert np.array_equal(_search_sums(total, wanted), np.searchsorted(total, wanted))


def test_sums_of_triangles_without_area_are_searched():
    assert _search_sums(np.zeros(3), np.zeros(2)).tolist() == [0, 0]


def test_points_lie_on_their_faces_in_proportion_to_area():
    rng = np.random.default_rng(4)
    small = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    triangles = np.stack([small, 3 * small + [10.0, 0.0, 2.0]])
    points, face = sample_triangles(triangles, 100_000, rng)
    assert (face == 1).mean() == pytest.approx(0.9, abs=0.005)
    assert np.allclose(points[:, 2], np.where(face == 1, 2.0, 0.0), rtol=0, atol=1e-12)
    assert points[face == 1].mean(axis=0) == pytest.approx([11.0, 1.0, 2.0], abs=0.02)  # the centre
    assert unit_normals(triangles).tolist() == [[0, 0, 1], [0, 0, 1]]


def test_noise_moves_a_point_along_its_own_normal_more_than_across():
    normals, face = np.eye(3), np.arange(200_000) % 3
    points = np.zeros((len(face), 3))
    add_noise(points, normals, face, 0.010, 0.003, np.random.default_rng(5))
    along = points[np.arange(len(face)), face]
    across = points[np.arange(len(face)), (face + 1) % 3]
    assert along.std() == pytest.approx(np.hypot(0.010, 0.003), rel=0.01)
    assert across.std() == pytest.approx(0.003, rel=0.01)
    # Blocks of points take the same numbers as all points at once.
    rng = np.random.default_rng(5)
    expected = normals[face] * rng.normal(0, 0.010, (len(face), 1))
    expected += rng.normal(0, 0.003, expected.shape)
    assert np.array_equal(points, expected)
