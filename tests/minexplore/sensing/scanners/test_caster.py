"""Hits of many rays: beside MuJoCo's own, and what they are called."""

import mujoco
import numpy as np
import pytest

from minexplore.bundle import GeomGroup, stops_beams
from minexplore.sensing.lidar import surface_meshes
from minexplore.sensing.scanners.caster import SurfaceCaster
from minexplore.sensing.scanners.labels import FLOOR, LABELS, NOTHING, NUMBERS, label_of_mesh
from minexplore.world import load_world

RANGE_M = 60.0


@pytest.fixture(scope="module")
def world(small_world):
    return load_world(small_world)


@pytest.fixture(scope="module")
def caster(world):
    return SurfaceCaster(world, RANGE_M)


def rays(world, count, seed=0):
    rng = np.random.default_rng(seed)
    places = world.places_m(0.5)
    origins = np.column_stack([places[rng.integers(len(places), size=count)], rng.uniform(0.3, 1.5, count)])
    directions = rng.normal(size=(count, 3))
    return origins, (directions / np.linalg.norm(directions, axis=1, keepdims=True)).astype(np.float32)


def mujoco_model(world):
    """Return the world's model with the surfaces that beams see in group 2, the flat floor in group 0."""
    spec = world.spec()
    for geom in spec.geoms:
        is_mesh = geom.type == mujoco.mjtGeom.mjGEOM_MESH  # the others are clear planes: water and shade
        if geom.group == GeomGroup.ROUGH_SURFACE and not (is_mesh and stops_beams(geom.meshname)):
            geom.group = 5
    model = world.compile(spec)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def test_ten_thousand_rays_agree_with_mj_ray_within_a_millimetre(world, caster):
    model, data = mujoco_model(world)
    turn, shift = world.T_world_mine[:3, :3], world.T_world_mine[:3, 3]
    body = model.body("mine")
    assert np.allclose(body.pos, shift, atol=1e-3)
    groups = np.array([1, 0, 1, 0, 0, 0], dtype=np.uint8)
    origins, directions = rays(world, 10_000)
    found = np.array([caster.cast(o, d[None]).range_m[0] for o, d in zip(origins, directions, strict=True)])
    geom = np.zeros(1, dtype=np.int32)
    axes = data.xmat[body.id].reshape(3, 3)
    expected = np.array(
        [
            mujoco.mj_ray(model, data, axes @ o + data.xpos[body.id], axes @ d.astype(float), groups, 1, -1, geom, None)
            for o, d in zip(origins, directions, strict=True)
        ]
    )
    assert np.allclose(turn, axes, atol=1e-5)
    hit = (expected >= 0) & (expected < RANGE_M)
    assert hit.sum() > 9_900
    assert np.abs(found[hit] - expected[hit]).max() < 1e-3
    assert np.isinf(found[~hit]).all()


def test_many_rays_from_one_place_are_those_cast_one_by_one(world, caster):
    origins, directions = rays(world, 300, seed=1)
    together = caster.cast(origins[0], directions)
    alone = [caster.cast(origins[0], d[None]) for d in directions]
    np.testing.assert_array_equal(together.range_m, [hits.range_m[0] for hits in alone])
    np.testing.assert_array_equal(together.label, [hits.label[0] for hits in alone])


def test_a_ray_straight_down_hits_the_floor_at_its_height_and_at_right_angles(world, caster):
    place = world.places_m(1.0)[0]
    hits = caster.cast(np.array([*place, 0.7]), np.array([[0, 0, -1]], dtype=np.float32))
    assert hits.range_m[0] == pytest.approx(0.7)
    assert hits.cosine[0] == pytest.approx(1.0)
    assert "floor" in LABELS[hits.label[0]] or LABELS[hits.label[0]] == "water"


def test_what_is_farther_than_the_range_is_nothing(world):
    near = SurfaceCaster(world, 0.5)
    hits = near.cast(np.array([*world.places_m(1.0)[0], 0.7]), np.array([[0, 0, -1]], dtype=np.float32))
    assert np.isinf(hits.range_m[0])
    assert hits.label[0] == NOTHING


def test_every_mesh_that_beams_see_has_a_label(world):
    named = {LABELS[label_of_mesh(name)] for name in surface_meshes(world)}
    assert {"rock", "roof"} <= named
    assert "nothing" not in named


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("surface_west_00_01", "rock"),
        ("surface_roof_00_01", "roof"),
        ("fitting_pipe_00_01", "pipe"),
        ("fitting_cover_001_00_01", "floor"),
        ("rock_0001", "rock"),
        ("floor 3", "floor"),
        ("fitting_shaft_0001", "shaft"),
    ],
)
def test_a_geom_is_labelled_by_its_name(name, label):
    assert label_of_mesh(name) == NUMBERS[label]


def test_floors_are_named_by_how_much_they_slow_a_robot(world, caster):
    place = world.places_m(1.0)[0]
    down = np.array([[0, 0, -1]], dtype=np.float32)
    zone = world.floor_zones[int(world.zones_at(place[:1])[0])]
    label = caster.cast(np.array([*place, 0.5]), down).label[0]
    assert (label == FLOOR) == (zone.command_scale == 1)
