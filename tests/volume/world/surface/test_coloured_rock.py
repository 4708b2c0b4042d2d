"""The colours of a scan on the visible rock of its world: laid in one picture, and seen where they belong."""

from functools import cache

import mujoco
import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from minexplore.bundle import MINE_BODY, MODEL, ROCK_TEXTURE, cover_material, decode_msh, ground_material
from minexplore.floors.volume_arrays import VolumeFacets
from pipeline.export.exporter import export_world
from pipeline.params.survey import CloudSurveyParams
from pipeline.places import TEXTURE
from pipeline.schema import check_world
from pipeline.store.codecs import decode
from pipeline.survey.load import read_unlimited
from pipeline.volume.world.bundle import bundle_volume
from pipeline.volume.world.proof.again.remodelled import require_same_model
from pipeline.volume.world.proof.certificate import open_volume
from pipeline.volume.world.surface.build import rock_of_volume
from stages.surface import _texture
from tests.composed import compose
from tests.survey.clouds.test_cloud_volume import drift, noisy, sampled
from tests.volume_worlds import VolumeWorld, write
from tests.volumes import BOX

CONFIG = compose(["+mine=heights", "surface.rough.spacing_m=0.3", "surface.texture.scan_px=512"])
SURFACE = CONFIG.surface
RED, BLUE, GREEN, YELLOW, GREY = (200, 40, 40), (40, 40, 200), (40, 160, 40), (180, 180, 40), (120, 110, 100)
BARE = (14.0, -2.0, 1.5)  # in the blue wall: points within 1.2 m of it have no colour
LOOKED_AT = {  # a place on the rock, and its colour
    (5.0, 2.0, 1.5): RED,
    (15.0, 2.0, 1.0): RED,
    (9.0, 2.0, 1.5): YELLOW,
    (9.0, 2.0, 0.8): YELLOW,
    (4.0, -2.0, 1.5): BLUE,
    (10.0, -2.0, 1.0): BLUE,
    (5.0, 0.0, 3.0): GREEN,
    (15.0, 0.5, 3.0): GREEN,
}


@cache
def texture():
    """Return the drawn texture of rock without colours."""
    return _texture(CONFIG.surface.texture)


def colours_of(points):
    """Return the colours of a drift along x: a red wall in the north with a yellow band, a blue one, a green roof."""
    x, y, z = points.T
    rgb = np.full((len(points), 3), GREY)
    rgb[y > 1.9] = np.where(np.abs(x[y > 1.9] - 9)[:, None] < 1, YELLOW, RED)
    rgb[y < -1.9] = BLUE
    rgb[z > 2.9] = GREEN
    return rgb.astype(np.uint8)


def rocky(built, folder, rock):
    write(folder / "rock", {**rock.files, TEXTURE: rock.texture})
    plan = built.traced["free_space"]
    write(folder / "rocky", bundle_volume(CONFIG.realism, built.survey, plan, built.compiled, folder / "rock"))
    return folder / "rocky"


def spread(vertices, faces, texcoords):
    """Return places (n, 3) all over a mesh, 100 a m2, and their texture coordinates (n, 2)."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    places, face = trimesh.sample.sample_surface(mesh, int(100 * mesh.area), seed=0)
    share = trimesh.triangles.points_to_barycentric(mesh.triangles[face], places)
    return np.asarray(places), np.einsum("nk,nkd->nd", share, texcoords[faces[face]])


class Scanned:
    """A drift of 20 m with points on all of its surface, its rock, and its bundle."""

    def __init__(self, folder):
        self.built = VolumeWorld(BOX, folder)
        facets = decode(self.built.compiled / "volume.npz", VolumeFacets)
        mesh = trimesh.Trimesh(facets.vertices, facets.faces, process=False)
        self.points = np.asarray(trimesh.sample.sample_surface(mesh, 200 * int(mesh.area), seed=0)[0])
        self.rgb = colours_of(self.points)
        self.rgb[np.linalg.norm(self.points - BARE, axis=1) < 1.2] = 0
        self.rock = self.rock_with(self.rgb)
        self.bundle = rocky(self.built, folder, self.rock)

    def rock_with(self, rgb):
        return rock_of_volume(SURFACE, self.built.compiled, texture(), self.points, rgb)

    def sampled(self):
        """Return places on the rock (n, 3) m, and the colour (n, 3) that its picture has there."""
        places, found = [], []
        side = self.rock.texture.shape[0]
        for data in self.rock.files.values():
            mesh = decode_msh(data)
            place, uv = spread(mesh.vertices, mesh.faces, mesh.texcoords)
            column, row = (uv * side).astype(int).T
            places.append(place)
            found.append(self.rock.texture[row, column, ::-1])
        return np.concatenate(places), np.concatenate(found).astype(float)


@pytest.fixture(scope="module")
def scanned(tmp_path_factory):
    return Scanned(tmp_path_factory.mktemp("scanned"))


def seen_at(model, data, renderer, place, moved_m=0.0):
    """Return the mean colour about the middle of a picture that looks at a place from the middle of the drift."""
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    at = np.array(place)
    eye = at + np.array([-0.8, *np.clip([-at[1], 1.5 - at[2]], -1.0, 1.0)])
    way = at - eye
    camera.lookat[:] = at + model.body(MINE_BODY).pos + moved_m
    camera.distance = np.linalg.norm(way)
    camera.azimuth = np.degrees(np.arctan2(way[1], way[0]))
    camera.elevation = np.degrees(np.arcsin(way[2] / camera.distance))
    renderer.update_scene(data, camera)
    return renderer.render()[20:28, 28:36].reshape(-1, 3).mean(axis=0)


def nearest(colour):
    """Return which of the colours has the hue of one in a picture, which lamps make darker."""
    known = np.array([RED, BLUE, GREEN, YELLOW, GREY], float)
    known /= np.linalg.norm(known, axis=1, keepdims=True)
    return (RED, BLUE, GREEN, YELLOW, GREY)[int((known @ colour).argmax())]


def test_cameras_see_the_colours_where_they_are(scanned):
    model = mujoco.MjModel.from_xml_path(str(scanned.bundle / MODEL))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, 48, 64) as renderer:
        seen = {place: nearest(seen_at(model, data, renderer, place)) for place in LOOKED_AT}
    assert seen == LOOKED_AT


def test_floors_have_no_part_of_the_picture_of_a_scan(scanned):
    spec = mujoco.MjSpec.from_file(str(scanned.bundle / MODEL))
    floors = [m for m in spec.materials if m.name.startswith((ground_material(""), cover_material("")))]
    assert len(floors) == 6
    assert not [m.name for m in floors if m.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB]]
    assert spec.material("rock").textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] == "rock"
    require_same_model(scanned.bundle, open_volume(scanned.bundle), CONFIG.realism.floor.water_m)


def test_the_picture_has_the_points_colours_all_over_the_rock(scanned):
    places, found = scanned.sampled()
    coloured = scanned.rgb.any(axis=1)
    apart, row = cKDTree(scanned.points[coloured]).query(places, 12)
    near = scanned.rgb[coloured][row]
    inside = (apart[:, 0] < 0.15) & (near.max(axis=1) == near.min(axis=1)).all(axis=1)  # away from edges of colours
    assert inside.mean() > 0.7
    off = np.abs(found[inside] - near[inside, 0]) / near[inside, 0].max(axis=1)[:, None]
    assert np.quantile(off.max(axis=1), 0.99) < 0.35  # the grain is left in
    assert np.abs(found[inside].mean(axis=0) - near[inside, 0].mean(axis=0)).max() < 4


def test_points_without_a_colour_leave_the_mean_and_no_edge(scanned):
    places, found = scanned.sampled()
    apart = np.linalg.norm(places - BARE, axis=1)
    mean = scanned.rgb[scanned.rgb.any(axis=1)].mean(axis=0)
    wall = (np.abs(places[:, 1] + 2) < 0.1) & (np.abs(places[:, 2] - 1.1) < 0.8)
    rings = [found[wall & (apart > r) & (apart <= r + 0.2)].mean(axis=0) for r in np.arange(0, 1.6, 0.2)]
    assert rings[0] == pytest.approx(mean, abs=25)
    assert rings[-1] == pytest.approx(np.array(BLUE), abs=15)
    assert np.abs(np.diff(rings, axis=0)).max() < 0.6 * np.abs(mean - BLUE).max()


def test_colours_change_no_triangle(scanned):
    plain = scanned.rock_with(np.zeros((0, 3), np.uint8))
    assert plain.files.keys() == scanned.rock.files.keys()
    for name, data in plain.files.items():
        one, other = decode_msh(data), decode_msh(scanned.rock.files[name])
        np.testing.assert_array_equal(one.vertices[one.faces], other.vertices[other.faces])
        np.testing.assert_array_equal(one.normals[one.faces], other.normals[other.faces])


def test_points_without_any_colour_leave_the_texture(scanned):
    plain = scanned.rock_with(np.zeros((len(scanned.points), 3), np.uint8))
    assert plain.texture is texture()
    assert plain.files == scanned.rock_with(np.zeros((0, 3), np.uint8)).files


def test_the_picture_is_a_square_within_its_limit_that_no_rock_leaves(scanned):
    assert scanned.rock.texture.shape == (512, 512, 3)
    for data in scanned.rock.files.values():
        texcoords = decode_msh(data).texcoords
        assert 0 <= texcoords.min() <= texcoords.max() <= 1


def test_the_bundle_is_one_that_is_accepted(scanned):
    assert ROCK_TEXTURE in check_world(scanned.bundle).files


@pytest.mark.parametrize("to", ["obj", "gltf"])
def test_exports_have_the_colours_where_they_are(scanned, tmp_path, to):
    export_world(scanned.bundle, to, tmp_path / "out", "CC-BY-4.0", CONFIG.validation)
    (file,) = [path for path in (tmp_path / "out").glob("*.obj" if to == "obj" else "*.glb") if "coll" not in path.name]
    scene = trimesh.load(file, force="scene")
    places, colours = [], []
    for mesh in scene.geometry.values():
        if getattr(mesh.visual, "uv", None) is not None:
            material = mesh.visual.material
            place, uv = spread(mesh.vertices, mesh.faces, mesh.visual.uv)
            picture = material.baseColorTexture if to == "gltf" else material.image
            if picture is not None:  # muck has coordinates alone
                places.append(place)
                colours.append(trimesh.visual.color.uv_to_color(uv, picture)[:, :3])
    near = cKDTree(np.concatenate(places)).query(list(LOOKED_AT), 4)[1]
    found = np.concatenate(colours).astype(float)[near].mean(axis=1)
    assert [nearest(colour) for colour in found] == list(LOOKED_AT.values())


@pytest.mark.slow
def test_a_scan_with_colours_becomes_a_world_with_them(tmp_path):
    points = noisy(sampled(drift(), 250))
    rgb = colours_of(points - [0, 2, 0])
    path = tmp_path / "a.ply"
    trimesh.PointCloud(points, colors=rgb).export(path)
    params = CloudSurveyParams(kind="cloud", name="test", file="data/x", heights=None, voxel_m=0.2)
    built = VolumeWorld(read_unlimited(params.model_copy(update={"file": path.as_posix()})), tmp_path)
    solid = built.shape
    rock = rock_of_volume(SURFACE, built.compiled, texture(), solid.scan_m, solid.scan_rgb)
    model = mujoco.MjModel.from_xml_path(str(rocky(built, tmp_path, rock) / MODEL))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    moved = np.array([0, 2, 1])  # height 0 is a metre below the floor
    with mujoco.Renderer(model, 48, 64) as renderer:
        seen = {place: nearest(seen_at(model, data, renderer, place, moved)) for place in LOOKED_AT if place[0] < 13}
    assert seen == {place: colour for place, colour in LOOKED_AT.items() if place[0] < 13}
