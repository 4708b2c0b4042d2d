"""Light worlds: no visible rock, beams that end on the collision walls, and the same contract otherwise."""

import json
import shutil

import numpy as np
import pytest

from benchmarks.faults.injection import edit_record, seal
from minexplore.bundle import BundleError
from minexplore.envs.env import MineEnv
from minexplore.pictures.cameras import CameraParams
from minexplore.pictures.render import shown_groups
from minexplore.sealed.files import read_folder
from minexplore.sensing.lidar import collision_meshes, shared_lidar
from minexplore.sensing.scanners import Mount
from minexplore.sensing.scanners.labels import NUMBERS
from minexplore.world import load_world
from pipeline.commands.proofs import parity, replay
from pipeline.errors import ArtifactError, InputError
from pipeline.mjcf.bundle import open_bundle
from pipeline.proof.certificate import certify
from pipeline.proof.groups import applying_limits, is_measured
from pipeline.proof.rebuilt.whole_bundle import require_built
from pipeline.proof.validator import MEASURES, Validator
from pipeline.report.figures.scene import scene_page
from pipeline.schema import check_world
from tests.composed import compose
from tests.mines import TEE, BuiltMine, model_refusal, require_allowed, sealed
from tests.minexplore.sensing.test_lidar import nearest, rays
from tests.volume_worlds import RAMP, VolumeWorld


@pytest.fixture(scope="module")
def light_config():
    return compose(["preset=light"])


@pytest.fixture(scope="module")
def light(tmp_path_factory, light_config) -> BuiltMine:
    return BuiltMine(TEE, light_config, tmp_path_factory.mktemp("light") / "world")


def test_a_light_world_has_no_meshes_no_texture_and_no_preview(light):
    files = read_folder(light.bundle)
    assert set(files) == {
        "free_space.bt",
        "free_space.geojson",
        "made_by.json",
        "map.png",
        "map.yaml",
        "mine.xml",
        "occupancy.npz",
        "topology.json",
        "world.json",
    }
    assert json.loads(files["world.json"])["overlay"] == "none"
    assert sum(map(len, files.values())) < 500_000
    check_world(light.bundle)


def test_beams_in_a_light_world_are_those_of_double_precision_against_every_collision_face(light):
    world = load_world(light.bundle)
    lidar = shared_lidar(world.folder, world.record["world_sha256"], 10.0, "auto")
    triangles = np.concatenate([v[f] for v, f in collision_meshes(world).values()])
    origins, directions = rays(60, 5, seed=3)
    steep = np.array([[0.6, 0.0, 0.8]])
    directions[:, 0] = steep  # some beams reach the roof
    found = lidar.cast(origins, directions)
    for k, (origin, beams) in enumerate(zip(origins, directions, strict=True)):
        for b, direction in enumerate(beams):
            level = 0.0 if direction[2] < 0 else world.record["height_m"]
            slab = (level - origin[2]) / direction[2] if direction[2] else np.inf
            assert found[k, b] == pytest.approx(min(nearest(triangles, origin, direction), slab, 10.0), abs=1e-3)
    assert np.isclose(found[:, 0], (world.record["height_m"] - origins[:, 2]) / 0.8).any()


def test_a_robot_in_a_straight_drift_measures_its_walls_to_the_tolerance_of_the_outline(light):
    world = load_world(light.bundle)
    lidar = shared_lidar(world.folder, world.record["world_sha256"], 10.0, "auto")
    beams = np.array([[[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]])
    np.testing.assert_allclose(lidar.cast(np.array([[20.0, 2.0, 0.5]]), beams), [[3.0, 2.0]], atol=0.1)


def test_the_proof_accepts_a_light_world_and_its_certificate_has_the_geometric_clauses(light, light_config):
    params = light_config.validation
    require_built(light.bundle, open_bundle(light.bundle).record, params)
    validator = Validator(params, light.bundle, light.cleaned, light.raw, light.survey)
    groups = [group for group in MEASURES if is_measured(group, params)]
    assert groups == ["areas", "collision", "survey", "certificate"]
    certificate = validator.certificate
    assert certificate.holds, certificate.clauses
    assert certificate.contacts == 0
    assert {"intrusion_mm", "missing_mm", "clearance_error_m", "same_graph"} <= set(certificate.clauses)
    assert not {"contacts", "escapes", "deepest_m"} & set(certificate.clauses)


def test_a_light_world_may_have_all_metrics_but_those_of_visible_rock(light, light_config, config):
    params = light_config.validation.model_copy(update={"extent": "full"})
    groups = [group for group in MEASURES if is_measured(group, params)]
    assert set(MEASURES) - set(groups) == {"texture", "relief", "walls"}
    assert all(is_measured(group, config.validation) for group in (*MEASURES, "a_new_group"))
    limits, rock = applying_limits(params, {"survey.narrowed_m": 0.0}), {"texture", "relief", "walls"}
    assert set(params.limits) - set(limits) == {name for name in params.limits if name.partition(".")[0] in rock}
    assert set(params.limits) - set(limits)
    validator = Validator(params, light.bundle, light.cleaned, light.raw, light.survey)
    assert validator.measure("iou")["free_space_vs_cleaned"] > 0.99
    assert validator.measure("world")["warnings"] == 0


def test_a_certificate_that_asks_for_the_stress_test_does_not_hold_without_it(light, light_config, config):
    validator = Validator(light_config.validation, light.bundle, light.cleaned, light.raw, light.survey)
    assert not certify("0" * 64, validator.containment, config.validation.certificate.limits).holds


def test_a_world_cannot_escape_the_limits_on_rock_by_having_none(light, light_config, config):
    with pytest.raises(ArtifactError, match=r"a world with no visible rock, but validation\.overlay = rough"):
        Validator(config.validation, light.bundle, light.cleaned, light.raw, light.survey)


def test_a_world_with_rock_is_refused_where_there_must_be_none(tee, light_config):
    with pytest.raises(ArtifactError, match=r"a world with visible rock, but validation\.overlay = none"):
        Validator(light_config.validation, tee.bundle, tee.cleaned, tee.raw, tee.survey)


@pytest.mark.parametrize("name", ["preview.png", "textures/rock.png", "meshes/smooth_walls.msh"])
def test_a_light_world_with_a_file_of_visible_rock_is_refused(light, tee, name):
    files = sealed({**read_folder(light.bundle), name: (tee.bundle / name).read_bytes()})
    with pytest.raises(BundleError, match=rf"{name}: world\.json says overlay = 'none'"):
        require_allowed(light.bundle, files)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"overlay": "none"', '"overlay": "rough"', "textures/rock.png: missing"),
        ('"overlay": "none"', '"overlay": "some"', "overlay = 'some': want 'rough' or 'none'"),
        ('\n  "overlay": "none",', "", "overlay = None: want 'rough' or 'none'"),
    ],
)
def test_a_record_says_what_overlay_the_world_has(light, old, new, words):
    files = read_folder(light.bundle)
    record = files["world.json"].decode()
    assert old in record
    files = sealed({**files, "world.json": record.replace(old, new).encode()})
    with pytest.raises(BundleError, match=words):
        require_allowed(light.bundle, files)


def test_a_light_world_with_a_surface_body_or_another_colour_is_refused(light, tmp_path):
    files = read_folder(light.bundle)
    for old, new, words in (
        (
            '<camera name="entrance"',
            '<body name="surface"/><camera name="entrance"',
            "bodies: 'surface' is one too many",
        ),
        ('rgba="0.54 0.44 0.36 1"', 'rgba="0.54 0.44 0.36 0"', "mat_rgba"),
    ):
        assert old in files["mine.xml"].decode()
        changed = {**files, "mine.xml": files["mine.xml"].replace(old.encode(), new.encode(), 1)}
        assert words in model_refusal(tmp_path / "w", changed)


def test_a_light_world_with_a_wrong_figure_is_refused_by_the_proof(light, light_config, tmp_path):
    bundle = tmp_path / "world"
    shutil.copytree(light.bundle, bundle)
    edit_record(lambda record: record.update(loops=record["loops"] + 1))(bundle)
    seal(bundle)
    with pytest.raises(ArtifactError, match="loops = 1"):
        require_built(bundle, open_bundle(bundle).record, light_config.validation)


def test_a_robot_drives_and_sees_in_a_light_world(light):
    env = MineEnv(light.bundle, render_mode="rgb_array")
    first, _ = env.reset(seed=4)
    assert first.min() >= -1
    assert (first[:16] < 1).sum() >= 8  # a drift of 5 m has walls within 10 m on most sides
    for _ in range(20):
        _, _, _, _, info = env.step(np.array([0.5, 0.0]))
    assert info["coverage"] > 0
    picture = env.render()
    assert picture.std() > 5
    assert [group.name for group in shown_groups(env.world)] == ["FLOOR", "ROBOT", "COLLISION", "ROOF"]
    env.close()


def test_the_viewer_which_looks_from_above_leaves_the_roof_of_a_light_world_out(light, monkeypatch):
    shown = []

    class Window:
        def __init__(self, model, data, on_key, groups):
            shown.extend(groups)

        def sync(self):
            pass

        def close(self):
            pass

    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr("minexplore.pictures.viewer.Viewer", Window)
    env = MineEnv(light.bundle, render_mode="human")
    env.reset(seed=4)
    env.close()
    assert [group.name for group in shown] == ["FLOOR", "ROBOT", "COLLISION"]


def test_a_camera_that_looks_up_in_a_light_world_sees_its_roof(light):
    env = MineEnv(light.bundle)
    env.reset(seed=4)
    env.suite.sensor("rgb").params = CameraParams(mount=Mount(x_m=0.0, height_m=0.5, pitch_deg=-60.0))
    assert (env.capture("labels") == NUMBERS["roof"]).mean() > 0.2
    assert (env.capture("depth") > 0).all()
    env.close()


def test_the_report_of_a_light_world_draws_the_walls_of_its_outline(light):
    page = scene_page(light.bundle, open_bundle(light.bundle).record, light.free_space, light.network)
    assert len(page) > 100_000  # three.js and the geometry


def test_sweeps_are_not_replayed_in_a_light_world_which_is_named(light, tmp_path):
    (tmp_path / "sweep_1.csv").touch()
    with pytest.raises(InputError, match=r"no visible rock .* preset=light"):
        replay(light.bundle, tmp_path, tmp_path / "poses.csv", None, [])


def test_a_light_volume_is_neither_replayed_nor_compared(tmp_path):
    bundle = VolumeWorld(RAMP, tmp_path).bundle
    (tmp_path / "sweep_1.csv").touch()
    with pytest.raises(InputError, match=r"no visible rock .* preset=light"):
        replay(bundle, tmp_path, tmp_path / "poses.csv", None, [])
    with pytest.raises(ArtifactError, match=r"a world of one volume .*, which this command does not read"):
        parity(bundle, 10, None)
