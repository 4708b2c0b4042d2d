import dataclasses
import math

import numpy as np
import pytest
import shapely
import trimesh
from scipy.spatial import cKDTree

from minexplore import bundle
from pipeline.geometry.ray_scene import ray_scene
from pipeline.metrics.rock.planefit import sweep_residuals
from pipeline.surface.chunks import cut_chunks
from pipeline.surface.mesh.displacement import Bounds, bound_displacement
from pipeline.surface.mesh.lattice import ROOF, WALL, CrossSection, lay_lattice
from pipeline.surface.mesh.mesh_checks import check_mesh, find_crossings, find_shared_edges
from pipeline.surface.mesh.rough import closed_mesh, displace_lattice
from pipeline.surface.mesh.simplify import Mesher, Simplification
from pipeline.surface.mesh.walls import lay_walls
from pipeline.surface.relief.noise import Modulation, relief_of_noise
from pipeline.surface.relief.spectrum import Bands, Roughness, band_wavelengths
from tests.composed import compose
from tests.mines import STRAIGHT, random_mine
from tests.surface.spectra import flat_bands, predicted_rq

PROFILE = CrossSection(3.5, 0.3, 0.9, 2.75)
BOUNDS = Bounds(0.45, 0.45, 1.2, 2.2, 0.02, 0.0, 1.0, 0.5, 0.45)
STEADY = Modulation(8.0, 0.0)
# A drift, a ring and a tee with all kinds of corners, and no longer than two or three tiles of 20 m.
DRIFT = shapely.box(0, 0, 45, 5)
RING = shapely.box(0, 0, 32, 24).difference(shapely.box(6, 6, 26, 18))
TEE = shapely.union_all([shapely.box(0, 0, 40, 5), shapely.box(18, 5, 23, 22)])


def rough_of(free, rms_m=0.1, spacing=0.2, seed=0, bounds=BOUNDS, simplification=None):
    lattice = lay_lattice(lay_walls(free, spacing), PROFILE, spacing, spacing)
    bands = flat_bands(rms_m)
    wanted = relief_of_noise(lattice, bands, bands, STEADY, np.random.default_rng(seed))
    return displace_lattice(Mesher(lattice, simplification), wanted, bounds)


@pytest.mark.parametrize("mine", [DRIFT, RING, TEE], ids=["straight", "ring", "tee"])
def test_the_rough_surface_and_the_floor_are_closed_at_corners_junctions_and_islands(mine):
    report = check_mesh(*closed_mesh(rough_of(mine)))
    assert report.watertight
    assert report.winding_consistent
    assert not report.self_intersecting


@pytest.mark.slow
def test_random_mines_have_a_rough_surface_without_crack_or_crossing():
    for seed in range(6):
        rng = np.random.default_rng(seed)
        check_mesh(*closed_mesh(rough_of(random_mine(rng, int(rng.integers(2, 6))), rms_m=0.2, seed=seed)))


def test_without_noise_the_rough_surface_has_the_volume_of_its_cross_section():
    """Straight drift: rectangle up to the walls' top, parabolic arch, 45 deg chamfers at the floor."""
    long = shapely.box(0, 0, 50, 7)
    report = check_mesh(*closed_mesh(rough_of(long, rms_m=1e-9, spacing=0.1)))
    arch = 0.9 * (7 - 2 * 2.75 / 3)  # on each side, a parabola over the half span covers two thirds of its box
    section = 7 * 2.6 + arch - 0.3**2
    assert report.volume_m3 == pytest.approx(50 * section, rel=0.015)


def test_neighbouring_points_are_no_farther_apart_than_the_spacing():
    lattice = lay_lattice(lay_walls(TEE, 0.1), PROFILE, 0.1, 0.14)
    for piece, spacing in ((WALL, 0.1), (ROOF, 0.14)):
        faces = lattice.faces[lattice.piece == piece]
        faces = faces[lattice.vertices[faces, 2].min(axis=1) > 0.35]  # above the floor chamfer, which slopes
        edges = lattice.vertices[faces] - lattice.vertices[np.roll(faces, 1, axis=1)]
        plan = np.linalg.norm(edges[..., : 3 if piece == WALL else 2], axis=2)
        assert np.percentile(plan, 90) <= spacing * math.sqrt(2) * 1.001  # the diagonal of a square
        assert plan.max() <= 2.3 * spacing  # where the roof's grid joins the walls


def test_the_same_seed_gives_identical_points_and_another_seed_different_ones():
    one, two, other = (rough_of(DRIFT, seed=s).vertices for s in (3, 3, 4))
    np.testing.assert_array_equal(one, two)
    assert np.abs(one - other).max() > 0.05


def test_the_bound_is_smooth_keeps_small_displacements_and_is_never_exceeded():
    lattice = lay_lattice(lay_walls(STRAIGHT, 0.5), PROFILE, 0.5, 0.5)
    wide = np.flatnonzero((lattice.walls.free_m > 2.3)[lattice.column] & (lattice.roof_share == 0))[0]
    wanted = np.zeros(len(lattice.vertices))
    curve = []
    for w in np.linspace(-2, 2, 401):
        wanted[wide] = w
        curve.append(bound_displacement(wanted, lattice, BOUNDS)[wide])
    assert np.abs(curve).max() < 0.45
    assert curve[210] == pytest.approx(0.1, rel=0.03)
    assert (np.diff(curve) > 0).all()
    assert np.abs(np.diff(curve, 2)).max() < 5e-4


def test_a_narrow_passage_keeps_its_width_and_a_thin_pillar_does_not_intersect_itself():
    narrow = shapely.union_all([shapely.box(0, 0, 14, 6), shapely.box(14, 2.25, 28, 3.75), shapely.box(28, 0, 42, 6)])
    rough = rough_of(narrow, rms_m=0.2, spacing=0.1)
    height = rough.vertices[:, 2]
    walls = rough.vertices[: rough.lattice.wall_vertices][np.abs(height[: rough.lattice.wall_vertices] - 1) < 0.06]
    axis = np.column_stack([np.arange(17, 25, 0.1), np.full(80, 3.0)])
    assert 2 * cKDTree(walls[:, :2]).query(axis)[0].min() >= 0.95 * 1.5
    pillar = shapely.box(0, 0, 22, 12.4).difference(shapely.box(6, 6, 16, 6.4))
    check_mesh(*closed_mesh(rough_of(pillar, rms_m=0.2, spacing=0.1)))


def test_the_rock_on_both_sides_of_a_wall_as_thick_as_a_wheel_does_not_meet():
    rock = shapely.union_all([shapely.box(4, 5.85, 30, 6.15), shapely.box(10, 2, 10.3, 2.3)])
    halls = shapely.box(0, 0, 30, 12).difference(rock)
    walls = lay_walls(halls, 0.1, thinnest_rock_m=0.0)
    inner = (walls.xy[:, 0] > 5) & (walls.xy[:, 0] < 28) & (np.abs(walls.xy[:, 1] - 6) < 0.2)
    assert walls.rock_m[inner] == pytest.approx(0.15, abs=0.01)
    column = shapely.distance(shapely.points(walls.xy), shapely.Point(10.15, 2.15)) < 0.3
    assert walls.rock_m[column].max() < 0.2
    assert lay_walls(halls, 0.1).rock_m[inner].min() > 0.4  # of mines, whose pillars are thicker
    lattice = lay_lattice(walls, PROFILE, 0.1, 0.2)
    bands = flat_bands(0.2)
    wanted = relief_of_noise(lattice, bands, bands, STEADY, np.random.default_rng(0))
    rough = displace_lattice(Mesher(lattice, None), wanted, BOUNDS)
    check_mesh(*closed_mesh(rough))
    column = lattice.column[: lattice.wall_vertices]
    north, y = walls.inward[column, 1] > 0, rough.vertices[: lattice.wall_vertices, 1]
    assert y[inner[column] & north].min() - y[inner[column] & ~north].max() > 0.1


def test_the_recess_keeps_a_narrow_mine_wide_and_rough():
    def walls_of(bounds):
        rough = rough_of(drift, rms_m=0.12, spacing=0.15, bounds=bounds)
        walls = rough.vertices[: rough.lattice.wall_vertices]
        return walls[(np.abs(walls[:, 2] - 1) < 0.06) & (walls[:, 0] > 5) & (walls[:, 0] < 95)]

    drift = shapely.box(0, 0, 100, 3.6)
    axis = np.column_stack([np.arange(8, 92, 0.1), np.full(840, 1.8)])
    own = Bounds(**compose(["survey=procedural"]).surface.rough.bounds.model_dump())
    recessed = walls_of(own)
    flat = walls_of(dataclasses.replace(own, narrow_recess_m=0.0))
    kept, flat_kept = (cKDTree(w[:, :2]).query(axis)[0] / 1.8 for w in (recessed, flat))
    assert kept.min() >= 0.95
    assert flat_kept.mean() < kept.mean()
    rough, flat_rough = (np.std(w[w[:, 1] > 1.8, 1]) for w in (recessed, flat))
    assert rough > 1.05 * flat_rough


@pytest.mark.parametrize(("width", "grows"), [(3.0, True), (6.0, False)])
def test_the_gain_enlarges_the_relief_of_narrow_passages_only(width, grows):
    drift = shapely.box(0, 0, 30, width)
    own = Bounds(**compose(["survey=procedural"]).surface.rough.bounds.model_dump())
    with_gain, without = (
        rough_of(drift, rms_m=0.08, spacing=0.15, bounds=dataclasses.replace(own, narrow_gain=gain))
        for gain in (1.5, 1.0)
    )
    middle = np.abs(with_gain.lattice.vertices[:, 0] - 15) < 8
    if grows:
        assert with_gain.given_m[middle].std() > 1.1 * without.given_m[middle].std()
    else:
        assert (with_gain.given_m[middle] == without.given_m[middle]).all()


def test_half_of_the_walls_of_a_short_wide_mine_stay_within_the_median():
    tee = shapely.union_all([shapely.box(0, 0, 22, 7), shapely.box(8, 7, 15, 18)])
    own = Bounds(**compose(["survey=procedural"]).surface.rough.bounds.model_dump())

    def medians(bounds):
        rough = rough_of(tee, rms_m=0.3, spacing=0.15, bounds=bounds)
        moved = np.abs(rough.given_m[: rough.lattice.wall_vertices]).reshape(rough.lattice.rows, -1)
        return np.median(moved, axis=1)[4:]

    assert medians(dataclasses.replace(own, median_m=0.9)).max() > 0.15
    assert medians(own).max() <= own.median_m + 1e-9


def test_a_self_intersection_is_repaired_and_its_place_is_recorded():
    needle = shapely.union_all([shapely.box(0, 0, 20, 5), shapely.Polygon([(20, 1.5), (20, 3.5), (26, 2.5)])])
    loose = Bounds(0.9, 0.9, 0.05, 0.06, 0.9, 0.0, 1.0, 0.9, 0.9)
    rough = rough_of(needle, rms_m=0.5, spacing=0.15, bounds=loose)
    assert len(rough.mended)
    check_mesh(*closed_mesh(rough))


def test_a_crossing_far_from_the_origin_is_found():
    rough = rough_of(STRAIGHT, spacing=0.25)
    vertices, faces = closed_mesh(rough)
    assert len(find_crossings(vertices, faces)) == 0
    distance = np.linalg.norm(vertices[:, :2] - [90, 2.5], axis=1)
    k = int(np.argmin(distance + 10 * (vertices[:, 2] < 3)))
    vertices = vertices.copy()
    vertices[k, 2] -= 5.0  # a spike from the roof through the floor
    crossings = find_crossings(vertices, faces)
    assert len(crossings)
    assert np.linalg.norm(crossings[:, :2] - vertices[k, :2], axis=1).min() < 0.6


def test_chunks_lie_in_their_tiles_and_cover_the_rough_surface_once():
    rough = rough_of(TEE, spacing=0.25)
    chunks = cut_chunks(rough, 20.0, 4.0)
    assert sum(len(m.faces) for m in chunks.values()) == len(rough.lattice.faces)
    area = sum(trimesh.Trimesh(m.vertices, m.faces, process=False).area for m in chunks.values())
    whole = trimesh.Trimesh(rough.vertices, rough.lattice.faces, process=False).area
    assert area == pytest.approx(whole, rel=1e-9)
    for name, mesh in chunks.items():
        piece, col, row = name.split("_")
        assert piece in (bundle.WALLS, bundle.ROOF)
        low = rough.lattice.vertices[:, :2].min(axis=0) + 20.0 * np.array([int(col), int(row)])
        assert (mesh.vertices[:, :2] > low - 1.5).all()
        assert (mesh.vertices[:, :2] < low + 21.5).all()


def test_a_single_face_in_a_tile_joins_a_neighbouring_tile():
    rough = rough_of(shapely.box(0, 0, 16, 5), spacing=0.25)
    centre = rough.lattice.vertices[rough.lattice.faces].mean(axis=1)[:, :2]
    for tile_m in (0.17, 0.22):
        tiles = np.floor((centre - rough.lattice.vertices[:, :2].min(axis=0)) / tile_m)
        piece = rough.lattice.piece[:, None]
        assert (
            np.unique(np.hstack([piece, tiles]), axis=0, return_counts=True)[1] == 1
        ).any()  # some faces are alone in their tiles
        chunks = cut_chunks(rough, tile_m, 4.0)
        assert min(len(mesh.vertices) for mesh in chunks.values()) >= 4
        assert sum(len(mesh.faces) for mesh in chunks.values()) == len(rough.lattice.faces)


def test_the_texture_continues_across_the_seam_of_a_ring():
    for name, mesh in cut_chunks(rough_of(RING, spacing=0.25), 20.0, 4.0).items():
        corner = mesh.texcoords[mesh.faces]
        assert np.ptp(corner[..., 0], axis=1).max() < 0.5, name


def test_the_texture_is_not_stretched_round_a_thin_column():
    hall = shapely.box(0, 0, 12, 8).difference(shapely.Point(6, 4).buffer(0.15))
    for mesh in cut_chunks(rough_of(hall, rms_m=1e-9, spacing=0.1), 50.0, 4.0).values():
        corner = mesh.vertices[mesh.faces]
        near = np.linalg.norm(corner[..., :2] - [6, 4], axis=2) < 0.3
        upright = (near & (corner[..., 2] > 0.5) & (corner[..., 2] < 2.5)).all(axis=1)
        along_m = np.ptp(mesh.texcoords[mesh.faces][upright][..., 0], axis=1) * 4.0
        wide_m = np.linalg.norm(np.ptp(corner[upright][..., :2], axis=1), axis=1)
        assert (along_m <= 1.1 * wide_m).all()


def test_the_built_wall_has_the_roughness_that_its_spectrum_predicts():
    """A straight wall in the middle of the voxels, with the points of all voxels."""
    waves = band_wavelengths(0.2, 4.0)
    spectrum = Bands(waves, 0.03 * (waves / 2) ** 0.8)
    lattice = lay_lattice(lay_walls(shapely.box(0, 0, 120, 7), 0.1), PROFILE, 0.1, 0.3)
    wanted = relief_of_noise(lattice, spectrum, spectrum, STEADY, np.random.default_rng(8))
    rough = displace_lattice(Mesher(lattice), wanted, BOUNDS)
    wall = rough.vertices[: lattice.wall_vertices]
    wall = wall[(np.abs(wall[:, 1]) < 0.4) & (wall[:, 0] > 3) & (wall[:, 0] < 117) & (wall[:, 2] > 0.45)]
    residuals = sweep_residuals(wall + np.array([0, 0.5, 0]), (1.0,), 60)[0]
    assert residuals.rq_m == pytest.approx(predicted_rq(spectrum, Roughness(1.0, 0.0)), rel=0.15)


THIRD = Simplification(0.34, 20.0)


@pytest.mark.parametrize("mine", [DRIFT, RING, TEE], ids=["straight", "ring", "tee"])
def test_a_simplified_surface_is_closed_across_its_tiles_and_lies_near_the_displaced_points(mine):
    rough = rough_of(mine, simplification=THIRD)
    assert check_mesh(*closed_mesh(rough)).watertight
    assert len(rough.mesh.faces) == pytest.approx(0.34 * len(rough.lattice.faces), rel=0.25)
    off = ray_scene(rough.mesh.vertices, rough.mesh.faces).compute_distance(rough.vertices.astype(np.float32)).numpy()
    assert np.sqrt((off**2).mean()) < 0.025  # a quarter of the relief, whose waves are near the spacing
    assert off.max() < 0.15


def test_a_flat_surface_is_simplified_without_error():
    rough = rough_of(DRIFT, rms_m=1e-9, simplification=THIRD)
    report = check_mesh(*closed_mesh(rough))
    fine = check_mesh(*closed_mesh(rough_of(DRIFT, rms_m=1e-9)))
    assert report.volume_m3 == pytest.approx(fine.volume_m3, rel=1e-3)


def test_a_simplified_surface_keeps_the_walls_line_on_the_floor_and_the_texture_of_its_places():
    rough = rough_of(TEE, simplification=THIRD)
    columns = len(rough.lattice.walls.xy)
    np.testing.assert_array_equal(rough.mesh.vertices[rough.mesh.place_of(columns)], rough.vertices[:columns])
    for name, mesh in cut_chunks(rough, 20.0, 4.0).items():
        edge = mesh.vertices[mesh.faces] - mesh.vertices[np.roll(mesh.faces, 1, axis=1)]
        painted = 4.0 * (mesh.texcoords[mesh.faces] - mesh.texcoords[np.roll(mesh.faces, 1, axis=1)])
        stretch = np.linalg.norm(painted, axis=2) / np.linalg.norm(edge, axis=2)
        assert np.percentile(stretch, 99) < 1.35, name  # a texture is squeezed on faces that lie obliquely


def test_the_same_lattice_is_simplified_to_identical_meshes_and_only_moved_tiles_change():
    one, two = (rough_of(TEE, simplification=THIRD).mesh for _ in range(2))
    np.testing.assert_array_equal(one.vertices, two.vertices)
    np.testing.assert_array_equal(one.faces, two.faces)
    lattice = lay_lattice(lay_walls(TEE, 0.25), PROFILE, 0.25, 0.25)
    mesher = Mesher(lattice, Simplification(0.34, 10.0))
    *_, all_new = mesher.mesh(lattice.vertices, np.ones(len(lattice.vertices), bool))
    moved = np.linalg.norm(lattice.vertices[:, :2] - lattice.vertices[0, :2], axis=1) < 1.0
    *_, new = mesher.mesh(lattice.vertices, moved)
    assert all_new.all()
    assert 0 < new.mean() < 0.5


def test_an_edge_that_three_faces_share_is_found():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1.0]])
    faces = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    np.testing.assert_array_equal(find_shared_edges(vertices, faces), [[0.5, 0, 0]])
    assert len(find_shared_edges(vertices, faces[:2])) == 0
