import itertools
import math
import shutil
import zipfile

import mujoco
import numpy as np
import pytest
import shapely

from minexplore.bundle import ROOF_GEOM, WALLS, GeomGroup, is_rock, mesh_file, smooth_mesh
from pipeline.errors import ArtifactError
from pipeline.geometry.rasterize import fill_polygon
from pipeline.mjcf.bundle import open_bundle, part_vertices
from pipeline.mjcf.render import render_free_space
from pipeline.mjcf.scene import place_lights, tile_zones, tilt_about_centre
from pipeline.store.verify import verify_world
from tests.mines import TEE, BuiltMine, footprint_errors


def forward(world):
    data = mujoco.MjData(world.model)
    mujoco.mj_forward(world.model, data)
    return data


def test_a_bundle_loads_without_warnings_and_its_record_matches_the_plan(tee: BuiltMine):
    world = open_bundle(tee.bundle)
    assert world.warnings == 0
    assert world.record.loops == 0
    assert world.record.collision_parts == len(tee.compiled["collision.npz"])
    assert world.record.areas.tunnel_m2 == pytest.approx(80 * 5 + 5 * 35, rel=0.001)


def test_a_moved_and_zipped_bundle_is_the_same_world(tee: BuiltMine, tmp_path):
    archive = tmp_path / "w.zip"
    with zipfile.ZipFile(archive, "w") as z:
        for path in tee.bundle.rglob("*"):
            z.write(path, path.relative_to(tee.bundle))
    with zipfile.ZipFile(archive) as z:
        z.extractall(tmp_path / "elsewhere")
    assert verify_world(tmp_path / "elsewhere") == verify_world(tee.bundle)
    assert open_bundle(tmp_path / "elsewhere").model.ngeom == open_bundle(tee.bundle).model.ngeom
    text = (tee.bundle / "mine.xml").read_text()
    assert str(tee.bundle) not in text
    assert 'file="/' not in text


def test_walls_of_the_compiled_model_match_the_outline(tee: BuiltMine):
    world = open_bundle(tee.bundle)
    parts = part_vertices(world.model, GeomGroup.COLLISION)
    assert len(parts) == world.record.collision_parts
    intrusion, missing = footprint_errors(parts, tee.free_space.polygon, shapely.box(*world.record.world_m))
    assert intrusion < 1e-4
    assert missing < 1e-3
    heights = np.concatenate(parts)[:, 2]
    assert (heights.min(), heights.max()) == pytest.approx((0.0, 3.5), abs=1e-5)


def test_the_mine_is_tilted_five_degrees_about_y_with_the_east_lower(tee: BuiltMine):
    world = open_bundle(tee.bundle)
    data = forward(world)
    body = world.model.body("mine").id
    east = data.xmat[body].reshape(3, 3) @ [1, 0, 0]
    assert math.degrees(math.asin(-east[2])) == pytest.approx(5.0, abs=1e-4)
    rotation = data.xmat[body].reshape(3, 3)
    assert np.column_stack([rotation, data.xpos[body]]) == pytest.approx(
        np.array(world.record.T_world_mine)[:3], abs=1e-4
    )
    # 60 m of tunnel gain the height that the paper states; the whole length gains far more.
    assert world.record.gain_m["entrance_region"] == pytest.approx(5.2, abs=0.05)


def test_three_zones_tile_the_floor_in_thirds_with_their_frictions(tee: BuiltMine):
    world = open_bundle(tee.bundle)
    west, south, east, north = world.record.world_m
    zones = world.record.zones
    assert [(z.name, z.friction) for z in zones] == [("dry", 1.0), ("mud", 0.55), ("water", 0.25)]
    assert (zones[0].west_m, zones[-1].east_m) == (west, east)
    for left, right in itertools.pairwise(zones):
        assert left.east_m == right.west_m
    for zone in zones:
        geom = world.model.geom(f"floor_{zone.name}")
        assert geom.friction[0] == zone.friction
        assert geom.size[0] * 2 == pytest.approx(zone.east_m - zone.west_m)
        assert zone.east_m - zone.west_m == pytest.approx((east - west) / 3, abs=0.1)
        assert geom.size[1] * 2 == pytest.approx(north - south)
        assert geom.pos[2] + geom.size[2] == pytest.approx(0.0)


def slide(world, zone, seconds=1.0, speed=2.0):
    """Return the displacement (3,), m, of a block of high friction that slides north on one zone."""
    spec = mujoco.MjSpec.from_file(str(world))
    mine = spec.body("mine")
    floor = spec.geom(f"floor_{zone}")
    block = spec.worldbody.add_body(name="block", pos=[0, 0, 0])
    block.add_freejoint()
    block.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.3, 0.3, 0.1], mass=20, friction=[1.0, 0.005, 0.0001])
    for geom in spec.geoms:
        if is_rock(geom.name) or geom.name == ROOF_GEOM:
            geom.contype = geom.conaffinity = 0
    model = spec.compile()
    data = mujoco.MjData(model)
    place = np.array([floor.pos[0], floor.pos[1] - 3, 0.1])
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, mine.quat)
    data.qpos[:3] = rotation.reshape(3, 3) @ place + mine.pos
    data.qpos[3:7] = mine.quat
    data.qvel[:3] = rotation.reshape(3, 3) @ [0, speed, 0]
    start = data.qpos[:3].copy()
    while data.time < seconds:
        mujoco.mj_step(model, data)
    return rotation.reshape(3, 3).T @ (data.qpos[:3] - start)


def test_the_zones_friction_and_not_the_blocks_own_decides_how_far_it_slides(tee: BuiltMine):
    travelled = {zone: slide(tee.bundle / "mine.xml", zone)[1] for zone in ("dry", "mud", "water")}
    # v^2 / (2 mu g): 0.20 m dry, 0.37 m in mud, 0.82 m in water.
    for zone, friction in (("dry", 1.0), ("mud", 0.55), ("water", 0.25)):
        assert travelled[zone] == pytest.approx(4 / (2 * friction * 9.81), rel=0.15), zone


def test_any_number_of_zones_covers_the_floor_without_gaps(config):
    zone = config.realism.zones[0]
    zones = tile_zones([zone.model_copy(update={"name": f"z{i}"}) for i in range(7)], (-3.3, 0.0, 96.6, 10.0))
    assert zones[0].west_m == -3.3
    assert zones[-1].east_m == 96.6
    assert all(a.east_m == b.west_m for a, b in itertools.pairwise(zones))


def along_x(length_m):
    """Return a level floor along x without a roof."""
    return np.array([[0.0, 0.0, 0.0, 1e9], [length_m, 0.0, 0.0, 1e9]])


def test_lights_are_twenty_metres_apart_and_point_along_the_drift_and_down():
    lights = place_lights([along_x(100.0)], 20.0, 3.0, 20.0, 45.0, None)
    assert [light.place_m for light in lights] == [(float(x), 0.0, 3.0) for x in range(0, 101, 20)]
    for light in lights:
        assert light.direction == pytest.approx((math.cos(math.radians(20)), 0, -math.sin(math.radians(20))))
    assert len(place_lights([along_x(700.0)], 20.0, 3.0, 20.0, 45.0, 33)) == 33


def test_tilting_keeps_lengths_and_centres_the_mine():
    transform = tilt_about_centre(5.0, (-10.0, 0.0, 50.0, 20.0))
    assert transform @ [20, 10, 0, 1] == pytest.approx([0, 0, 0, 1])
    assert transform[:3, :3] @ transform[:3, :3].T == pytest.approx(np.eye(3))


@pytest.mark.parametrize("mine", ["tee", "ring"])
def test_the_rendered_world_has_the_same_free_pixels_as_its_polygon(mine, request):
    built: BuiltMine = request.getfixturevalue(mine)
    world = open_bundle(built.bundle)
    rendered = render_free_space(world.model, np.array(world.record.T_world_mine), built.frame, 3.5)
    drawn = fill_polygon(built.free_space.polygon, built.frame)
    assert np.count_nonzero(rendered != drawn) <= 4
    assert (rendered & built.cleaned).sum() / (rendered | built.cleaned).sum() > 0.999


def test_the_same_inputs_give_the_same_bytes(tee: BuiltMine, config, tmp_path):
    again = BuiltMine(TEE, config, tmp_path)
    assert verify_world(again.bundle) == verify_world(tee.bundle)


@pytest.mark.parametrize("change", ["edit", "drop", "add", "record", "escape"])
def test_a_changed_bundle_is_refused_with_the_name_of_the_file(tee: BuiltMine, tmp_path, change):
    bundle = tmp_path / "b"
    shutil.copytree(tee.bundle, bundle)
    record = bundle / "world.json"
    match change:
        case "edit":
            (bundle / "mine.xml").write_text((bundle / "mine.xml").read_text().replace("rock_0001", "rock_9991"))
            name = r"mine\.xml"
        case "drop":
            (bundle / mesh_file(smooth_mesh(WALLS))).unlink()
            name = r"walls\.msh: missing"
        case "add":
            (bundle / "extra.bin").write_bytes(b"x")
            name = r"extra\.bin: not listed"
        case "record":
            record.write_text(record.read_text().replace('"tilt_deg": 5.0', '"tilt_deg": 4.0'))
            name = r"world\.json"
        case "escape":
            record.write_text(record.read_text().replace('"mine.xml":', '"../mine.xml":'))
            name = "leads out of the bundle"
    with pytest.raises(ArtifactError, match=name):
        open_bundle(bundle)


def test_the_error_for_a_missing_opengl_says_how_to_install_it(tee: BuiltMine, monkeypatch):
    world = open_bundle(tee.bundle)

    def no_context(*args, **kwargs):
        raise mujoco.FatalError("an OpenGL platform library has not been loaded")

    monkeypatch.setattr(mujoco.Renderer, "__init__", no_context)
    with pytest.raises(ArtifactError, match=r"make setup. installs libosmesa6"):
        render_free_space(world.model, np.array(world.record.T_world_mine), tee.frame, 3.5)
