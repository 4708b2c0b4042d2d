import numpy as np
import pytest

from minexplore.sensing.lidar import Lidar, surface_meshes
from minexplore.sensing.planes import face_planes
from minexplore.world import load_world
from pipeline.geometry.ray_scene import load_open3d
from tests.mines import BuiltMine


@pytest.fixture(scope="module")
def meshes(tee: BuiltMine):
    return surface_meshes(load_world(tee.bundle))


def rays(count, beams, seed=0):
    """Return rays from the main drift; half are level at 0.5 m, where rows of the rock's vertices lie."""
    rng = np.random.default_rng(seed)
    level = rng.random(count) < 0.5
    height = np.where(level, 0.5, rng.uniform(0.3, 0.6, count))
    origins = np.column_stack([rng.uniform(1, 79, count), rng.uniform(1, 4, count), height])
    angle = rng.uniform(-np.pi, np.pi, (count, beams))
    slope = np.where(level[:, None], 0.0, rng.normal(0, 0.1, (count, beams)))
    directions = np.stack([np.cos(angle), np.sin(angle), slope], axis=-1)
    return origins, directions / np.linalg.norm(directions, axis=-1, keepdims=True)


def nearest(triangles, origin, direction):
    """Return the distance along a ray to the nearest triangle (Moeller and Trumbore), in double precision."""
    a = triangles[:, 0]
    one, two = triangles[:, 1] - a, triangles[:, 2] - a
    across = np.cross(direction, two)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1 / (one * across).sum(axis=1)
        u = ((origin - a) * across).sum(axis=1) * scale
        other = np.cross(origin - a, one)
        v = (other @ direction) * scale
        t = (two * other).sum(axis=1) * scale
    hit = (u >= -1e-7) & (v >= -1e-7) & (u + v <= 1 + 1e-7) & (t > 0)
    return t[hit].min(initial=np.inf)


def test_beams_are_those_of_double_precision_against_every_triangle(meshes):
    triangles = np.concatenate([v[f] for v, f in meshes.values()]).astype(float)
    origins, directions = rays(40, 5)
    found = Lidar(meshes, 10.0).cast(origins, directions)
    for k, (origin, beams) in enumerate(zip(origins, directions, strict=True)):
        near = triangles[np.linalg.norm(triangles[:, 0, :2] - origin[:2], axis=1) < 11]
        for b, direction in enumerate(beams):
            floor = -origin[2] / direction[2] if direction[2] < 0 else np.inf
            assert found[k, b] == pytest.approx(min(nearest(near, origin, direction), floor, 10.0), abs=1e-3)


def test_backends_agree_within_a_millimetre_on_a_hundred_thousand_rays(meshes):
    load_open3d()  # for the backend, too
    origins, directions = rays(2000, 50)
    one, two = (Lidar(meshes, 10.0, backend).cast(origins, directions) for backend in ("embree", "open3d"))
    assert np.abs(one - two).max() < 1e-3


def test_scenes_are_kept_by_their_memory_and_change_no_range(meshes):
    origins, directions = rays(200, 4)
    wide = Lidar(meshes, 10.0)
    ranges = wide.cast(origins, directions)
    assert 0 < wide.kept_bytes < 1e9
    narrow = Lidar(meshes, 10.0, scenes_bytes=wide.kept_bytes * 2 // 3)
    np.testing.assert_array_equal(narrow.cast(origins, directions), ranges)
    assert 0 < narrow.kept_bytes <= wide.kept_bytes * 2 // 3


@pytest.mark.parametrize(
    ("installed", "backend", "words"),
    [
        (("open3d",), "embree", "lidar = 'embree' needs embreex: pip install embreex"),
        ((), "auto", "the robots' beams need Embree: pip install embreex"),
    ],
)
def test_a_missing_backend_says_what_to_install(monkeypatch, installed, backend, words):
    monkeypatch.setattr("minexplore.sensing.lidar.find_spec", lambda name: object() if name in installed else None)
    with pytest.raises(ImportError, match=words):
        Lidar({}, 10.0, backend)


def test_planes_are_made_for_the_meshes_near_a_ray_only_until_all_are_asked_for(meshes):
    lidar = Lidar(meshes, 10.0)
    origins, directions = rays(1, 4)
    lidar.cast(origins, directions)
    assert 0 < lidar._has_planes.sum() < len(meshes)
    np.testing.assert_array_equal(lidar.planes, np.concatenate([face_planes(*mesh) for mesh in meshes.values()]))
