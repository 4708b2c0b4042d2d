"""The model that pictures of a volume are drawn from: its facets in a few meshes, in place of all parts."""

import dataclasses

import mujoco
import numpy as np
import pytest

from minexplore.bundle import MODEL, GeomGroup, is_floor
from minexplore.envs.env import MineEnv
from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from minexplore.pictures.cameras import CameraParams
from minexplore.pictures.shown import shown_spec, without_parts
from minexplore.sensing.scanners import Mount
from minexplore.sensing.scanners.labels import NUMBERS
from minexplore.world import load_world
from pipeline.volume.world.model import part_names


@pytest.fixture(scope="module")
def world(ramp):
    return load_world(ramp)


@pytest.fixture(scope="module")
def shown(world):
    return shown_spec(world).compile()


def first_hits(model, place, groups, seed=0):
    """Return the distances to what rays from a place meet first in these groups, -1 for nothing."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    chosen = np.zeros(6, np.uint8)
    chosen[list(groups)] = 1
    ways = np.random.default_rng(seed).standard_normal((200, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    geom = np.zeros(1, np.int32)
    return np.array([mujoco.mj_ray(model, data, place, way, chosen, 1, -1, geom) for way in ways])


def test_rays_meet_the_facets_where_they_meet_the_parts(world, shown):
    whole, groups = world.spec().compile(), (GeomGroup.FLOOR, GeomGroup.COLLISION, GeomGroup.ROOF)
    spawn = np.array(world.record["spawn"]["anchor_m"]) + world.T_world_mine[:3, 3] + [0, 0, 1.0]
    wanted = first_hits(whole, spawn, groups)
    assert (wanted > 0).all()
    assert first_hits(shown, spawn, groups) == pytest.approx(wanted, abs=1e-4)


def test_facets_are_few_meshes_with_the_material_of_their_zone_and_nothing_collides(world, shown):
    geoms = [shown.geom(k) for k in range(shown.ngeom)]
    assert len(geoms) <= len(world.volume.facets.faces) / 2
    assert not shown.geom_contype.any()
    assert not shown.geom_conaffinity.any()
    seen = {shown.material(int(geom.matid[0])).name for geom in geoms if is_floor(geom.name)}
    assert seen == {f"ground_{zone.name}" for zone in world.floor_zones}
    assert shown.nmeshface == len(world.volume.facets.faces)


def test_the_model_without_parts_has_all_else(world):
    text = without_parts(world.read(MODEL))
    kept, whole = mujoco.MjSpec.from_string(text), world.spec()
    names = set(part_names(world.volume.parts, world.floor_zones))
    for kind in ("geoms", "meshes"):
        assert {one.name for one in getattr(whole, kind)} - {one.name for one in getattr(kept, kind)} == names
    for kind in ("lights", "cameras", "materials", "bodies"):
        assert [one.name for one in getattr(kept, kind)] == [one.name for one in getattr(whole, kind)]


def test_a_facet_alone_in_its_tile_is_shown(world):
    facets = world.volume.facets
    some = np.flatnonzero(facets.label != FacetLabel.FLOOR)
    some = np.append(some, np.flatnonzero(facets.label == FacetLabel.FLOOR)[0])
    fewer = VolumeFacets(facets.vertices, facets.faces[some], facets.label[some], facets.leg[some])
    volume = dataclasses.replace(world.volume, facets=fewer)
    model = shown_spec(dataclasses.replace(world, volume=volume)).compile()
    floors = [model.geom(k) for k in range(model.ngeom) if is_floor(model.geom(k).name)]
    assert [int(model.mesh_facenum[geom.dataid[0]]) for geom in floors] == [1]


def test_lamps_of_a_volume_without_visible_rock_fade_and_cast_no_shadow(shown):
    assert shown.nlight
    assert not shown.light_castshadow.any()
    assert (shown.light_attenuation[:, 2] > 0).all()


def test_cameras_see_the_roof_that_lidars_hit(ramp):
    env = MineEnv(ramp)
    env.reset(seed=0)
    suite = env.suite
    high = Mount(x_m=0.0, height_m=0.5, pitch_deg=-60.0)
    suite.sensor("rgb").params = CameraParams(mount=high)
    assert set(np.unique(env.capture("labels"))) <= {NUMBERS["rock"], NUMBERS["roof"]}
    assert (env.capture("labels") == NUMBERS["roof"]).mean() > 0.2
    assert (env.capture("depth") > 0).all()
    assert NUMBERS["roof"] in env.capture("vlp-16").label
    env.close()


def test_a_camera_on_the_robot_sees_rock_and_floor(ramp):
    env = MineEnv(ramp, render_mode="rgb_array", camera="front")
    env.reset(seed=0)
    assert env.render().std() > 5
    env.close()
