"""The volume that a scan's points bound: exact drifts are found again, and what is not rock is left out."""

import manifold3d
import numpy as np
import pytest
import trimesh

from minesurveys.clouds.point_blocks import PointBlock
from pipeline.errors import InputError
from pipeline.survey.clouds.thinned import ThinnedCloud, thin
from pipeline.survey.clouds.volume import volume_of_cloud

LONG_M, WIDE_M, HIGH_M = 14.0, 4.0, 3.0
VOXEL_M, NOISE_M = 0.2, 0.02
PERSON = ((9.0, 2.0), (0.5, 0.4, 1.7))


def drift():
    return manifold3d.Manifold.cube([LONG_M, WIDE_M, HIGH_M])


def sampled(solid, per_m2=150, seed=0):
    mesh = solid.to_mesh()
    found = trimesh.Trimesh(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts), process=False)
    return np.asarray(trimesh.sample.sample_surface(found, int(found.area * per_m2), seed=seed)[0])


def noisy(points, seed=1):
    return points + np.random.default_rng(seed).normal(0, NOISE_M, points.shape)


def scanned(points, **values):
    return volume_of_cloud(thin(iter([PointBlock(points)]), VOXEL_M / 2, 10**6), VOXEL_M, 0.03, 20_000, **values)


def solid_of(found):
    return manifold3d.Manifold(manifold3d.Mesh64(found.vertices, found.faces.astype(np.uint64)))


def iou(found, truth):
    one = solid_of(found)
    return (one ^ truth).volume() / (one + truth).volume()


@pytest.fixture(scope="module")
def plain():
    return noisy(sampled(drift()))


@pytest.fixture(scope="module")
def closed(plain):
    return scanned(plain)


def test_the_volume_of_a_noisy_scan_is_that_of_the_drift(closed):
    assert iou(closed, drift()) >= 0.97


def test_floors_are_smoothed_within_the_noise(closed):
    corner = closed.vertices[closed.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    size = np.linalg.norm(normal, axis=1)
    floor = (normal[:, 2] < -0.95 * size) & (np.abs(corner.mean(axis=1)[:, :2] - [7, 2]) < [6.5, 1.6]).all(axis=1)
    assert np.sqrt(np.average(corner.mean(axis=1)[floor, 2] ** 2, weights=size[floor])) <= 0.03


def test_normals_point_out_of_the_free_space(closed):
    assert solid_of(closed).volume() > 0


def test_nothing_is_left_out_of_a_plain_drift(closed):
    assert (closed.things, closed.gaps, closed.others_m3, len(closed.beyond_m)) == ([], [], [], 0)


def test_a_person_is_left_out_and_listed_with_place_and_size(plain):
    (x, y), size = PERSON
    person = manifold3d.Manifold.cube(list(size), center=True).translate([x, y, size[2] / 2])
    found = scanned(np.concatenate([plain, sampled(person, 400)]))
    assert len(found.things) == 1
    assert found.things[0].middle_m[:2] == pytest.approx((x, y), abs=0.2)
    assert found.things[0].size_m[2] == pytest.approx(size[2], abs=0.3)
    assert iou(found, drift()) >= 0.97


def test_a_vehicle_near_a_wall_is_left_out(plain):
    low, size = np.array([5.0, 0.6, 0.35]), [4.2, 1.7, 1.4]
    found = scanned(np.concatenate([plain, sampled(manifold3d.Manifold.cube(size).translate(low.tolist()), 200)]))
    assert [thing.middle_m[:2] for thing in found.things] == [pytest.approx((7.1, 1.45), abs=0.2)]
    assert iou(found, drift()) >= 0.97


def test_a_pillar_that_reaches_the_roof_is_rock(plain):
    pillar = manifold3d.Manifold.cube([1.2, 1.2, HIGH_M], center=True).translate([7, 2, HIGH_M / 2])
    found = scanned(noisy(sampled(drift() - pillar)))
    assert found.things == []
    assert solid_of(found).volume() == pytest.approx((drift() - pillar).volume(), rel=0.03)


def test_a_rope_across_the_drift_is_left_out_and_listed(plain):
    rope = np.column_stack([np.full(400, 5.0), np.linspace(0, WIDE_M, 400), np.full(400, 1.8)])
    found = scanned(np.concatenate([plain, noisy(rope)]))
    assert len(found.thin_points_m) >= 30
    assert np.abs(found.thin_points_m[:, [0, 2]] - [5.0, 1.8]).max() < 5 * NOISE_M
    assert iou(found, drift()) >= 0.97


def test_a_hole_is_closed_in_the_plane_of_the_points_about_it_and_listed(plain):
    middle = np.array([7.0, 2.0, 0.0])
    found = scanned(plain[np.linalg.norm(plain - middle, axis=1) > 1.0])
    assert len(found.gaps) == 1
    assert found.gaps[0].width_m == pytest.approx(2.0, abs=0.3)
    assert iou(found, drift()) >= 0.97


def test_a_drift_without_a_last_wall_ends_where_the_scan_does(plain):
    found = scanned(plain[plain[:, 0] < LONG_M - 0.1])
    assert found.gaps[0].width_m > 3.0
    assert found.vertices[:, 0].max() == pytest.approx(LONG_M, abs=4 * VOXEL_M + 2 * NOISE_M)
    assert solid_of(found).volume() == pytest.approx(drift().volume(), rel=0.06)


def test_a_drift_most_of_whose_roof_nobody_saw_lacks_its_roof(plain, closed):
    found = scanned(plain[(plain[:, 2] < HIGH_M - 0.1) | (plain[:, 0] < 3.0)])
    assert found.missing == ["above most of its floor there are no points: it has no roof"]
    assert solid_of(found).volume() == pytest.approx(drift().volume(), rel=0.06)
    assert closed.missing == []


def test_dust_in_the_air_makes_no_rock(plain):
    stray = np.random.default_rng(4).uniform([0.5, 0.5, 0.5], [LONG_M - 0.5, WIDE_M - 0.5, HIGH_M - 0.5], (800, 3))
    found = scanned(np.concatenate([plain, stray]))
    assert found.strays >= 500
    assert len(solid_of(found).decompose()) == 1
    assert iou(found, drift()) >= 0.97


def test_points_beyond_the_walls_bound_nothing(plain):
    far = noisy(np.random.default_rng(3).uniform([0, 8, 0], [14, 8, 3], (2000, 3)))
    found = scanned(np.concatenate([plain, far]))
    assert len(found.beyond_m) >= 150
    assert iou(found, drift()) >= 0.97


def test_a_place_of_the_scanner_chooses_the_space_that_is_built(plain):
    other = manifold3d.Manifold.cube([6, 3, 3]).translate([0, 10, 0])
    points = np.concatenate([plain, noisy(sampled(other))])
    assert solid_of(scanned(points)).volume() == pytest.approx(drift().volume(), rel=0.03)
    found = scanned(points, way_m=np.array([[3.0, 11.5, 1.5]]))
    assert solid_of(found).volume() == pytest.approx(other.volume(), rel=0.04)


@pytest.mark.slow
def test_what_a_wet_floor_mirrors_is_not_built(plain):
    hole = np.linalg.norm(plain[:, :2] - [7, 2], axis=1) < 0.6
    mirrored = plain * [1, 1, -1] - [0, 0, 0.3]
    points = np.concatenate([plain, mirrored])[np.concatenate([~(hole & (plain[:, 2] < 0.1))] * 2)]
    way = np.column_stack([np.arange(1, 14), np.full(13, 2.0), np.full(13, 1.3)])
    assert solid_of(scanned(points)).volume() == pytest.approx(drift().volume(), rel=0.08)  # one of two alike
    found = scanned(points, way_m=way)
    assert iou(found, drift()) >= 0.92  # a cone below the hole was seen
    assert len(found.beyond_m) > 0.6 * len(thin(iter([PointBlock(mirrored)]), VOXEL_M / 2, 10**6))


@pytest.mark.parametrize("rise", [0.0, 0.3])
@pytest.mark.parametrize(
    ("kept", "message"),
    [
        ([(2, HIGH_M, False)], r"above most of its floor there are no points: it has no roof$"),
        ([(2, 0.0, False)], r"below most of its roof there are no points: it has no floor$"),
        ([(2, 0.0, True)], r"above and below most of its level surface there are no points: it is a floor or a roof"),
        (
            [(2, HIGH_M, False), (1, WIDE_M, False)],
            r"above .* no roof; opposite most of its walls there are no points",
        ),
    ],
)
def test_points_that_enclose_nothing_are_refused_with_what_they_lack(plain, rise, kept, message):
    rows = np.ones(len(plain), bool)
    for axis, place, is_kept in kept:
        rows &= (np.abs(plain[:, axis] - place) < 0.1) == is_kept
    inclined = plain[rows] + np.outer(rise * plain[rows, 0], [0, 0, 1])
    with pytest.raises(InputError, match=r"its points bound no space of 5 m3: " + message):
        scanned(inclined)


def test_another_voxel_is_advised_only_where_nothing_is_missing():
    narrow = noisy(sampled(manifold3d.Manifold.cube([LONG_M, 0.8, 0.8])))
    with pytest.raises(InputError, match=r"m3 are needed; --voxel M \(now 0\.2\) .* narrower than ten times that$"):
        scanned(narrow)
    found = volume_of_cloud(thin(iter([PointBlock(narrow)]), 0.025, 10**6), 0.05, 0.03, 20_000)
    assert solid_of(found).volume() == pytest.approx(LONG_M * 0.8**2, rel=0.05)


def test_a_scan_in_blocks_is_thinned_as_a_whole(plain):
    whole, blocks = (
        thin(iter([PointBlock(plain)]), 0.1, 10**6),
        thin(map(PointBlock, np.array_split(plain, 7)), 0.1, 10**6),
    )
    assert isinstance(whole, ThinnedCloud)
    assert whole.points_m == pytest.approx(blocks.points_m)
    assert (whole.count.sum(), blocks.total) == (len(plain), len(plain))


def test_a_look_at_a_large_scan_takes_larger_voxels_with_the_same_means(plain):
    found = thin(map(PointBlock, np.array_split(plain, 7)), 0.01, 3000, coarsen=True)
    assert 500 < len(found) <= 3000
    assert found.count.sum() == found.total == len(plain)
    assert np.average(found.points_m, axis=0, weights=found.count) == pytest.approx(plain.mean(axis=0))


def test_more_voxels_than_the_limit_are_refused(plain):
    with pytest.raises(InputError, match=r"fill more than 500 voxels of 0\.1 m; --voxel"):
        thin(iter([PointBlock(plain)]), 0.1, 500)
    assert len(thin(iter([PointBlock(plain)]), 1.0, 500)) <= 500
