"""A rough floor: it collides as it looks, robots drive and stand on it, and what it is not is refused."""

import json
from dataclasses import replace

import cv2
import gymnasium
import mujoco
import numpy as np
import pytest
import shapely

from minesurveys.frames import Heights
from minexplore.bundle import COVER_M, HFIELDS, decode_msh, is_cover, is_rough_floor
from minexplore.extra.placing.place import place
from minexplore.physics.local_models import LocalModels
from minexplore.physics.robot import RobotParams
from minexplore.sealed.files import read_folder
from minexplore.task import TaskParams
from minexplore.world import load_world
from pipeline.errors import ArtifactError, ParamsError
from pipeline.mjcf.bundle import obstacles, open_bundle, read_record
from pipeline.mjcf.rough_floor import rough_tiles
from pipeline.params.config import Config
from pipeline.proof.rebuilt.whole_bundle import require_built
from pipeline.store.mine_survey import MineSurvey
from pipeline.types import DrawnPlan
from stages.realism import STAGE, write_world
from tests.composed import compose
from tests.mines import COARSE_ROCK, TEE, BuiltMine, frame_for, model_refusal, refusal, sealed, survey_of

DRIFT = shapely.union_all([shapely.box(0, 0, 36, 5), shapely.box(14, 5, 19, 16)])
ROUGH = [
    "rock=andesite",
    "look=dry",
    "fittings=drift",
    "realism.rough_floor=true",
    "realism.furnish=off",
    "surface.texture.size_px=64",
    "surface.rough.kept_share=null",
    *COARSE_ROCK,
]
_BOX = """<mujoco><worldbody><body name="box"><freejoint/><geom type="box" size="0.15 0.15 0.1" mass="20"/></body>
</worldbody></mujoco>"""


@pytest.fixture(scope="module")
def config() -> Config:
    return compose(ROUGH)


@pytest.fixture(scope="module")
def rough(config: Config, tmp_path_factory) -> BuiltMine:
    return BuiltMine(DRIFT, config, tmp_path_factory.mktemp("rough") / "world")


@pytest.fixture(scope="module")
def files(rough: BuiltMine) -> dict[str, bytes]:
    return read_folder(rough.bundle)


def covers(files) -> dict[str, bytes]:
    stems = {name.removeprefix("meshes/").removesuffix(".msh"): name for name in files}
    return {stem: files[name] for stem, name in stems.items() if is_cover(stem)}


def test_a_rough_world_is_what_the_builder_makes_of_its_own_parts(rough: BuiltMine, config: Config):
    world = open_bundle(rough.bundle)
    assert world.warnings == 0
    assert world.record.rough_floor
    require_built(rough.bundle, world.record, config.validation)


def test_the_compiled_height_fields_lie_on_the_visible_floor(rough: BuiltMine, files):
    model = open_bundle(rough.bundle).model
    (tiles,) = [rough_tiles(covers(files), read_record(rough.bundle).zones)]
    assert model.nhfield == len(tiles) > 2
    for tile in tiles:
        field, geom = model.hfield(tile.name).id, model.geom(tile.name)
        rows, cols = model.hfield_nrow[field], model.hfield_ncol[field]
        first = model.hfield_adr[field]
        heights = model.hfield_data[first : first + rows * cols].reshape(rows, cols)
        stands = geom.pos[2] + heights * model.hfield_size[field][2]
        np.testing.assert_allclose(stands, tile.heights_m, atol=1e-5)
        np.testing.assert_allclose(geom.pos[:2] - model.hfield_size[field][:2], tile.corner_m, atol=1e-6)
    vertices = np.concatenate([decode_msh(data).vertices for data in covers(files).values()])
    off = []
    for x, y, z in vertices[shapely.contains_xy(DRIFT, vertices[:, 0], vertices[:, 1])].tolist():
        tile = next(t for t in tiles if (t.corner_m <= [x, y]).all() and (t.corner_m + t.size_m >= [x, y]).all())
        col, row = np.round(([x, y] - tile.corner_m) / tile.step_m).astype(int)
        off.append(abs(tile.heights_m[row, col] - z))
    assert np.quantile(off, 0.95) < 0.005


def test_a_body_that_falls_in_the_plain_model_rests_on_the_rough_floor(rough: BuiltMine):
    spec = mujoco.MjSpec.from_file(str(rough.bundle / "mine.xml"))
    T = np.array(read_record(rough.bundle).T_world_mine)
    body = spec.worldbody.add_body(name="ball", pos=(T @ [17.0, 9.0, 0.4, 1.0])[:3])
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0], mass=1, friction=[1, 0.1, 0.1], condim=6)
    model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(400):
        mujoco.mj_step(model, data)
    touched = {model.geom(g).name for contact in data.contact for g in contact.geom}
    assert any(map(is_rough_floor, touched))
    height = (np.linalg.inv(T) @ [*data.body("ball").xpos, 1.0])[2]
    assert 0.1 < height < 0.1 + COVER_M


def test_height_fields_are_floor_and_one_that_is_higher_than_a_visible_floor_is_an_obstacle(rough: BuiltMine):
    record = read_record(rough.bundle)
    model, T = open_bundle(rough.bundle).model, np.array(record.T_world_mine)
    known = len(obstacles(model, T, record.height_m))
    assert known == record.collision_parts
    model.hfield_size[0][2] = 0.3
    assert len(obstacles(model, T, record.height_m)) == known + 1


def test_a_robot_of_any_file_stands_on_it_where_it_is_placed(rough: BuiltMine, tmp_path):
    robot = tmp_path / "box.xml"
    robot.write_text(_BOX)
    with pytest.warns(UserWarning, match="box"):
        model = place(rough.bundle, robot, (16.0, 9.0)).compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert any(is_rough_floor(model.geom(g).name) for contact in data.contact for g in contact.geom)
    assert np.abs(data.qvel).max() < 0.05


def test_the_default_robot_drives_over_it_and_rocks(rough: BuiltMine):
    env = gymnasium.make("MineXplore/ChileanMine-v0", world=rough.bundle)
    env.reset(seed=1)
    rolls = []
    for _ in range(60):
        _, _, over, cut, _ = env.step(np.array([1.0, 0.1], np.float32))
        rolls.append(env.unwrapped.robots.attitudes(np.arange(1))[0])
        if over or cut:
            break
    env.close()
    assert np.abs(np.diff(np.array(rolls), axis=0)).max() > 1e-3


def test_a_local_model_holds_what_a_robot_reaches_of_it(rough: BuiltMine):
    world = load_world(rough.bundle)
    models = LocalModels(world, TaskParams(), RobotParams())
    whole = models.highest_m(np.array([16.0, 8.0]), 50.0)
    assert 0.03 < whole <= COVER_M
    model = models.model((8, 4))
    near = [model.geom(k).name for k in range(model.ngeom) if is_rough_floor(model.geom(k).name)]
    assert near
    points = sum(int(model.hfield_nrow[k] * model.hfield_ncol[k]) for k in range(model.nhfield))
    assert points < 3000


def test_heights_that_are_not_those_of_the_visible_floor_are_refused(rough: BuiltMine, config: Config, files, tmp_path):
    name = next(name for name in files if name.startswith(HFIELDS))
    pixels = cv2.imdecode(np.frombuffer(files[name], np.uint8), cv2.IMREAD_UNCHANGED)
    changed = cv2.imencode(".png", np.where(pixels > 100, pixels - 60, pixels).astype(np.uint8))[1].tobytes()
    folder = tmp_path / "w"
    for path, data in sealed(files | {name: changed}).items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(data)
    with pytest.raises(ArtifactError, match="not the heights of the visible floor"):
        require_built(folder, read_record(folder), config.validation)


def test_files_and_geoms_of_a_rough_floor_that_a_world_cannot_have_are_refused(files, tmp_path):
    name = next(name for name in files if name.startswith(HFIELDS))
    stem = name.removeprefix(HFIELDS).removesuffix(".png")
    text, record = files["mine.xml"].decode(), json.loads(files["world.json"])
    assert f"file: {name!r}, want a file of the bundle" in refusal({k: v for k, v in files.items() if k != name})
    more = files | {f"{HFIELDS}rough_000_99_99.png": files[name]}
    assert "rough_000_99_99.png: no picture of a rough floor" in model_refusal(tmp_path / "more", more)
    del record["rough_floor"]
    assert "rough_floor = true" in refusal(files | {"world.json": json.dumps(record).encode()})
    small = cv2.imencode(".png", np.zeros((1, 1), np.uint8))[1].tobytes()
    assert "2 or more" in refusal(files | {name: small})
    line = next(line for line in text.splitlines() if f'<geom name="{stem}"' in line)
    x, y, z = line.split('pos="')[1].split('"')[0].split()
    high = text.replace(line, line.replace(f'pos="{x} {y} {z}"', f'pos="{x} {y} 0.4"'))
    assert f"geom {stem}: geom_" in model_refusal(tmp_path / "high", files | {"mine.xml": high.encode()})


def test_a_rough_floor_without_a_visible_one_is_refused():
    with pytest.raises(ParamsError, match="rough_floor needs a visible floor"):
        compose(["fittings=none", "realism.rough_floor=true"])


def test_a_rough_floor_of_a_mine_that_is_one_volume_is_refused_in_one_line():
    survey = replace(survey_of(frame_for(TEE), (1.0, 1.0)), heights=Heights(grade=0.1))
    mine = MineSurvey(survey, np.zeros((1, 1, 3), np.uint8), DrawnPlan())
    with pytest.raises(
        ParamsError, match=r"realism\.rough_floor = true: the mine is one volume, whose robots stand on its fl"
    ):
        write_world(compose(["realism.rough_floor=true"]).realism, mine, **dict.fromkeys(STAGE.reads.keys() - {"mine"}))
