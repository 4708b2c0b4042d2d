"""The visible rock of a volume: closed, within its bounds, and judged by the certificate, which a fault breaks."""

import dataclasses
import json
import re

import mujoco
import numpy as np
import pytest
import shapely
import trimesh
from scipy.spatial import cKDTree

from minexplore.bundle import ROCK_TEXTURE, BundleError, ground_material, is_floor, world_sha256
from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from minexplore.looks import cover_rgba
from minexplore.sealed.files import read_folder
from minexplore.sealed.world import hash_files
from minexplore.sensing.facet_meshes import facet_meshes, volume_meshes
from minexplore.sensing.lidar import Lidar
from minexplore.world import load_world
from pipeline.errors import ArtifactError
from pipeline.schema import check_world
from pipeline.store.codecs import decode
from pipeline.surface.mesh.lattice import WALL
from pipeline.surface.mesh.mesh_checks import find_crossings
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.proof.again.remodelled import require_same_model
from pipeline.volume.world.proof.certificate import open_volume
from pipeline.volume.world.surface.build import displaced_rock
from pipeline.volume.world.surface.fine import FLOOR, refine
from pipeline.volume.world.surface.proof import measure_rock, read_rock
from pipeline.volume.world.surface.room import room_about
from pipeline.volume.world.surface.views import draw_volume_views
from pipeline.volume.world.topology import LegNetwork
from stages.surface import model_surface
from tests.composed import compose
from tests.heights import HEADER
from tests.mines import require_allowed
from tests.volume_worlds import WITH_ROCK as CONFIG
from tests.volume_worlds import VolumeWorld, with_rock
from tests.volumes import BOX, TEE

# Two drifts 4 m wide with 0.3 m of rock between them; a crosscut joins their ends.
THIN = HEADER + "A,1,0,0,2,2,0,3,0\nA,2,20,0,2,2,0,3,0\nA,3,20,4.3,2,2,0,3,0\nA,4,0,4.3,2,2,0,3,0\n"


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    """A drift of 20 m, 4 m wide, with visible rock."""
    return with_rock(BOX, tmp_path_factory.mktemp("box"))


@pytest.fixture(scope="module")
def files(box):
    return read_folder(box / "rocky")


def volume_of(folder):
    return decode(folder / "compiled" / "volume.npz", VolumeFacets)


def measured(folder, rock):
    legs = decode(folder / "rocky" / "topology.json", LegNetwork)
    found = measure_rock(closed_volume(volume_of(folder)), legs, rock, np.random.default_rng(3))
    limits = {name.removeprefix("rock."): limit for name, limit in CONFIG.validation.volume.limits.items()}
    return found, {name for name, value in found.items() if name in limits and not limits[name].holds(value)}


def rock_of(folder):
    return read_rock(folder / "rocky", [str(p.relative_to(folder / "rocky")) for p in folder.glob("rocky/meshes/*")])


def test_fine_rock_is_closed_keeps_its_labels_and_points_into_the_workings(box):
    volume = volume_of(box)
    fine = refine(volume, 0.14, 0.14)
    edges = fine.vertices[fine.faces] - fine.vertices[np.roll(fine.faces, 1, axis=1)]
    assert np.linalg.norm(edges[fine.piece != FLOOR], axis=2).max() < 0.14 * 2.2
    assert (fine.piece == FLOOR).sum() < 0.2 * (fine.piece == WALL).sum()  # it is cut where walls stand on it
    assert trimesh.Trimesh(fine.vertices, fine.faces, process=False).is_watertight
    on_floor = fine.vertices[fine.faces[fine.piece == FLOOR]]
    assert np.abs(on_floor[..., 2]).max() < 1e-9
    south = np.abs(fine.vertices[:, 1] - fine.vertices[:, 1].min()) < 1e-6
    south &= (np.abs(fine.vertices[:, 2] - 0.9) < 0.3) & (np.abs(fine.vertices[:, 0] - 10) < 5)
    assert south.any()
    assert np.abs(fine.direction[south] - [0, 1, 0]).max() < 1e-6


def test_room_is_half_the_width_across_a_drift_and_half_the_rock_behind_a_thin_wall(tmp_path):
    VolumeWorld(THIN, tmp_path)
    volume = volume_of(tmp_path)
    fine = refine(volume, 0.12, 0.14)  # points between those that are asked have their mean
    room = room_about(fine, volume)
    x, y, z = fine.vertices.T
    thin = (np.abs(y - 2) < 1e-6) & (np.abs(x - 8) < 4) & (np.abs(z - 0.9) < 0.5)
    assert thin.any()
    assert room.half_m[thin] == pytest.approx(2.0, abs=0.05)
    assert room.rock_m[thin] == pytest.approx(0.15, abs=0.01)
    assert room.free_m[thin].min() > 0.4  # the height over the floor
    assert room.narrowest_m == 0  # without balls


@pytest.mark.parametrize("source", [BOX, THIN])
def test_displaced_rock_is_closed_and_crosses_itself_nowhere_not_even_through_thin_rock(source, tmp_path):
    VolumeWorld(source, tmp_path)
    rock = displaced_rock(CONFIG.surface, volume_of(tmp_path))
    mesh = rock.mesh
    assert trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).is_watertight
    assert len(find_crossings(mesh.vertices, mesh.faces)) == 0
    assert (rock.given_m[rock.fine.is_fixed] == 0).all()
    assert np.abs(rock.given_m).max() <= CONFIG.surface.rough.bounds.wall_m
    walls = np.unique(rock.fine.faces[rock.fine.piece == WALL])
    assert np.std(rock.given_m[walls]) > 0.03  # it is rough


def test_where_a_wall_was_scanned_its_rock_is_the_wall_and_elsewhere_it_grows_rough_without_a_seam(tmp_path):
    VolumeWorld(BOX, tmp_path)
    volume = volume_of(tmp_path)
    walls = displaced_rock(CONFIG.surface, volume).fine.vertices
    seen = walls[walls[:, 0] < 10]
    rock = displaced_rock(CONFIG.surface, volume, seen)
    away = cKDTree(seen).query(rock.fine.vertices)[0]
    assert (rock.given_m[away <= 0.3] == 0).all()
    assert np.std(rock.given_m[away > 1.5]) > 0.03
    assert np.abs(rock.given_m[(away > 0.3) & (away < 0.4)]).max() < 0.1


def test_the_rock_that_is_built_holds_every_limit_of_the_certificate(box):
    found, broken = measured(box, rock_of(box))
    assert broken == set()
    assert found["gap_median_m"] > 0.02
    names = {name.removeprefix("rock.") for name in CONFIG.validation.volume.limits if name.startswith("rock.")}
    assert names <= set(found)


def test_a_world_without_its_rock_is_not_shown(box):
    assert measured(box, {})[1] == {"shown"}


def test_a_chunk_that_is_left_out_leaves_a_hole(box):
    rock = rock_of(box)
    del rock[sorted(rock)[-1]]
    assert measured(box, rock)[1] >= {"open_m", "bare_m", "leaks"}


def test_a_chunk_that_is_moved_into_the_workings_intrudes_and_crosses_the_others(box):
    rock = rock_of(box)
    name = next(name for name in rock if name.startswith("walls"))
    rock[name] = dataclasses.replace(rock[name], vertices=rock[name].vertices + [0, 0.7, 0.1])  # noqa: RUF005
    assert measured(box, rock)[1] >= {"into_free_m", "open_m", "narrowest_kept"}


def test_a_chunk_that_is_turned_over_is_seen_from_behind(box):
    rock = {name: dataclasses.replace(mesh, faces=mesh.faces[:, ::-1]) for name, mesh in rock_of(box).items()}
    assert "leaks" in measured(box, rock)[1]


def test_rock_that_stands_far_behind_the_collision_walls_is_beyond_the_largest_gap(box):
    rock = rock_of(box)
    middle = np.array([10.0, 0.0, 1.5])
    for name, mesh in rock.items():
        wider = middle + (mesh.vertices - middle) * [1.0, 1.4, 1.4]
        rock[name] = dataclasses.replace(mesh, vertices=np.where(mesh.vertices[:, 2:] < 0.5, mesh.vertices, wider))
    assert measured(box, rock)[1] >= {"gap_max_m", "gap_p95_m", "gap_median_m"}


def test_the_schema_allows_the_bundle_and_beams_end_on_its_rock(box):
    check_world(box / "rocky")
    world = load_world(box / "rocky")
    assert world.record["overlay"] == "rough"
    rays = np.array([[[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]])
    eye = np.array([[10.0, 0.0, 0.9]])
    facets = world.volume.facets
    seen, bare = (Lidar(m, 20.0, floor_m=-np.inf) for m in (volume_meshes(world, facets), facet_meshes(facets)))
    seen, bare = seen.cast(eye, rays)[0], bare.cast(eye, rays)[0]
    assert bare == pytest.approx([2.0, 2.0, 0.9], abs=1e-4)
    assert seen[2] == pytest.approx(0.9, abs=1e-4)  # the floor is where wheels stand
    assert (np.abs(seen[:2] - 2.0) > 1e-3).all()
    assert (np.abs(seen[:2] - 2.0) < 0.4).all()


def resealed(files, **changes):
    """Return files with other contents, None for one that is left out, and a record that has their hashes."""
    files = {name: data for name, data in {**files, **changes}.items() if data is not None}
    record = json.loads(files["world.json"])
    hashes = hash_files(files)
    record["files"] = {name: hashes[name] for name in files if name not in ("world.json", "made_by.json")}
    record["world_sha256"] = world_sha256(record)
    files["world.json"] = json.dumps(record).encode()
    return files


def test_a_bundle_that_lacks_files_of_its_rock_or_states_none_is_refused(files, tmp_path):
    def refusal(**changes):
        changed = resealed(files, **changes)
        with pytest.raises(BundleError) as error:
            require_allowed(tmp_path, changed)
        return str(error.value)

    chunk = next(name for name in files if name.startswith("meshes/walls"))
    assert f"{chunk}'" in refusal(**{chunk: None})
    assert "missing" in refusal(**{ROCK_TEXTURE: None})
    record = files["world.json"].decode().replace('"overlay":"rough"', '"overlay":"none"')
    record = record.replace('"overlay": "rough"', '"overlay": "none"')
    assert "overlay = 'none'" in refusal(**{"world.json": record.encode()})


def test_a_bundle_whose_model_shows_other_rock_than_its_files_is_refused(box, files):
    world, model, water_m = open_volume(box / "rocky"), files["mine.xml"].decode(), CONFIG.realism.floor.water_m
    line = re.search(r'<geom name="surface_walls[^>]*>', model)
    assert line is not None
    no_texture, other_texture = (re.sub(r' texcoord="[^ ]* ', new, model, count=1) for new in (' x="', ' texcoord="7 '))
    for changed, message in (
        (model.replace(line[0], ""), "geom[surface_"),
        (model.replace('contype="0"', 'contype="1"'), "geom@contype = 1, want 0"),
        (model.replace('fogend="9"', 'fogend="7"'), "map@fogend = 7, want 9"),
        (no_texture, "mesh[floor_"),
        (other_texture, "@texcoord = 7"),
        (re.sub(r'(<material name="ground_[^>]*) texture="rock"', r"\1", model), "material[ground_"),
    ):
        with pytest.raises(ArtifactError, match=re.escape(message)):
            require_same_model(box / "rocky", dataclasses.replace(world, model=changed.encode()), water_m)


def test_floors_have_the_texture_of_their_places_and_the_colour_of_their_zone(box, files):
    model, parts = mujoco.MjSpec.from_string(files["mine.xml"].decode()), check_world(box / "rocky").volume.parts
    floor = next(mesh for mesh in model.meshes if is_floor(mesh.name))
    number = int(np.flatnonzero(parts.label == FacetLabel.FLOOR)[0])
    assert np.reshape(floor.usertexcoord, (-1, 2)) == pytest.approx(0.4 * parts[number][:, :2], abs=1e-6)
    zone = json.loads(files["world.json"])["zones"][0]
    ground = model.material(ground_material(zone["name"]))
    assert list(ground.rgba) == pytest.approx(cover_rgba(zone["rgba"]))
    assert ground.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] == "rock"


def test_a_robot_sees_rock_where_it_starts_and_at_the_junction(tmp_path):
    rocky = with_rock(TEE, tmp_path) / "rocky"
    opened = open_volume(rocky)
    floors = opened.mine.vertices[opened.mine.faces[opened.mine.label == FacetLabel.FLOOR]]
    plan = shapely.union_all(shapely.polygons(floors[:, :, :2]))
    views = draw_volume_views(rocky, opened.record, opened.legs, plan)
    assert views.shape == (600, 1800, 3)
    assert all(half.std() > 5 for half in np.hsplit(views, 2))
    alone = dataclasses.replace(opened.legs, junctions=[])
    assert draw_volume_views(rocky, opened.record, alone, plan).shape == (600, 900, 3)


def test_a_light_preset_gives_a_volume_no_visible_rock(box):
    light = compose(["+mine=heights", "preset=light"])
    assert model_surface(light.surface, None) == {"rock": {}, "evidence": {}}
    assert json.loads((box / "world" / "world.json").read_text())["overlay"] == "none"  # of VolumeWorld
    assert not list((box / "world").glob("*/*"))
    assert not [name for name in light.validation.volume.limits if name.startswith("rock.")]
