import numpy as np
import pytest
import shapely

from pipeline.metrics.rock.relief import cut_walls, face_angles_deg, flat_face_share, measure_relief

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
    assert face_angles_deg(flat, DRIFT.boundary)[0] == pytest.approx(0, abs=1e-4)
    assert cut_walls(flat, DRIFT, 1.0).length_ratio == pytest.approx(240 / DRIFT.length, rel=1e-6)
    assert flat_face_share(near_the_entrance(flat)) == pytest.approx(1.0)


def test_a_zigzag_has_the_angle_and_the_length_of_its_slope_and_its_facets_count_when_they_are_large():
    slope = np.tan(np.radians(30))

    def zigzag(length_m):
        return walls_of(lambda x, z: slope * np.abs((x % length_m) - length_m / 2), step_m=length_m / 2)

    wide, narrow = zigzag(1.0), zigzag(0.03)
    assert np.median(face_angles_deg(wide, DRIFT.boundary)[0]) == pytest.approx(30, abs=0.01)
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


def test_steep_shares_follow_the_slope_of_faces_and_find_a_steep_foot():
    def saw(share, slope_deg):
        """Walls of which a share of the length has this slope, and the rest is flat."""
        slope = np.tan(np.radians(slope_deg))
        return walls_of(lambda x, z: slope * np.maximum(0, (x % 1.0) - (1 - share)), step_m=0.1)

    sample = near_the_entrance(walls_of(lambda x, z: 0 * x))
    gentle, steep = (measure_relief(saw(0.4, deg), sample, DRIFT).steep_share for deg in (30, 60))
    assert gentle["above_20_deg"] > 0.4 > gentle["above_40_deg"]  # only the step back is steeper
    assert steep["above_40_deg"] > 0.5
    foot = walls_of(lambda x, z: np.maximum(0, 0.4 - z), step_m=1.0)  # leans by 45 deg up to 0.4 m
    relief = measure_relief(foot, sample, DRIFT)
    assert relief.spacing_m == pytest.approx(0.4)
    by_height = relief.steep_share_by_height
    assert by_height["from_0_cm_to_50_cm"] == {"above_20_deg": 1.0, "above_40_deg": 1.0}
    assert by_height["from_50_cm_to_150_cm"] == by_height["from_150_cm_up"] == {"above_20_deg": 0, "above_40_deg": 0}
    assert relief.steep_share["above_40_deg"] == pytest.approx(np.sqrt(2) / (np.sqrt(2) + 5), abs=1e-3)


def test_a_wall_lower_than_a_band_of_height_has_no_figure_there():
    low = walls_of(lambda x, z: 0 * x, step_m=1.0, height_m=1.6)
    low = low[low[:, :, 2].max(axis=1) < 1.3]
    relief = measure_relief(low, near_the_entrance(low), DRIFT)
    assert list(relief.steep_share_by_height) == ["from_0_cm_to_50_cm", "from_50_cm_to_150_cm"]
