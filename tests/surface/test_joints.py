import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.surface.relief.gradient_noise import bell, gradient_noise, hashed, self_affine, uniform
from pipeline.surface.relief.joints import Faces, JointedRock, JointSet, Undulation, number_blocks, relief_of_joints

SETS = (JointSet(60, 80, 0.6), JointSet(150, 75, 0.8), JointSet(20, 15, 0.5))
STILL = Undulation(0.0, 0.9, 1.0, 4.0)
FLAT = Faces(0.0, 1.0, 0.0, 0.0)


def wall(step_m=0.05, length_m=20.0, height_m=3.0):
    """A wall in the plane y = 0 that faces north."""
    x, z = np.meshgrid(np.arange(0, length_m, step_m), np.arange(0, height_m, step_m))
    points = np.column_stack([x.ravel(), np.zeros(x.size), z.ravel()])
    return points, np.tile([0.0, 1.0, 0.0], (x.size, 1)), x.shape


def rock(block=FLAT, undulation=STILL, sets=SETS, waviness_m=0.0, patchiness=0.0):
    return JointedRock(sets, 0.8, waviness_m, block, FLAT, 3.0, undulation, 8.0, patchiness)


def test_hashed_numbers_are_uniform_and_bell_numbers_have_mean_0_and_deviation_1():
    word = hashed(3, np.arange(200_000), np.arange(200_000) % 7)
    share, normal = uniform(word, 0), bell(word, 0)
    assert np.histogram(share, 10, (0, 1))[0] == pytest.approx(20_000, rel=0.03)
    assert abs(normal.mean()) < 0.01
    assert normal.std() == pytest.approx(1.0, abs=0.01)
    assert abs(np.corrcoef(share, uniform(word, 1))[0, 1]) < 0.01


def test_hashes_are_those_of_the_published_finaliser_and_leave_their_input_as_it_is():
    def mixed(word):
        for shift, factor in ((33, 0xFF51AFD7ED558CCD), (33, 0xC4CEB9FE1A85EC53), (33, 1)):
            word = (word ^ (word >> shift)) * factor % 2**64
        return word

    numbers = np.array([[-3, 0, 7], [5, -1, 2**40]])
    word = (6 * 0xD6E8FEB86659FD93 + 1) % 2**64
    expected = [
        mixed(mixed(word ^ a * 0x9E3779B97F4A7C15 % 2**64) ^ b * 0xC2B2AE3D27D4EB4F % 2**64)
        for a, b in numbers.T.tolist()
    ]
    kept = numbers.copy()
    word = hashed(6, *numbers)
    assert word.tolist() == expected
    uniform(word, 0)
    assert word.tolist() == expected
    np.testing.assert_array_equal(numbers, kept)


def test_gradient_noise_has_deviation_1_and_its_strongest_wave_is_the_stated_one():
    rng = np.random.default_rng(0)
    places = rng.uniform(-300, 300, (200_000, 3))
    noise = gradient_noise(places, 2.0, 5)
    assert abs(noise.mean()) < 0.03
    assert noise.std() == pytest.approx(1.0, abs=0.03)
    power = np.zeros(400)
    for _ in range(60):
        start, way = rng.uniform(-300, 300, 3), rng.normal(size=3)
        line = start + np.arange(800)[:, None] * 0.1 * way / np.linalg.norm(way)
        power += np.abs(np.fft.rfft(gradient_noise(line, 2.0, 5) * np.hanning(800)))[1:] ** 2
    frequency = np.fft.rfftfreq(800, 0.1)[1:]
    per_octave = np.convolve(frequency * power, np.ones(9) / 9, mode="same")  # a line also meets waves obliquely
    assert 1.4 < 1 / frequency[per_octave.argmax()] < 3.0


def test_the_noise_at_a_place_does_not_depend_on_the_other_places():
    places = np.random.default_rng(1).uniform(-50, 50, (40_000, 3))
    whole = self_affine(places, 0.1, 0.8, 0.5, 4.0, 7)
    np.testing.assert_array_equal(whole[1234:1300], self_affine(places[1234:1300], 0.1, 0.8, 0.5, 4.0, 7))


def test_the_normal_of_a_joint_set_dips_towards_its_dip_direction():
    east = JointSet(90, 30, 1.0).normal
    assert east == pytest.approx([0.5, 0.0, np.sqrt(0.75)])
    down_dip = Rotation.from_rotvec([0, np.pi / 2, 0]).apply(east)  # turned towards the dip direction, downwards
    assert down_dip[0] > 0
    assert down_dip[2] < 0


def test_joints_have_the_spacing_of_their_set_and_later_sets_end_at_earlier_ones():
    sets = (JointSet(0, 0, 0.5), JointSet(90, 90, 1.0))  # level layers, and vertical joints across x
    height = np.column_stack([np.zeros(40_000), np.zeros(40_000), np.linspace(0, 400, 40_000)])
    layer = number_blocks(height, sets[:1], 0.8, 1.0, 4)
    assert np.count_nonzero(np.diff(layer.view(np.int64))) == pytest.approx(400 / 0.5, abs=2)
    x = np.linspace(0, 50, 5001)

    def joints_at(z):
        blocks = number_blocks(np.column_stack([x, 0 * x, 0 * x + z]), sets, 0.8, 1.0, 4)
        return set(np.flatnonzero(np.diff(blocks.view(np.int64))).tolist())

    same, other = joints_at(0.20), joints_at(5.20)
    assert len(same) == pytest.approx(50, abs=4)
    assert len(same & other) < 10  # the joints across do not continue into another layer
    assert joints_at(0.21) == same


def test_faces_are_planes_inside_blocks_and_steps_lie_on_joints():
    points, inward, shape = wall(0.02, 6.0)
    relief = relief_of_joints(points, inward, rock(Faces(0.1, 1.0, 0.2, 0.0)), 3).reshape(shape)
    block = number_blocks(points, SETS, 0.8, 1.0, 503).reshape(shape)
    curved = np.abs(np.diff(relief, 2, axis=1))
    inside = (block[:, 2:] == block[:, 1:-1]) & (block[:, 1:-1] == block[:, :-2])
    assert curved[inside].max() < 1e-12
    assert curved[~inside].mean() > 0.02


def test_a_face_follows_a_joint_set_that_is_nearly_parallel_to_the_wall():
    points, inward, shape = wall()
    along = JointSet(10, 85, 3.0)  # its normal is 11 deg off the wall's
    relief = relief_of_joints(points, inward, rock(Faces(0.0, 1.0, 0.0, 20.0), sets=(along, *SETS[:2])), 3)
    slope = np.gradient(relief.reshape(shape), 0.05, 0.05)
    normal = along.normal / along.normal[1]
    assert np.median(slope[1]) == pytest.approx(-normal[0], abs=1e-6)
    assert np.median(slope[0]) == pytest.approx(-normal[2], abs=1e-6)


def test_the_steps_have_the_stated_deviation_whatever_share_of_blocks_is_stepped():
    points, inward, _ = wall(0.1, 400.0)
    for stepped in (0.25, 1.0):
        relief = relief_of_joints(points, inward, rock(Faces(0.1, stepped, 0.0, 0.0)), 9)
        assert relief.std() == pytest.approx(0.1, rel=0.15)


def test_the_undulation_has_the_stated_deviation_and_a_falling_spectrum():
    points, inward, shape = wall(0.1, 1600.0, 0.15)
    relief = relief_of_joints(points, inward, rock(undulation=Undulation(0.08, 0.9, 1.0, 8.0)), 2).reshape(shape)[0]
    assert relief.std() == pytest.approx(0.08, rel=0.2)
    power = np.abs(np.fft.rfft(relief)) ** 2
    frequency = np.fft.rfftfreq(len(relief), 0.1)
    levels = [power[(frequency > 1 / hi) & (frequency <= 1 / lo)].mean() for lo, hi in ((4, 8), (2, 4), (1, 2))]
    assert levels[0] > 2 * levels[1] > 8 * levels[2]


def test_roughness_varies_along_the_drift_by_the_stated_spread():
    points, inward, shape = wall(0.1, 800.0)
    even, patchy = (
        relief_of_joints(points, inward, rock(Faces(0.05, 1.0, 0.0, 0.0), patchiness=spread), 6).reshape(shape)
        for spread in (0.0, 0.6)
    )
    spread = [np.log(part.reshape(shape[0], -1, 40).std(axis=(0, 2))).std() for part in (even, patchy)]
    assert spread[1] > spread[0] + 0.25


def test_the_relief_of_another_seed_differs():
    points, inward, _ = wall()
    one, two = (relief_of_joints(points, inward, rock(Faces(0.1, 1.0, 0.1, 10.0)), seed) for seed in (1, 2))
    assert abs(np.corrcoef(one, two)[0, 1]) < 0.3


def test_a_block_that_holds_both_walls_of_a_narrow_drift_has_a_relief():
    points = np.array([[0.0, 0.0, 1.0], [0.0, 0.01, 1.0]])
    relief = relief_of_joints(
        points, np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]), rock(Faces(0.1, 1.0, 0.1, 16.0)), 3
    )
    assert np.isfinite(relief).all()
