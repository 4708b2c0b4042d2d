"""The visible floor of a volume: over every floor and nowhere else, water on level ones, and made again by stage 6."""

import dataclasses

import numpy as np
import pytest
import shapely
import trimesh

from minexplore.bundle import (
    COVER_M,
    MODEL,
    PREVIEW,
    SHADE_MESH,
    BundleError,
    decode_msh,
    encode_msh,
    is_cover,
    mesh_file,
    puddle_geom,
    stops_beams,
)
from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from minexplore.looks import SHADE_LEVELS
from minexplore.sealed.files import read_folder
from minexplore.sensing.facet_meshes import volume_meshes
from minexplore.world import load_world
from pipeline.errors import ArtifactError
from pipeline.export.extract_volume import read_volume_scene
from pipeline.geometry.raycast import RayCaster
from pipeline.mjcf.scene import ZoneStrip
from pipeline.store.codecs import decode
from pipeline.types import Image
from pipeline.volume.world.floor.cover import lay_floor
from pipeline.volume.world.floor.pixels import PixelIndex, pixels_on
from pipeline.volume.world.model import eye_over
from pipeline.volume.world.proof.alone import survey_alone
from pipeline.volume.world.proof.certificate import open_volume
from pipeline.volume.world.proof.derived_content import require_remade
from pipeline.volume.world.topology import LegNetwork, LegRecord
from tests.heights import HEADER
from tests.mines import require_allowed
from tests.volume.world.surface.test_volume_rock import resealed
from tests.volume_worlds import WITH_ROCK, proof, with_rock

FLOOR = WITH_ROCK.realism.floor
# A drift that falls by 15 %, and one from its end that is level.
SLOPE = HEADER + "A,1,0,0,2,2,10,3.2,0\nA,2,16,0,2,2,7.6,3.2,0\nA,3,48,0,2,2,7.6,3.2,0\n"


@pytest.fixture(scope="module")
def slope(tmp_path_factory):
    """Return the bundle of a drift that falls and then is level, with visible rock; tests must not change it."""
    return with_rock(SLOPE, tmp_path_factory.mktemp("falling")) / "rocky"


def zones_of(west_m, east_m, *names):
    edges = np.linspace(west_m, east_m, len(names) + 1)
    rgba = (0.5, 0.5, 0.5, 1.0)
    return [
        ZoneStrip(name, 1.0, 1.0, 0.0, rgba, float(a), float(b), -50.0, 50.0)
        for name, a, b in zip(names, edges[:-1], edges[1:], strict=True)
    ]


def mine_of(*solids):
    """Return the free space of closed meshes, whose facets are floors, walls and roofs by their normals."""
    mesh = trimesh.util.concatenate(solids)
    up = mesh.face_normals[:, 2]
    label = np.where(up < -0.7, FacetLabel.FLOOR, np.where(up > 0.7, FacetLabel.ROOF, FacetLabel.WALL))
    faces = mesh.faces.astype(np.int32)
    return VolumeFacets(mesh.vertices.copy(), faces, label.astype(np.int32), np.zeros(len(faces), np.int32))


def profile(corners, wide_m=5.0):
    """Return a drift to the east with a profile, east and up in m, as a closed mesh."""
    solid = trimesh.creation.extrude_polygon(shapely.Polygon(corners), wide_m)
    return trimesh.Trimesh(solid.vertices[:, [0, 2, 1]], solid.faces[:, ::-1], process=False)


def legs_along(*lines):
    """Return the network of legs from place to place, whose floors are 1 m below."""
    stations, legs = {}, []
    for number, (a, b) in enumerate(lines):
        stations |= {f"{number}a": tuple(map(float, a)), f"{number}b": tuple(map(float, b))}
        run = float(np.hypot(b[0] - a[0], b[1] - a[1]))
        sections = [(2.0, 2.0, 1.0, 1.0)] * 2
        legs.append(LegRecord(str(number), f"{number}a", f"{number}b", run, abs(b[2] - a[2]) / run, sections))
    return LegNetwork(stations, legs, [], [], [], 0, 1, 1.0)


def muck_of(meshes):
    return np.concatenate([mesh.vertices[mesh.faces] for name, mesh in meshes.items() if is_cover(name)]).astype(float)


def heights_over(meshes, places):
    """Return how high (n,) m muck is above places (n, 3) m on a floor: infinite where none is within 0.2 m."""
    down = np.tile([0.0, 0.0, -1.0], (len(places), 1))
    found = 0.2 - RayCaster(muck_of(meshes)).cast(places + np.array([0, 0, 0.2]), down)
    return np.where(found > -0.1, found, np.inf)


def places_on(mine, count=4000):
    """Return places (count, 3) m all over the floors of a mine."""
    corners = mine.vertices[mine.faces[mine.label == FacetLabel.FLOOR]]
    area = np.abs(mine.normals[mine.label == FacetLabel.FLOOR, 2])
    rng = np.random.default_rng(0)
    some = corners[rng.choice(len(corners), count, p=area / area.sum())]
    return (rng.dirichlet(np.ones(3), count)[:, :, None] * some).sum(axis=1)


def test_muck_covers_the_floor_of_a_slope_just_above_it(slope):
    world = open_volume(slope)
    meshes = {path.stem: decode_msh(path.read_bytes()) for path in slope.glob("meshes/*")}
    height = heights_over(meshes, places_on(world.mine))
    assert np.isfinite(height).mean() > 0.998
    covered = height[np.isfinite(height)]
    assert covered.min() > 0.002
    assert covered.max() <= COVER_M
    assert 0.02 < np.median(covered) < 0.04


def test_floors_above_each_other_have_muck_of_their_own_and_no_more():
    rooms = [trimesh.creation.box(bounds=[[0, 0, z], [12, 6, z + 2.5]]) for z in (0.0, 3.0, 6.0)]
    mine = mine_of(*rooms)
    meshes = lay_floor(FLOOR, mine, legs_along(([1, 3, 1], [11, 3, 1])), zones_of(0, 12, "dry"))
    assert np.isfinite(heights_over(meshes, places_on(mine))).mean() > 0.998
    muck = muck_of(meshes)
    one, other = muck[:, 1, :2] - muck[:, 0, :2], muck[:, 2, :2] - muck[:, 0, :2]
    area = (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]) / 2
    assert area.sum() == pytest.approx(3 * 72, rel=2e-3)
    assert area.min() > 0


def test_ruts_follow_legs_on_their_own_storey_alone():
    mine = mine_of(*(trimesh.creation.box(bounds=[[0, 0, z], [30, 6, z + 2.5]]) for z in (0.0, 3.0)))
    meshes = lay_floor(FLOOR, mine, legs_along(([1, 3, 1], [29, 3, 1])), zones_of(0, 30, "dry"))
    x = np.linspace(3, 27, 200)
    lower, upper = (
        heights_over(meshes, np.column_stack([x, np.full(200, 3 + FLOOR.gauge_m / 2), np.full(200, z)]))
        for z in (0.0, 3.0)
    )
    assert lower.mean() < upper.mean() - 0.01


def test_water_stands_on_level_floors_of_flooded_zones_alone(slope):
    mine = open_volume(slope).mine
    meshes = lay_floor(FLOOR, mine, legs_along(([0, 0, 11], [48, 0, 11])), zones_of(0, 48, "dry", "water"))
    water = meshes[puddle_geom("water")]
    east = water.vertices[:, 0]
    assert east.min() == pytest.approx(24, abs=1e-3)
    assert np.ptp(water.vertices[:, 2]) < 1e-3  # it is where the drift is level
    falling = lay_floor(FLOOR, mine, legs_along(([0, 0, 11], [48, 0, 11])), zones_of(-24, 48, "water", "dry"))
    assert puddle_geom("water") not in falling
    assert SHADE_MESH in falling


def test_muck_under_water_and_above_it_meet_at_shores_within_a_level_floor():
    mine = mine_of(trimesh.creation.box(bounds=[[0, 0, 0], [40, 6, 3]]))
    meshes = lay_floor(FLOOR, mine, legs_along(([1, 3, 1], [39, 3, 1])), zones_of(0, 40, "dry", "water"))
    places = places_on(mine)
    height = heights_over(meshes, places)
    under = height < FLOOR.water_m
    wet = (places[:, 0] > 22) & (places[:, 0] < 38)
    assert 0.3 < under[wet].mean() < 0.8
    assert under[(places[:, 0] > 19.6) & (places[:, 0] < 20.4)].mean() < 0.05


def test_muck_ends_low_at_a_drop_and_does_not_hang_over_it():
    step = profile([(0, 2), (10, 2), (10, 0), (20, 0), (20, 5), (0, 5)])
    mine = mine_of(step)
    assert {FacetLabel(k) for k in mine.label} == set(FacetLabel)
    meshes = lay_floor(FLOOR, mine, legs_along(([1, 2.5, 3], [9, 2.5, 3])), zones_of(0, 20, "dry"))
    upper = muck_of(meshes)
    upper = upper[upper[:, :, 2].min(axis=1) > 1.9].reshape(-1, 3)
    assert upper[:, 0].max() == pytest.approx(10, abs=0.02)
    at_edge = upper[:, 0] > 9.95
    assert upper[at_edge, 2].max() < 2.012
    rib = heights_over(meshes, np.column_stack([np.full(50, 5.0), np.full(50, 0.05), np.full(50, 2.0)]))
    assert rib.min() > 0.04


def test_a_grid_has_each_of_its_points_in_one_facet():
    rng = np.random.default_rng(4)
    points = np.concatenate([[[0, 0], [9, 0], [9, 7], [0, 7]], rng.uniform(0.3, 6.7, (40, 2))])
    faces = shapely.get_parts(shapely.delaunay_triangles(shapely.multipoints(points)))
    corners = np.array([shapely.get_coordinates(face)[:3] for face in faces])
    facet, pixels = pixels_on(corners, np.array([-0.5, 7.5]), 0.25)
    places = np.array([-0.5, 7.5]) + 0.25 * pixels * [1, -1]
    assert len(np.unique(pixels, axis=0)) == len(pixels) == 36 * 28
    assert shapely.distance(shapely.polygons(corners[facet]), shapely.points(places)).max() < 1e-9


def test_points_are_found_again_by_pixel_and_height():
    pixels = np.array([[3, 5], [3, 5], [4, 5], [0, 9]])
    index = PixelIndex(pixels, np.array([0.0, 3.0, 0.1, -2.0]))
    asked = np.array([[3, 5], [3, 5], [3, 5], [4, 5], [5, 5], [0, 9]])
    found = index.find(asked, np.array([0.1, 2.8, 1.5, 0.0, 0.0, -2.0]), 0.3)
    assert found.tolist() == [0, 1, -1, 2, -1, 3]


def test_a_sealed_world_with_a_visible_floor_is_allowed_and_beams_pass_it(slope):
    require_allowed(slope, read_folder(slope))
    world = load_world(slope)
    names = [path.stem for path in slope.glob("meshes/*")]
    assert any(map(is_cover, names))
    assert not any(stops_beams(name) for name in names if is_cover(name) or name == SHADE_MESH)
    assert not [name for name in volume_meshes(world, world.volume.facets) if "cover" in name or "shade" in name]
    model = world.compile(world.spec())
    shown = [model.geom(k).name for k in range(model.ngeom)]
    assert sum(name.startswith("shade_") for name in shown) == len(SHADE_LEVELS)
    assert puddle_geom("water") in shown


def test_the_preview_shows_rock_all_about_the_entrance_below_the_mine_from_above(slope):
    picture = decode(slope / PREVIEW, Image)
    rows = picture.shape[1] * 7 // 16
    above, entrance = picture[:-rows], picture[-rows:]
    assert picture.shape[1] == WITH_ROCK.realism.preview_width_px
    assert 0.01 < (above != above[0, 0]).any(axis=2).mean() < 0.9
    assert (entrance.max(axis=2) > 2).mean() > 0.98
    with pytest.raises(BundleError, match=r"preview\.png: missing"):
        require_allowed(slope, resealed(read_folder(slope), **{PREVIEW: None}))


def test_the_camera_at_the_entrance_is_below_the_roof_of_a_crawl(slope):
    cells = open_volume(slope).cells
    anchor = cells.places_m[0]
    for headroom_m, wanted_m in ((3.2, 1.2), (2.4, 1.2), (0.8, 0.4)):
        low = dataclasses.replace(cells, headroom_m=np.full(len(cells.headroom_m), headroom_m))
        assert eye_over(low, anchor) == pytest.approx(wanted_m)


def test_an_export_has_muck_and_water_and_no_shade(slope):
    scene = read_volume_scene(load_world(slope), "CC0-1.0")
    surfaces = {surface.name: surface for surface in scene.surfaces}
    water = surfaces[puddle_geom("water")]
    assert water.label == "water"
    bare = decode_msh((slope / mesh_file(water.name)).read_bytes())
    np.testing.assert_allclose(water.mesh.vertices[:, 2] - bare.vertices[:, 2], FLOOR.water_m, atol=1e-6)
    assert {surface.zone for name, surface in surfaces.items() if is_cover(name)} == {"dry", "mud", "water"}
    assert not [name for name in surfaces if name.startswith(SHADE_MESH)]


@pytest.mark.parametrize(
    ("kind", "change", "message"),
    [
        ("cover", lambda mesh: {"vertices": mesh.vertices + np.float32([0, 0, 0.02])}, "from where it should be"),
        ("shade", lambda mesh: {"vertices": mesh.vertices + np.float32([0, 0, 1.0])}, "from where it should be"),
        ("puddle", lambda mesh: {"faces": mesh.faces[:1]}, "vertices, faces, texture coordinates and normals, want"),
    ],
)
def test_a_floor_that_the_builder_does_not_lay_is_refused(slope, tmp_path, kind, change, message):
    path = next(iter(sorted(slope.glob(f"meshes/{kind}*"))))
    mesh = decode_msh(path.read_bytes())
    data = encode_msh(dataclasses.replace(mesh, **change(mesh)))
    folder = written(tmp_path, resealed(read_folder(slope), **{mesh_file(path.stem): data}))
    with pytest.raises(ArtifactError, match=message):
        require(folder, FLOOR)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (None, "realism.floor = null says none"),
        ({"water_m": 0.02}, "by realism.floor"),
        ({"puddles": ["mud"]}, "by realism.floor"),
        ({"seed": 12}, "by realism.floor"),
    ],
)
def test_a_floor_of_other_parameters_is_refused(slope, changes, message):
    require(slope, FLOOR)
    with pytest.raises(ArtifactError, match=message):
        require(slope, None if changes is None else FLOOR.model_copy(update=changes))


def test_water_that_stands_higher_in_the_model_is_refused(slope, tmp_path):
    text = (slope / MODEL).read_text()
    assert 'pos="0 0 0.018"' in text
    higher = text.replace('pos="0 0 0.018"', 'pos="0 0 1.5"').encode()
    folder = written(tmp_path, resealed(read_folder(slope), **{MODEL: higher}))
    with pytest.raises(ArtifactError, match=r"puddle_water\]@pos = 0 0 1.5, want 0 0 0.018"):
        require(folder, FLOOR)


def written(folder, files):
    """Write files into a folder, which is returned."""
    for name, data in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(data)
    return folder


def require(folder, floor):
    """Make what a bundle holds again, as stage 6 does."""
    world = open_volume(folder)
    require_remade(folder, world, proof(), survey_alone(world, proof()), floor=floor)
