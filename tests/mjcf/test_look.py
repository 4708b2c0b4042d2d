"""Worlds with a look: what they hold, what is refused, and that nothing a robot touches changes."""

import json

import mujoco
import numpy as np
import pytest
import shapely

from minexplore.bundle import MODEL, GeomGroup, is_shade, shade_geom
from minexplore.looks import CUT_MATERIAL, LOOKS, SHADE, cover_rgba
from minexplore.physics.robot import RobotParams, free_joint_qpos
from minexplore.pictures.atmosphere import add_headlamp, add_sky, has_haze, let_light_pass
from minexplore.pictures.render import Renderer, far_hidden
from minexplore.sealed.files import read_folder
from minexplore.sensing.coverage import CoverageGrid
from minexplore.world import load_world
from pipeline.mjcf.bundle import open_bundle
from pipeline.mjcf.loading import load_model
from pipeline.mjcf.render import render_camera
from pipeline.params.config import Config
from pipeline.proof.rebuilt.whole_bundle import require_built
from tests.composed import compose
from tests.mines import COARSE_ROCK, BuiltMine, model_refusal, refusal

DRIFT = shapely.union_all([shapely.box(0, 0, 30, 5), shapely.box(12, 5, 17, 14)])
COARSE = ["fittings=none", *COARSE_ROCK, "surface.rough.kept_share=null"]
LOOKING = [*COARSE, "look=wet", "surface.texture.size_px=128"]


@pytest.fixture(scope="module")
def looking() -> Config:
    return compose(LOOKING)


@pytest.fixture(scope="module")
def wet(looking: Config, tmp_path_factory) -> BuiltMine:
    return BuiltMine(DRIFT, looking, tmp_path_factory.mktemp("wet") / "world")


@pytest.fixture(scope="module")
def plain(tmp_path_factory) -> BuiltMine:
    config = compose([*COARSE, "look=plain", "surface.texture.size_px=128"])
    return BuiltMine(DRIFT, config, tmp_path_factory.mktemp("plain") / "world")


@pytest.mark.parametrize("name", LOOKS)
def test_a_view_that_ends_beyond_the_rock_shows_the_colour_of_the_haze(name):
    spec = mujoco.MjSpec()
    add_sky(spec, LOOKS[name])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    renderer = mujoco.Renderer(model, 32, 32)
    renderer.update_scene(data)
    assert np.abs(renderer.render() - 255 * np.array(LOOKS[name].haze_rgb)).max() <= 1.5
    renderer.close()


def test_a_world_with_a_look_is_what_the_builder_makes_of_its_own_parts(wet: BuiltMine, looking: Config):
    world = open_bundle(wet.bundle)
    assert world.warnings == 0
    require_built(wet.bundle, world.record, looking.validation)


def test_a_world_states_its_look(plain: BuiltMine, wet: BuiltMine):
    assert json.loads((plain.bundle / "world.json").read_text())["look"] == "plain"
    assert json.loads((wet.bundle / "world.json").read_text())["look"] == "wet"


def test_a_look_changes_no_geom_that_can_be_touched(plain: BuiltMine, wet: BuiltMine):
    one, two = (open_bundle(mine.bundle).model for mine in (plain, wet))
    touched = [np.flatnonzero(m.geom_contype | m.geom_conaffinity) for m in (one, two)]
    for field in ("geom_type", "geom_pos", "geom_size", "geom_friction", "geom_group", "geom_priority"):
        assert (getattr(one, field)[touched[0]] == getattr(two, field)[touched[1]]).all(), field


@pytest.mark.parametrize(
    ("look", "message"),
    [
        ("rainy", "look = 'rainy'"),
        (["wet"], "look = ['wet']"),
    ],
)
def test_a_look_that_the_model_does_not_have_is_refused(wet: BuiltMine, look, message):
    assert message in refusal(read_folder(wet.bundle), look=look)


def test_another_look_than_that_of_the_model_is_refused(wet: BuiltMine, plain: BuiltMine, tmp_path):
    files = read_folder(wet.bundle)
    record = json.loads(files["world.json"]) | {"look": "dry"}
    assert "mat_shininess" in model_refusal(tmp_path / "dry", {**files, "world.json": json.dumps(record).encode()})
    files = read_folder(plain.bundle)
    haze = files["mine.xml"].replace(b'znear="', b'fogstart="0.6" znear="', 1)
    assert "vis.map.fogstart" in model_refusal(tmp_path / "haze", {**files, "mine.xml": haze})


def test_haze_dims_what_is_far_and_leaves_what_is_near(wet: BuiltMine):
    model = load_model(wet.bundle / MODEL)
    assert has_haze(model)
    seen = (GeomGroup.FLOOR, GeomGroup.ROUGH_SURFACE)
    model.vis.rgba.fog[:] = [0, 1, 0, 1]  # green, which no rock is
    hazy = render_camera(model, "entrance", 160, 90, seen).astype(int)
    model.vis.map.fogstart, model.vis.map.fogend = 3.0, 10.0
    clear = render_camera(model, "entrance", 160, 90, seen).astype(int)
    greener = (hazy - clear)[..., 1]
    assert greener.max() > 10
    assert np.abs(greener[-5:]).mean() < 2  # the floor at the camera's feet


def test_a_cut_away_view_shows_rock_of_one_colour(wet: BuiltMine):
    model = open_bundle(wet.bundle).model
    materials = {model.geom_matid[g] for g in np.flatnonzero(model.geom_group == GeomGroup.COLLISION)}
    assert [model.mat(m).name for m in materials] == [CUT_MATERIAL]
    assert (model.mat_texid[list(materials)] < 0).all()


def test_a_robot_carries_a_lamp_that_casts_shadows_in_a_world_with_a_look_only():
    for name, look in LOOKS.items():
        spec = mujoco.MjSpec()
        RobotParams().attach(spec, "robot")
        add_headlamp(spec, "robot", look, RobotParams().lamp_height_m)
        model = spec.compile()
        assert model.nlight == (name != "plain")
        assert model.light_castshadow[: model.nlight].all()


def test_geoms_beyond_the_haze_are_hidden_while_a_frame_is_drawn(wet: BuiltMine):
    model = load_model(wet.bundle / MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    before = model.geom_group.copy()
    with far_hidden(model, data, np.array([1000.0, 0.0, 0.0])):
        assert (model.geom_group == GeomGroup.SMOOTH_SURFACE).all()
    with far_hidden(model, data, data.geom_xpos.mean(axis=0)):
        assert (model.geom_group == before).all()
    assert (model.geom_group == before).all()


def test_the_colour_of_a_visible_floor_keeps_its_zones_hue():
    for zone in ([0.52, 0.45, 0.38, 1.0], [0.9, 0.3, 0.1, 1.0]):
        colour = cover_rgba(zone)
        assert max(colour) <= 1.0
        assert np.argsort(colour[:3]).tolist() == np.argsort(zone[:3]).tolist()
    assert max(cover_rgba([0.0, 0.0, 0.0, 1.0])[:3]) == 0.0


def test_planes_of_shade_darken_evenly_and_cast_no_shadow():
    """The brightness of a white floor falls by one factor a plane, whatever lamp shines over it."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_BOX, size=[50, 50, 0.1], pos=[0, 0, -0.1])
    spec.worldbody.add_light(
        pos=[-3, 0, 0.6], dir=[1, 0, -0.06], type=mujoco.mjtLightType.mjLIGHT_SPOT, castshadow=True
    )
    spec.worldbody.add_camera(name="eye", pos=[-3, 0, 0.5], quat=[0.5, 0.5, -0.5, -0.5])
    for layer in range(2):
        spec.worldbody.add_geom(
            name=shade_geom(layer),
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[50, 50, 1],
            pos=[0, 0, 0.01 + 0.005 * layer],
            rgba=SHADE,
            group=layer + 1,
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    brightness = []
    with mujoco.Renderer(model, 60, 80) as renderer:
        for planes in range(3):
            option = mujoco.MjvOption()
            option.geomgroup[:] = [1, planes > 0, planes > 1, 0, 0, 0]
            renderer.update_scene(data, "eye", option)
            let_light_pass(renderer.scene, {g for g in range(model.ngeom) if is_shade(model.geom(g).name)})
            brightness.append(renderer.render()[32:50].mean())
    factor = (1 - SHADE[3]) ** 2
    assert brightness[1] / brightness[0] == pytest.approx(factor, abs=0.03)
    assert brightness[2] / brightness[1] == pytest.approx(factor, abs=0.03)


def test_the_front_camera_looks_ahead_from_the_robot(wet: BuiltMine):
    world, robot = load_world(wet.bundle), RobotParams()
    grid = CoverageGrid(world, 2.0, robot.radius_m, np.array([5.0, 2.5]), 100.0)
    renderer = Renderer(world, world.T_world_mine, grid, robot, 1, (120, 80))
    nothing = np.zeros_like(grid.reachable)
    pictures = []
    for yaw in (0.0, np.pi):  # along the drift, and at the rock behind the robot
        qpos = np.concatenate([free_joint_qpos(world.T_world_mine, robot, 1.5, 2.5, yaw), np.zeros(2)])[None]
        pictures.append(renderer.draw("front", qpos, nothing, np.array([[1.5, 2.5, yaw]])).astype(int))
    renderer.close()
    robot_yellow = (pictures[0][..., 0] - pictures[0][..., 2] > 100).mean()
    assert robot_yellow < 0.01
    middle = [picture[35:45, 50:70].mean() for picture in pictures]
    assert middle[1] > middle[0] + 10  # rock at 1.5 m is lit, the drift's end at 28 m is not
