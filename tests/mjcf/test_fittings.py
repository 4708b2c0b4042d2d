"""The visible floor and furniture: seen, never touched, and refused where they would stand in the drift."""

import dataclasses
import json
import re

import mujoco
import numpy as np
import pytest
import shapely

from minexplore.bundle import (
    COVER_M,
    FITTINGS_BODY,
    FURNITURE,
    LINES_ABOVE_M,
    MODEL,
    TriangleMesh,
    decode_msh,
    encode_msh,
    is_cover,
    is_fitting,
)
from minexplore.looks import SHADE_LEVELS
from minexplore.physics.local_models import LocalModels
from minexplore.physics.robot import RobotParams
from minexplore.pictures.render import far_hidden
from minexplore.sealed.files import read_folder
from minexplore.sensing.lidar import Lidar, surface_meshes
from minexplore.task import TaskParams
from minexplore.world import load_world
from pipeline.errors import ArtifactError, ParamsError
from pipeline.geometry.raycast import RayCaster
from pipeline.mjcf.bundle import obstacles, open_bundle
from pipeline.mjcf.floor.cover import cover_floor
from pipeline.mjcf.floor.grid import level_grid
from pipeline.mjcf.furniture import _merged, hang_furniture, on_level, over_level, ways_of
from pipeline.mjcf.loading import load_model
from pipeline.mjcf.scene import ZoneStrip
from pipeline.mjcf.weld_mesh import hang_weld_mesh
from pipeline.params.config import Config
from pipeline.params.fittings import FloorParams
from pipeline.proof.rebuilt.fittings import _mesh_difference
from pipeline.proof.rebuilt.visible import face_samples
from pipeline.proof.rebuilt.whole_bundle import require_built
from pipeline.types import DriftNetwork, Leg, Mesh
from tests.composed import compose
from tests.mines import COARSE_ROCK, BuiltMine, model_refusal, refusal, sealed

DRIFT = shapely.union_all([shapely.box(0, 0, 36, 5), shapely.box(14, 5, 19, 16)])
FITTED = [
    "rock=andesite",
    "look=wet",
    "fittings=drift",
    "realism.furnish=meshed",
    "surface.texture.size_px=64",
    "surface.rough.kept_share=null",
    *COARSE_ROCK,
]


@pytest.fixture(scope="module")
def fitted_config() -> Config:
    return compose(FITTED)


@pytest.fixture(scope="module")
def fitted(fitted_config: Config, tmp_path_factory) -> BuiltMine:
    return BuiltMine(DRIFT, fitted_config, tmp_path_factory.mktemp("fitted") / "world")


@pytest.fixture(scope="module")
def files(fitted: BuiltMine) -> dict[str, bytes]:
    return read_folder(fitted.bundle)


def fittings(files) -> dict[str, TriangleMesh]:
    names = {name.removeprefix("meshes/").removesuffix(".msh"): name for name in files if name.startswith("meshes/")}
    return {stem: decode_msh(files[name]) for stem, name in names.items() if is_fitting(stem)}


def moved(data: bytes, by_m) -> bytes:
    mesh = decode_msh(data)
    return encode_msh(
        TriangleMesh(mesh.vertices + np.array(by_m, np.float32), mesh.faces, mesh.texcoords, mesh.normals)
    )


def test_a_fitted_world_is_what_the_builder_makes_of_its_own_parts(fitted: BuiltMine, fitted_config: Config):
    world = open_bundle(fitted.bundle)
    assert world.warnings == 0
    require_built(fitted.bundle, world.record, fitted_config.validation)


def test_every_kind_of_fitting_is_there_and_none_collides(fitted: BuiltMine, files):
    kinds = {name.partition("_")[0] for name in fittings(files)}
    assert kinds == {"cover", *FURNITURE}
    model = open_bundle(fitted.bundle).model
    of_body = model.geom_bodyid == model.body(FITTINGS_BODY).id
    assert of_body.sum() > len(kinds)
    assert not (model.geom_contype | model.geom_conaffinity)[of_body].any()


def test_the_visible_floor_covers_the_drift_just_above_the_flat_floor(fitted: BuiltMine, files):
    covers = [mesh for name, mesh in fittings(files).items() if is_cover(name)]
    heights = np.concatenate([mesh.vertices[:, 2] for mesh in covers])
    assert 0 < heights.min() < 0.01
    assert 0.03 < heights.max() <= COVER_M
    shapes = [shapely.Polygon(t[:, :2]) for mesh in covers for t in mesh.vertices[mesh.faces]]
    assert fitted.free_space.polygon.difference(shapely.union_all(shapes).buffer(1e-3)).area < 0.01


def test_ruts_lie_lower_than_the_floor_between_them(fitted: BuiltMine, fitted_config: Config):
    params = fitted_config.realism.floor
    zone = open_bundle(fitted.bundle).record.zones[:1]
    meshes = straight_floor(fitted, params.model_copy(update={"puddles": []}), zone)
    vertices = np.concatenate([mesh.vertices for mesh in meshes.values()])
    aside = np.abs(vertices[:, 1] - 2.5)
    rut = np.abs(aside - params.gauge_m / 2) < 0.08
    assert vertices[rut, 2].mean() < vertices[aside < 0.3, 2].mean() - 0.008
    assert vertices[(aside > 2.3) & (aside < 2.9), 2].mean() > vertices[aside < 0.3, 2].mean() + 0.02


@pytest.mark.parametrize("stations", [1, 2])
def test_a_leg_of_no_length_between_two_junctions_has_a_floor_too(
    fitted: BuiltMine, fitted_config: Config, stations: int
):
    drift = Leg("a", "x", "y", 20.0, [0.0, 20.0], [(0.0, 2.5), (20.0, 2.5)], [2.5, 2.5])
    short = Leg("b", "y", "z", 0.0, stations * [0.0], stations * [(20.0, 2.5)], stations * [2.5])
    network = dataclasses.replace(fitted.network, legs=[drift, short])
    zone = open_bundle(fitted.bundle).record.zones[:1]
    params = fitted_config.realism.floor
    assert cover_floor(params, level_grid(params, shapely.box(0, 0, 20, 5), network), zone)


def straight_floor(fitted: BuiltMine, params: FloorParams, zones: list[ZoneStrip]) -> dict[str, Mesh]:
    """Return the visible floor of a straight drift from (0, 0) to (60, 5) m."""
    leg = Leg("a", "x", "y", 60.0, [0.0, 60.0], [(0.0, 2.5), (60.0, 2.5)], [2.5, 2.5])
    network = dataclasses.replace(fitted.network, legs=[leg])
    return cover_floor(params, level_grid(params, shapely.box(0, 0, 60, 5), network), zones)


def zone_of(name: str, west_m: float, east_m: float) -> ZoneStrip:
    return ZoneStrip(name, 1.0, 1.0, 0.0, (0.5, 0.5, 0.5, 1.0), west_m, east_m, -1.0, 6.0)


def heights_on_grid(meshes: dict[str, Mesh], west_m: float, east_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return places (n, 2) m a decimetre apart in the drift and the height (n,) m of the floor there."""
    x, y = np.meshgrid(np.arange(west_m, east_m, 0.1), np.arange(0.3, 4.7, 0.1))
    places = np.column_stack([x.ravel(), y.ravel()])
    rays = RayCaster(np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes.values()]))
    down = rays.cast(np.column_stack([places, np.ones(len(places))]), np.tile([0.0, 0, -1.0], (len(places), 1)))
    return places, 1.0 - down


def test_the_shoulders_of_ruts_darken_over_a_decimetre_and_more(fitted: BuiltMine, fitted_config: Config):
    params = fitted_config.realism.floor.model_copy(update={"puddles": []})
    places, height = heights_on_grid(straight_floor(fitted, params, [zone_of("dry", -1, 61)]), 2, 58)
    levels = np.array(SHADE_LEVELS) * params.water_m
    aside = np.abs(np.abs(places[:, 1] - 2.5) - params.gauge_m / 2)
    planes_above = (height[:, None] < levels).sum(axis=1)
    by_distance = [planes_above[(aside >= a) & (aside < a + 0.05)].mean() for a in np.arange(0, 0.4, 0.05)]
    assert by_distance[0] > 4.5
    assert by_distance[-1] < 1.5
    assert np.diff(by_distance).min() > -2.5  # of six planes, in 5 cm


def test_water_ends_within_its_zone_at_a_shore(fitted: BuiltMine, fitted_config: Config):
    params = fitted_config.realism.floor
    zones = [zone_of("dry", -1, 30), zone_of("water", 30, 61)]
    places, height = heights_on_grid(straight_floor(fitted, params, zones), 29.9, 58)
    wet = height < params.water_m
    assert wet[places[:, 0] > 32].mean() > 0.3
    assert not wet[np.abs(places[:, 0] - 30) < 0.06].any()


def test_floors_of_two_zones_meet_on_a_line_that_wanders_about_their_border(fitted: BuiltMine, fitted_config: Config):
    params = fitted_config.realism.floor.model_copy(update={"puddles": []})
    meshes = straight_floor(fitted, params, [zone_of("dry", -1, 30), zone_of("mud", 30, 61)])
    areas = []
    for prefix in ("cover_000", "cover_001"):
        corners = np.concatenate([m.vertices[m.faces] for name, m in meshes.items() if name.startswith(prefix)])
        areas.append(shapely.union_all(shapely.polygons(corners[:, :, :2])))
    common = areas[0].buffer(2e-4).intersection(areas[1].buffer(2e-4))
    assert areas[0].intersection(areas[1]).area < 1e-3
    assert 29.3 < common.bounds[0] < 30 < common.bounds[2] < 30.7
    assert shapely.box(0, 0, 60, 5).difference(shapely.union_all(areas).buffer(1e-3)).area < 0.01


def test_furniture_hangs_above_robots_and_in_front_of_the_rock(fitted: BuiltMine, files):
    robot = RobotParams()
    top_m = robot.sensor_height_m + robot.scanner_height_m / 2
    free = fitted.free_space.polygon
    for name, mesh in fittings(files).items():
        if not is_cover(name):
            assert mesh.vertices[:, 2].min() > top_m + 0.3
            if not name.startswith("bolts"):
                assert mesh.vertices[:, 2].min() >= LINES_ABOVE_M
            assert free.buffer(0.6).contains(shapely.MultiPoint(mesh.vertices[:, :2]))


def test_lidar_sees_furniture_and_ends_on_the_flat_floor(fitted: BuiltMine):
    meshes = surface_meshes(load_world(fitted.bundle))
    assert any("duct" in name for name in meshes)
    assert not any("cover" in name or "weldmesh" in name for name in meshes)
    bare = {name: mesh for name, mesh in meshes.items() if name.startswith("surface_")}
    duct = next(mesh for name, mesh in meshes.items() if "duct" in name)
    triangles = duct[0][duct[1]]
    level = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])[:, 2]
    below = np.array([[*triangles[np.abs(level).argmax()].mean(axis=0)[:2], 0.5]])
    up, down = np.array([[[0.0, 0, 1.0]]]), np.array([[[0.0, 0, -1.0]]])
    with_duct, without = (Lidar(m, 10.0).cast(below, up)[0, 0] for m in (meshes, bare))
    assert with_duct < without - 0.1
    assert Lidar(meshes, 10.0).cast(below, down)[0, 0] == pytest.approx(0.5)


def test_models_that_robots_are_stepped_in_hold_no_fitting(fitted: BuiltMine):
    model = LocalModels(load_world(fitted.bundle), TaskParams(), RobotParams()).model((5, 1))
    assert not [model.geom(g).name for g in range(model.ngeom) if model.geom(g).name.startswith(("fitting", "puddle"))]


def test_fittings_are_no_obstacles_of_the_certificate(fitted: BuiltMine):
    world = open_bundle(fitted.bundle)
    free = fitted.free_space.polygon
    found = obstacles(world.model, np.array(world.record.T_world_mine), world.record.height_m)
    assert len(found) == world.record.collision_parts
    assert max(shapely.MultiPoint(part[:, :2]).convex_hull.intersection(free).area for part in found) < 1e-3


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<geom name="fitting_duct', '<geom contype="1" name="fitting_duct', "geom_contype"),
        ('<geom name="fitting_duct', '<geom name="fitting_panel', "is missing"),
        ('type="plane"', 'type="box"', "geom puddle_water: geom_"),
        ('name="puddle_water"', 'name="puddle_lava"', "geoms: 'puddle_lava' is one too many"),
        ('rgba="0 0 0 0.035"', 'rgba="0 0 0 0.5"', "mat_rgba"),
        ('material="fitting_duct"', 'material="fitting_pipe"', "geom_matid"),
    ],
)
def test_a_fitting_that_the_builder_does_not_write_is_refused(files, tmp_path, old, new, message):
    text = files["mine.xml"].decode()
    assert old in text
    assert message in model_refusal(tmp_path / "w", {**files, "mine.xml": text.replace(old, new, 1).encode()})


def at_level(text: str, water_m: float) -> str:
    """Return a model whose water, and all shade with it, is at another height."""

    def lifted(found: re.Match) -> str:
        return f"{found[1]}{float(found[2]) * water_m / 0.018:.16g}{found[3]}"

    plane = r'(<geom [^>]*pos="\S+ \S+ )(\S+)("[^>]*material="(?:shade|water)"/>)'
    text, changes = re.subn(plane, lifted, text)
    assert changes == 1 + len(SHADE_LEVELS)
    return text


def test_water_high_above_the_floor_is_refused(files, tmp_path):
    text = files["mine.xml"].decode()
    assert ' 0.018"' in text
    one = text.replace(' 0.018"', ' 0.3"')
    assert "geom puddle_water: geom_pos" in model_refusal(tmp_path / "w", {**files, "mine.xml": one.encode()})
    high = at_level(text, 0.2)
    assert "water at 0.2 m" in model_refusal(tmp_path / "w", {**files, "mine.xml": high.encode()})


def test_a_visible_floor_of_a_plain_world_is_refused(files):
    record = {k: v for k, v in json.loads(files["world.json"]).items() if k != "look"}
    assert refusal({**files, "world.json": json.dumps(record).encode()})


def test_a_floor_that_is_lifted_or_furniture_that_is_lowered_is_refused(files):
    cover = next(name for name in files if name.startswith("meshes/cover"))
    assert "want 0 to 0.1 m" in refusal({**files, cover: moved(files[cover], [0, 0, 0.2])})
    bolts = next(name for name in files if name.startswith("meshes/bolts"))
    assert "want 1 m or more" in refusal({**files, bolts: moved(files[bolts], [0, 0, -1.0])})
    pipe = next(name for name in files if name.startswith("meshes/pipe"))
    assert "want 2 m or more" in refusal({**files, pipe: moved(files[pipe], [0, 0, -0.5])})
    weld = next(name for name in files if name.startswith("meshes/weldmesh"))
    assert "want 2 m or more" in refusal({**files, weld: moved(files[weld], [0, 0, -1.0])})


def rewritten(fitted: BuiltMine, files, tmp_path, name: str, data: bytes):
    """Write the world with one other file, sealed, and return its folder and record."""
    folder = tmp_path / "w"
    for file, content in sealed({**files, name: data}).items():
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_bytes(content)
    return folder, open_bundle(folder).record


def first(files, kind: str) -> str:
    return next(name for name in files if name.startswith(f"meshes/{kind}"))


def edited(files, kind: str, change) -> tuple[str, bytes]:
    """Return the first mesh of a kind with changed vertices, faces or texture coordinates."""
    name = first(files, kind)
    mesh = decode_msh(files[name])
    parts = {"vertices": mesh.vertices, "faces": mesh.faces, "texcoords": mesh.texcoords, "normals": mesh.normals}
    return name, encode_msh(TriangleMesh(**(parts | change(mesh))))


def _panel(corners):
    """Replace the first bolt's plate by a panel."""

    def change(mesh):
        vertices = mesh.vertices.copy()
        vertices[mesh.faces[0]] = corners
        return {"vertices": vertices}

    return change


@pytest.mark.parametrize(
    ("kind", "change", "message"),
    [
        ("bolts", _panel([[8, 0.2, 1.2], [8, 4.8, 1.2], [8, 4.8, 1.9]]), "from where it should be"),
        ("pipe", lambda mesh: {"vertices": mesh.vertices - np.array([0, 0.3, 0])}, "from where it should be"),
        ("cover", lambda mesh: {"faces": mesh.faces[:, ::-1]}, "from where it should be"),
        ("cover", lambda mesh: {"faces": mesh.faces[:6]}, "vertices, faces, texture coordinates and normals, want"),
        ("bolts", lambda mesh: {"faces": np.repeat(mesh.faces[:1], len(mesh.faces), axis=0)}, "faces twice"),
        ("cover", lambda mesh: {"texcoords": 1.5 * mesh.texcoords}, "a texture that is"),
        ("cover", lambda mesh: {"normals": np.tile([0.0, 0, -1], (len(mesh.vertices), 1))}, "normals, want"),
    ],
    ids=["a panel", "a pipe in the drift", "a floor that faces down", "no floor", "one face", "texture", "normals"],
)
def test_fittings_that_the_builder_does_not_make_are_refused(
    fitted, fitted_config, files, tmp_path, kind, change, message
):
    name, data = edited(files, kind, change)
    folder, record = rewritten(fitted, files, tmp_path, name, data)
    with pytest.raises(ArtifactError, match=message):
        require_built(folder, record, fitted_config.validation)


def test_two_bolts_at_one_place_are_no_difference():
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], np.float32)
    faces = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)], np.int32)
    nothing = np.zeros((0, 2), np.float32), np.zeros((0, 3), np.float32)
    both = TriangleMesh(np.vstack([corners, corners]), np.vstack([faces, faces + 4]), *nothing)
    assert _mesh_difference(both, both) is None
    lost = TriangleMesh(both.vertices, np.vstack([faces[:3], faces[:1], faces[:3] + 4, faces[:1] + 4]), *nothing)
    assert _mesh_difference(lost, both) == "1 faces twice, and as many missing"


def test_floors_of_two_zones_that_are_exchanged_are_refused(fitted, fitted_config, files, tmp_path):
    one, two = (next(name for name in files if name.startswith(f"meshes/cover_00{zone}")) for zone in (0, 2))
    folder, record = rewritten(fitted, files | {one: files[two]}, tmp_path, two, files[one])
    with pytest.raises(ArtifactError, match=r"by realism\.floor"):
        require_built(folder, record, fitted_config.validation)


def test_water_stands_where_and_as_high_as_the_parameters_say(fitted, fitted_config, files, tmp_path):
    text = files["mine.xml"].decode()
    folder, record = rewritten(fitted, files, tmp_path, "mine.xml", at_level(text, 0.04).encode())
    with pytest.raises(ArtifactError, match=r"level 0.04 m, want 0.018 m"):
        require_built(folder, record, fitted_config.validation)
    dry = fitted_config.validation.model_copy(
        update={"fittings": fitted_config.validation.fittings.model_copy(update={"floor": None})}
    )
    with pytest.raises(ArtifactError, match=r"realism\.floor = null says none"):
        require_built(fitted.bundle, open_bundle(fitted.bundle).record, dry)


def test_furniture_must_be_all_of_one_kind(fitted, fitted_config):
    light = fitted_config.validation.fittings.furniture["light"]
    only = fitted_config.validation.fittings.model_copy(update={"furniture": {"light": light}})
    params = fitted_config.validation.model_copy(update={"fittings": only})
    with pytest.raises(ArtifactError, match=r"by realism\.furniture\.light"):
        require_built(fitted.bundle, open_bundle(fitted.bundle).record, params)


def test_rock_that_crosses_the_drift_between_two_heights_is_refused(fitted, fitted_config, files, tmp_path):
    def blade(mesh):
        """Pull the middle of a face on the rib across the drift, between the heights that are sliced."""
        corners = mesh.vertices[mesh.faces]
        middle = corners.mean(axis=1)
        at = int((np.abs(middle[:, 2] - 0.75) + 10 * ((middle[:, 1] > 1.0) | (middle[:, 0] < 3.0))).argmin())
        inner = middle[at] + 0.2 * (corners[at] - middle[at])
        tip = np.array([middle[at, 0], 4.75, middle[at, 2]])
        count, (a, b, c) = len(mesh.vertices), mesh.faces[at]
        p, q, r, t = range(count, count + 4)
        faces = [[a, b, p], [b, q, p], [b, c, q], [c, r, q], [c, a, r], [a, p, r], [p, q, t], [q, r, t], [r, p, t]]
        laid = mesh.texcoords[[a, b, c]]
        laid = np.vstack([laid.mean(axis=0) + 0.2 * (laid - laid.mean(axis=0)), laid.mean(axis=0)[None]])
        return {
            "vertices": np.vstack([mesh.vertices, inner, tip]),
            "faces": np.vstack([np.delete(mesh.faces, at, axis=0), faces]).astype(np.int32),
            "texcoords": np.vstack([mesh.texcoords, laid]),
            "normals": np.zeros((0, 3)),
        }

    name, data = edited(files, "walls", blade)
    folder, record = rewritten(fitted, files, tmp_path, name, data)
    with pytest.raises(ArtifactError, match=r"rock at .* m is .* m off, want at most 0.6 m"):
        require_built(folder, record, fitted_config.validation)


def test_samples_of_a_face_leave_no_gap_and_stay_on_it():
    triangle = np.array([[[0.0, 0, 0], [3.0, 0, 0], [0, 2.0, 1.0]]])
    points = face_samples(triangle, 0.25)
    dense = face_samples(triangle, 0.02)
    apart = np.linalg.norm(dense[:, None] - points[None], axis=2).min(axis=1)
    assert apart.max() < 0.25
    assert np.abs(points[:, 2] - points[:, 1] / 2).max() < 1e-12


def test_weld_mesh_under_a_level_roof_has_wires_at_the_aperture_and_hangs_just_below_it():
    corners = np.array([[-50, -50, 3.2], [50, -50, 3.2], [50, 50, 3.2], [-50, 50, 3.2]], float)
    roof = RayCaster(corners[np.array([[0, 2, 1], [0, 3, 2]])])
    stations = [(float(x), 0.0) for x in range(21)]
    leg = Leg("a", "J", "end", 20.0, list(map(float, range(21))), stations, [2.5] * 21)
    network = DriftNetwork({"J": (0, 0), "end": (20, 0)}, [leg], ["J"], ["end"], 0, 1, 20.0, ["a"], stations, 20.0, 1.0)
    params = compose([]).realism.furniture["meshed"].weld_mesh
    across, along = (np.array(part[1]) for part in hang_weld_mesh(params, ways_of(network, 3.2), roof))
    assert across[:, 0].max() == pytest.approx(params.from_junction_m, abs=1.2)  # the other end is no junction
    lines = np.unique(across[:, 0].round(2))
    apart = np.diff(lines)
    assert apart[apart > 2 * params.wire_m].mean() == pytest.approx(params.aperture_m, rel=0.15)
    for wires in (across, along):
        assert (wires[:, 2] < 3.2).all()
        assert wires[:, 2].min() > LINES_ABOVE_M
    middle = np.abs(along[:, 1]) < 0.1
    assert 3.2 - along[middle, 2].mean() == pytest.approx(0.03, abs=0.02)


def test_weld_mesh_hangs_in_front_of_the_bumps_of_the_rock(fitted: BuiltMine, fitted_config: Config):
    meshes = [decode_msh(data) for name, data in fitted.surface.items() if name.endswith(".msh")]
    rock = RayCaster(np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes]).astype(np.float64))
    params = fitted_config.realism.furniture["meshed"].weld_mesh
    points = np.concatenate([part[1] for part in hang_weld_mesh(params, ways_of(fitted.network, 3.5), rock)])
    eye = np.column_stack([points[:, :2], np.full(len(points), 1.7)])
    above = rock.cast(eye, np.tile([0.0, 0, 1.0], (len(points), 1))) + 1.7
    assert (points[:, 2] < above + 0.02).mean() > 0.97
    assert np.median(above - points[:, 2]) < 0.35


def test_the_default_world_has_no_weld_mesh():
    realism = compose([]).realism
    assert realism.furniture[realism.furnish].weld_mesh is None


def test_workings_that_are_too_low_have_no_furniture(fitted: BuiltMine, fitted_config: Config, capsys):
    ways, main_m = ways_of(fitted.network, 2.0), on_level(fitted.network.main_drift_m)
    assert hang_furniture(fitted_config.realism.furniture["full"], ways, main_m, {}) == {}
    assert "no furniture, workings of 2 m are lower than 2.9 m" in capsys.readouterr().err


def test_a_piece_of_a_tile_that_is_no_mesh_is_dropped():
    triangle = np.array([[19.0, 5, 3], [21.0, 5, 3], [19.0, 5.1, 3]])  # its middle is in the first tile
    far = np.array([[0.0, 0, 3], [0, 0.1, 3], [0.1, 0, 3], [0.1, 0.1, 3.1]]) + np.array([41, 0, 0])
    faces = np.array([[0, 1, 2]])
    parts = [("pipe", triangle, faces), ("pipe", far, np.array([[0, 1, 2], [1, 3, 2]]))]
    assert list(_merged(parts, over_level)) == ["pipe_01_00"]


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["look=plain", "fittings=drift"], "need a look other than"),
        (["fittings=none", "realism.furnish=light"], "needs realism.furniture.light"),
        (["realism.floor.puddles=[lava]"], "no zone 'lava'"),
    ],
)
def test_fittings_without_what_they_need_are_refused(overrides, message):
    with pytest.raises(ParamsError, match=message):
        compose(overrides)


def test_the_same_parameters_give_the_same_fittings(fitted: BuiltMine, fitted_config: Config):
    params, record = fitted_config.realism, open_bundle(fitted.bundle).record
    plan = fitted.free_space.polygon, fitted.network
    one, two = (cover_floor(params.floor, level_grid(params.floor, *plan), record.zones) for _ in range(2))
    assert all((one[name].vertices == two[name].vertices).all() for name in one)
    rough = {name: data for name, data in fitted.surface.items() if name.endswith(".msh")}
    ways, main_m = ways_of(fitted.network, 3.5), on_level(fitted.network.main_drift_m)
    hung = [hang_furniture(params.furniture["full"], ways, main_m, rough) for _ in range(2)]
    assert hung[0] == hung[1]


def test_a_step_of_a_fitted_world_finds_no_contact_with_fittings(fitted: BuiltMine):
    world = load_world(fitted.bundle)
    spec = world.spec()
    ball = spec.worldbody.add_body(name="ball", pos=(world.T_world_mine @ [5.0, 2.5, 3.0, 1.0])[:3])
    ball.add_freejoint()
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    touched = set()
    for _ in range(1500):
        mujoco.mj_step(model, data)
        touched |= {model.geom(int(g)).name for g in data.contact.geom.ravel()}
    assert touched - {""} == {"floor_dry"}


def test_water_is_drawn_wherever_its_zone_is(fitted: BuiltMine):
    model = load_model(fitted.bundle / MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    planes = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    before = model.geom_group.copy()
    with far_hidden(model, data, np.array([1000.0, 0.0, 0.0])):
        assert planes.sum() == 1 + len(SHADE_LEVELS)
        assert (model.geom_group[planes] == before[planes]).all()
        assert (model.geom_group[~planes] != before[~planes]).any()


def test_workings_that_are_far_apart_get_a_coarser_floor(fitted: BuiltMine, fitted_config: Config, capsys):
    far = shapely.box(0, 0, 3000, 4).union(shapely.box(2996, 0, 3000, 900))
    zone = open_bundle(fitted.bundle).record.zones[:1]
    params = fitted_config.realism.floor.model_copy(update={"puddles": []})
    meshes = cover_floor(params, level_grid(params, far, fitted.network), zone)
    assert "0.41 m apart instead of 0.1 m" in capsys.readouterr().err
    assert sum(len(mesh.faces) for mesh in meshes.values()) > 100
