import numpy as np
import pytest
import shapely

from pipeline.metrics.relief import cut_walls, face_angle_deg, flat_face_share, line_factor
from pipeline.metrics.roughness import SurfaceRoughness

DRIFT = shapely.box(0, 0, 120, 6)


def walls_of(offset, step_m=0.05, height_m=2.4):
    """Both long walls of the drift; `offset(x, z)` moves them into the workings."""
    triangles = []
    for base, inward in ((0.0, 1.0), (6.0, -1.0)):
        x, z = np.meshgrid(np.arange(0, 120.01, step_m), np.arange(0, height_m + 0.01, 0.4))
        points = np.stack([x, base + inward * offset(x, z), z], axis=-1)
        a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
        triangles += [np.stack(t, axis=-2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))]
    return np.concatenate(triangles)


def near_the_entrance(triangles):
    return triangles[triangles[:, :, 0].max(axis=1) < 6]


def test_flat_walls_have_no_angle_the_length_of_the_plan_and_only_flat_faces():
    flat = walls_of(lambda x, z: 0 * x)
    assert face_angle_deg(flat, DRIFT.boundary) == pytest.approx(0, abs=1e-4)
    assert cut_walls(flat, DRIFT, 1.0).length_ratio == pytest.approx(240 / DRIFT.length, rel=1e-6)
    assert flat_face_share(near_the_entrance(flat)) == pytest.approx(1.0)


def test_a_zigzag_has_the_angle_and_the_length_of_its_slope_and_its_facets_count_when_they_are_large():
    slope = np.tan(np.radians(30))

    def zigzag(length_m):
        return walls_of(lambda x, z: slope * np.abs((x % length_m) - length_m / 2), step_m=length_m / 2)

    wide, narrow = zigzag(1.0), zigzag(0.03)
    assert face_angle_deg(wide, DRIFT.boundary) == pytest.approx(30, abs=0.01)
    assert cut_walls(wide, DRIFT, 1.0).length_ratio == pytest.approx(240 / DRIFT.length / np.cos(np.radians(30)), 1e-3)
    assert flat_face_share(near_the_entrance(wide)) == pytest.approx(1.0)
    assert flat_face_share(near_the_entrance(narrow)) < 0.05


@pytest.mark.parametrize("exponent", [-2.0, -3.5])
def test_the_slope_of_a_power_law_is_found_in_every_octave(exponent):
    rng = np.random.default_rng(0)
    x = np.arange(0, 120.01, 0.02)
    frequency = np.fft.rfftfreq(len(x), 0.02)
    frequency[0] = np.inf
    phase = np.exp(2j * np.pi * rng.random(len(frequency)))
    line = np.fft.irfft(phase * frequency ** (exponent / 2), len(x))
    line *= 0.05 / line.std()
    cut = cut_walls(walls_of(lambda at, z: np.interp(at, x, line), step_m=0.02), DRIFT, 1.0)
    assert [*cut.slope.values()] == pytest.approx([exponent] * 3, abs=0.6)  # an octave holds few waves


def test_the_typical_factor_counts_too_rough_and_too_smooth_alike():
    measured = SurfaceRoughness(True, [0.3, 0.5, 1.0], [0.001, 0.004, 0.01], [], None, None, {})
    assert line_factor({"at_50_cm": 0.004, "at_100_cm": 0.01}, measured) == pytest.approx(1.0)
    assert line_factor({"at_50_cm": 0.008, "at_100_cm": 0.005}, measured) == pytest.approx(2.0)
    assert line_factor({"at_50_cm": 0.008, "at_100_cm": 0.01}, measured) == pytest.approx(np.sqrt(2))
