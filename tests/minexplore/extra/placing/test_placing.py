import math
import os
import warnings
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
import pytest

import minexplore
from minexplore.extra.placing.place import PlacementWarning
from minexplore.physics.robot import ROCK_BODY
from minexplore.world import World, load_world
from tests.mines import BuiltMine

ASSETS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
ROBOTS = ("ant.xml", "humanoid.xml")
TURN_S = 4.0  # a push of one direction


def placed(world: World, robot: object, pose: tuple, **options: object) -> tuple[mujoco.MjModel, mujoco.MjData]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PlacementWarning)
        model = minexplore.place(world, robot, pose, **options).compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("spawn").id)
    mujoco.mj_forward(model, data)
    return model, data


def to_mine(world: World, points: np.ndarray) -> np.ndarray:
    return (points - world.T_world_mine[:3, 3]) @ world.T_world_mine[:3, :3]


def thrash(world: World, model: mujoco.MjModel, data: mujoco.MjData, seconds: float) -> int:
    """Move all joints at random and push the robot about; return the steps in which it met a wall or the roof.

    Its trunk may never be in rock. MuJoCo's contacts are soft: a foot that slams into a wall with the 150 N m of an Ant
    of 0.9 kg dips in for an instant. No limb may be there in two looks in a row.
    """
    rng, root = np.random.default_rng(3), next(b for b in range(model.nbody) if model.body(b).jntnum and b)
    bodies = [b for b in range(model.nbody) if model.body_weldid[b]]
    weight = 9.81 * model.body_subtreemass[root]
    walls = {g for g in range(model.ngeom) if model.geom_bodyid[g] == model.body(ROCK_BODY).id}
    met, dipped = 0, np.zeros(len(bodies), dtype=bool)
    for step in range(round(seconds / model.opt.timestep)):
        if step % round(0.1 / model.opt.timestep) == 0:
            data.ctrl[:] = rng.uniform(*model.actuator_ctrlrange.T)
            angle = math.tau * (0.25 + 0.38 * int(step * model.opt.timestep / TURN_S))
            data.xfrc_applied[root, :3] = 1.5 * weight * np.array([math.cos(angle), math.sin(angle), 0])
            places = to_mine(world, data.xipos[bodies])
            col, row = np.floor((places[:, :2] - world.origin_m) / world.cell_m).astype(int).T
            inside = world.clearance_m[row, col] <= 0
            assert not inside[bodies.index(root)], f"in rock after {data.time:.2f} s: {places.round(2)}"
            assert not (inside & dipped).any(), f"stuck in rock after {data.time:.2f} s: {places.round(2)}"
            dipped = inside
            assert places[:, 2].min() > -0.05
            assert places[:, 2].max() < world.record["height_m"]
        mujoco.mj_step(model, data)
        met += any(not walls.isdisjoint(pair) for pair in data.contact.geom.tolist())
    assert np.isfinite(data.qpos).all()
    assert [int(warning.number) for warning in data.warning] == [0] * len(data.warning)
    return met


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_robot_that_thrashes_against_walls_stays_out_of_the_rock(tee: BuiltMine, robot: str):
    world = load_world(tee.bundle)
    assert thrash(world, *placed(world, ASSETS / robot, (10.0, 2.5, 0.3), reach_m=math.inf), 4.0) > 0


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_a_robot_that_thrashes_against_walls_for_a_minute_stays_out_of_the_rock(tee: BuiltMine, robot: str):
    world = load_world(tee.bundle)
    assert thrash(world, *placed(world, ASSETS / robot, (10.0, 2.5, 0.3), reach_m=math.inf), 60.0) > 100


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_placed_robot_weighs_what_it_weighs_in_its_own_file_and_keeps_its_solver(tee: BuiltMine, robot: str):
    own = mujoco.MjModel.from_xml_path(str(ASSETS / robot))
    model, _ = placed(load_world(tee.bundle), ASSETS / robot, (10.0, 2.5))
    root = model.body("robot/torso").id
    assert model.body_subtreemass[root] == pytest.approx(own.body_subtreemass[own.body("torso").id], rel=1e-9)
    assert (model.nq, model.nu) == (own.nq, own.nu)
    assert (model.opt.timestep, model.opt.integrator) == (own.opt.timestep, own.opt.integrator)
    assert all(geom.name.startswith("robot/") for geom in map(model.geom, range(model.ngeom)) if geom.bodyid[0] >= root)
    with pytest.raises(KeyError):
        model.geom("robot/floor")


@pytest.mark.parametrize("robot", ["half_cheetah.xml", "pusher.xml", "hopper.xml", "inverted_double_pendulum.xml"])
def test_every_body_weighs_what_the_compiler_made_of_its_own_file_and_mujoco_warns_of_nothing(tee, robot, capfd):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # MuJoCo's of `settotalmass`
        own = mujoco.MjModel.from_xml_path(str(ASSETS / robot))
    capfd.readouterr()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", PlacementWarning)
        model = minexplore.place(load_world(tee.bundle), ASSETS / robot, (10.0, 2.5)).compile()
    assert capfd.readouterr().err == ""
    for body in map(own.body, range(1, own.nbody)):
        placed_body = model.body(f"robot/{body.name}")
        assert placed_body.mass == pytest.approx(body.mass, rel=1e-9)
        np.testing.assert_allclose(placed_body.inertia, body.inertia, rtol=1e-9)


@pytest.mark.parametrize(
    "compiler", ["", 'settotalmass="14"', 'inertiafromgeom="true"', 'inertiafromgeom="true" settotalmass="9"']
)
def test_inertials_that_a_file_states_hold_as_in_the_file_alone(tee: BuiltMine, compiler: str):
    text = f"""<mujoco><compiler {compiler}/><worldbody><body name="a" pos="0 0 1"><freejoint/>
    <inertial pos=".01 0 0" mass="3" fullinertia=".1 .2 .25 .01 .02 .03"/><geom size=".2"/><body name="b" pos=".5 0 0">
    <joint axis="0 1 0"/><geom type="capsule" size=".05" fromto="0 0 0 .3 0 0"/>
    <geom type="box" size=".1 .1 .1" contype="0" conaffinity="0" mass="2"/></body></body></worldbody></mujoco>"""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # MuJoCo's of `settotalmass`
        own = mujoco.MjModel.from_xml_string(text)
    model, _ = placed(load_world(tee.bundle), mujoco.MjSpec.from_string(text), (10.0, 2.5), reach_m=5.0)
    for name in "ab":
        np.testing.assert_allclose(model.body(f"robot/{name}").mass, own.body(name).mass)
        np.testing.assert_allclose(model.body(f"robot/{name}").inertia, own.body(name).inertia)
        np.testing.assert_allclose(model.body(f"robot/{name}").ipos, own.body(name).ipos, atol=1e-12)


def test_all_options_that_differ_are_listed_and_contacts_stay_the_mines(tee: BuiltMine):
    text = """<mujoco><option iterations="7" wind="1 0 0" o_friction=".1 .1 .1 .1 .1"><flag override="enable"/></option>
    <worldbody><body name="b" pos="0 0 1"><freejoint/><geom size=".1"/></body></worldbody></mujoco>"""
    with pytest.warns(
        PlacementWarning, match=r"iterations 7 \(environments: 100\), wind 1 0 0 \(environments: 0 0 0\)"
    ):
        spec = minexplore.place(load_world(tee.bundle), mujoco.MjSpec.from_string(text), (10.0, 2.5))
    assert "gravity and contacts are the mine's" in spec.text("placement").data
    model = spec.compile()
    assert not model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_OVERRIDE
    assert (model.opt.iterations, model.opt.wind.tolist()) == (7, [1.0, 0.0, 0.0])


def test_no_two_parts_of_a_robot_meet_that_did_not_meet_in_its_own_file(tee: BuiltMine):
    own = mujoco.MjModel.from_xml_path(str(ASSETS / "humanoid.xml"))
    model, _ = placed(load_world(tee.bundle), ASSETS / "humanoid.xml", (10.0, 2.5))

    def pairs(found: mujoco.MjModel, prefix: str) -> set[tuple[str, str]]:
        names = [own.geom(g).name for g in range(own.ngeom) if own.geom(g).name != "floor"]
        bits = {n: (int(found.geom(prefix + n).contype[0]), int(found.geom(prefix + n).conaffinity[0])) for n in names}
        return {(a, b) for a in names for b in names if bits[a][0] & bits[b][1] or bits[b][0] & bits[a][1]}

    assert pairs(model, "robot/") == pairs(own, "")


def test_it_says_once_what_differs_and_keeps_it_in_the_model(tee: BuiltMine):
    with pytest.warns(PlacementWarning) as said:
        spec = minexplore.place(load_world(tee.bundle), ASSETS / "ant.xml", (10.0, 2.5))
    assert len(said) == 1
    for part in ("geom floor", "timestep 0.01 s (environments: 0.005 s)", "integrator RK4", "conaffinity of 13 geoms"):
        assert part in str(said[0].message)
    assert spec.text("placement").data in str(said[0].message)


def test_a_flyer_is_put_in_the_air_where_it_is_asked_to_be(tee: BuiltMine):
    world = load_world(tee.bundle)
    _, data = placed(world, ASSETS / "ant.xml", minexplore.Pose(10.0, 2.5, 0.0, z_m=1.2))
    assert data.ncon == 0
    # The lowest collision geom is 1.2 m up, and the robot level.
    torso = to_mine(world, data.body("robot/torso").xpos[None])[0]
    assert torso[2] - 1.2 > 0.2
    assert data.body("robot/torso").xmat[8] == pytest.approx(1.0)  # it is level in a mine that dips
    assert world.T_world_mine[2, 2] < 0.999
    np.testing.assert_allclose(torso[:2], [10.0, 2.5], atol=0.1)


def test_a_keyframe_of_the_robots_file_is_how_it_stands(tee: BuiltMine):
    text = """<mujoco><worldbody><body name="b" pos="0 0 3"><freejoint/><geom size=".2" name="ball"/>
    <body name="arm"><joint name="j" axis="0 1 0"/><geom type="capsule" size=".05" fromto="0 0 0 .5 0 0"/></body>
    </body></worldbody><keyframe><key name="down" qpos="7 8 9 1 0 0 0 1.5707963"/></keyframe></mujoco>"""
    world = load_world(tee.bundle)
    _, data = placed(world, mujoco.MjSpec.from_string(text), (10.0, 2.5))
    centre = to_mine(world, data.body("robot/b").xpos[None])[0]
    np.testing.assert_allclose(centre, [10.0, 2.5, 0.55 + 0.005], atol=1e-5)  # the arm hangs down


def test_a_pair_with_a_files_own_floor_becomes_a_contact_with_the_mines(tee: BuiltMine):
    text = """<mujoco><worldbody><geom name="ground" type="plane" size="1 1 1"/><body name="b" pos="0 0 1"><freejoint/>
    <geom name="foot" size=".1" contype="0" conaffinity="0"/></body></worldbody>
    <contact><pair geom1="foot" geom2="ground"/></contact></mujoco>"""
    model, data = placed(load_world(tee.bundle), mujoco.MjSpec.from_string(text), (10.0, 2.5))
    mujoco.mj_step(model, data, nstep=1000)
    height = to_mine(load_world(tee.bundle), data.body("robot/b").xpos[None])[0, 2]
    assert height == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize(
    ("pose", "options", "message"),
    [
        ((500.0, 2.5), {}, r"pose: \(x, y\) = \(500, 2.5\): in rock; want a place of the workings"),
        ((10.0, 2.5, 0.0, -50.0), {}, r"pose: \(10.0, 2.5, -50.0\): in rock"),
        ((10.0, 2.5, 0.0, 50.0), {}, r"pose: \(10.0, 2.5, 50.0\): in rock"),
        ((10.0, 0.3), {}, r"reaches 0\.\d+ m into .+; want a place with 1\.\d+ m round it"),
        ((10.0,), {}, r"pose = \(10.0,\): want \(x, y\), \(x, y, yaw\) or \(x, y, yaw, z\)"),
        ((10.0, math.nan), {}, "pose: y_m = nan: want a finite number"),
        ((10.0, 2.5), {"reach_m": -1.0}, "place: reach_m = -1.0: want a number from 0.1 or more"),
        ((10.0, 2.5), {"keyframe": "home"}, "keyframe = 'home': ant has none"),
        ((10.0, 2.5), {"prefix": ""}, "place: prefix = '': want a text"),
    ],
)
def test_a_bad_parameter_is_refused_in_one_line(tee: BuiltMine, pose: tuple, options: dict, message: str):
    with pytest.raises(ValueError, match=message) as refused:
        placed(load_world(tee.bundle), ASSETS / "ant.xml", pose, **options)
    assert "\n" not in str(refused.value)


def test_what_is_no_robot_is_refused_in_one_line(tee: BuiltMine):
    world = load_world(tee.bundle)
    with pytest.raises(FileNotFoundError, match=r"robot = 'no\.xml': no such file"):
        placed(world, "no.xml", (10.0, 2.5))
    ghost = '<mujoco><worldbody><body><geom size="1" contype="0" conaffinity="0"/></body></worldbody></mujoco>'
    with pytest.raises(ValueError, match="none of its geoms collides"):
        placed(world, mujoco.MjSpec.from_string(ghost), (10.0, 2.5))
    urdf = (
        '<robot name="r"><link name="l"><collision><geometry><sphere radius="1"/></geometry></collision></link></robot>'
    )
    with pytest.raises(ValueError, match="it has no body beside the world's; want at least one"):
        placed(world, mujoco.MjSpec.from_string(urdf), (10.0, 2.5))
    with pytest.raises(ValueError, match=r"robot = 7: want an MJCF file, an mujoco\.MjSpec, or menagerie:NAME"):
        placed(world, 7, (10.0, 2.5))


def test_a_robot_of_menagerie_stands_on_the_floor(tee: BuiltMine):
    pytest.importorskip("mujoco_menagerie", reason="mujoco-menagerie is not installed (extra `menagerie`)")
    root = os.environ.get("MENAGERIE_ROOT")
    known = ("unitree_go2", "boston_dynamics_spot", "anybotics_anymal_c", "unitree_h1", "unitree_g1", "skydio_x2")
    names = [name for name in known if root and (Path(root) / name).is_dir()]
    if not names:
        pytest.skip("MENAGERIE_ROOT names no checkout of MuJoCo Menagerie")
    world = load_world(tee.bundle)
    for name in names[:2]:
        model, data = placed(world, f"menagerie:{name}", (10.0, 2.5, 0.3), reach_m=8.0)
        assert model.nu > 0
        mujoco.mj_step(model, data, nstep=round(1.0 / model.opt.timestep))
        assert np.isfinite(data.qpos).all()
        assert to_mine(world, data.xpos[1:][model.body_weldid[1:] > 0])[:, 2].min() > -0.05
