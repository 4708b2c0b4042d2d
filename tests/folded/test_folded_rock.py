"""Visible rock over floors with heights: it is that of the plan, folded, and two sheets meet without a gap."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from minexplore.bundle import BundleError, decode_msh, encode_msh, is_cover, is_fitting, is_shade, mesh_file
from minexplore.floors.floor import Floor
from minexplore.floors.folding import Folding
from minexplore.schema import check_files, check_world, hash_files, read_folder
from minexplore.sensing.lidar import shared_lidar
from minexplore.world import load_world
from pipeline.errors import ArtifactError
from pipeline.geometry.floor.mesh import build_floor
from pipeline.geometry.floor.subdivide import split_edges
from pipeline.geometry.openings.fit import filled_floor, without_openings
from pipeline.mjcf.bundle import read_record
from pipeline.mjcf.openings import show_openings
from pipeline.proof.rebuilt.fittings import require_fittings
from pipeline.proof.rebuilt.remake import read_free_space
from pipeline.proof.rebuilt.visible import require_visible, rough_meshes
from pipeline.proof.validator import Validator
from pipeline.store.codecs import decode
from pipeline.surface.build import build_rough_surface, lay_rough_lattice
from pipeline.surface.folded.fold import check_folded, fold_surface
from pipeline.surface.folded.open_roof import open_roof
from pipeline.surface.folded.smooth_sheets import fold_smooth
from pipeline.surface.mesh.rough import closed_mesh
from pipeline.surface.mesh.smooth import smooth_surface
from pipeline.surface.reference import measure_sources
from pipeline.surface.relief_source import choose_relief
from pipeline.types import Occupancy, Openings
from tests.composed import compose
from tests.heights import RAMP, UNDER, certificate_params
from tests.mines import STRAIGHT, sealed

COARSE = [
    "surface.rough.spacing_m=0.25",
    "surface.rough.roof_spacing_m=0.3",
    "surface.texture.size_px=32",
    "realism.preview_width_px=64",
    "realism.tilt_deg=0",
    "contours.tolerance_m=0.16",
]


@pytest.fixture(scope="module")
def config():
    return compose(COARSE)


@pytest.fixture(scope="module")
def under(mine_of_legs):
    """Build a drift over a drift, with a shaft between them at (30, 0)."""
    collar = ("s", 30, 0, 10)
    legs = {**UNDER, "A": [*UNDER["A"][:2], collar, *UNDER["A"][2:]], "S": [collar, ("b1", 30, 0, 1)]}
    return mine_of_legs(legs, *COARSE, report=False)


@pytest.fixture(scope="module")
def ramp(mine_of_legs):
    return mine_of_legs(RAMP, *COARSE)


def rough_surface(config, free, floor, network=None):
    lattice = lay_rough_lattice(config.surface, free, network, 3.5, floor)
    return build_rough_surface(
        config.surface, lattice, choose_relief(config.surface, measure_sources(config.surface), lattice)
    )


def copied(mine, folder):
    shutil.copytree(mine.bundle, folder)
    return folder


def drifts_of(mine):
    return without_openings(mine.free_space.polygon, Openings(mine.openings))


def visible(folder):
    record = read_record(folder, checked=False)
    drifts = without_openings(read_free_space(folder).polygon, Openings(record.openings))
    require_visible(folder, record, drifts, decode(folder / "occupancy.npz", Occupancy))


def test_the_rock_of_a_straight_decline_of_10_percent_is_that_of_a_level_drift_folded(config):
    decline = build_floor(STRAIGHT, [np.array([[0, 2.5, 0], [100, 2.5, 10.0]])], 30.0)
    level, folded = rough_surface(config, STRAIGHT, Floor()), rough_surface(config, STRAIGHT, decline)
    np.testing.assert_array_equal(folded.mesh.vertices, level.mesh.vertices)
    np.testing.assert_array_equal(folded.mesh.faces, level.mesh.faces)
    built, plan = fold_surface(folded).vertices, level.mesh.vertices
    np.testing.assert_allclose(built[:, :2], plan[:, :2], atol=1e-4)
    ends = (plan[:, 0] > 6) & (plan[:, 0] < 94)  # near its ends the floor itself is not linear
    assert np.ptp(built[:, 2] - plan[:, 2]) > 9.5
    np.testing.assert_allclose((built[:, 2] - plan[:, 2])[ends], 0.1 * plan[ends, 0], atol=2e-4)


def test_two_sheets_meet_on_their_seam_without_a_gap(config, under):
    floor = filled_floor(under.floor, Openings(under.openings))
    rough = rough_surface(config, drifts_of(under), floor, under.network)
    folded = fold_surface(rough)
    report = check_folded(rough, folded, closed_mesh(rough)[1])
    assert report.watertight
    assert not report.self_intersecting
    meeting = rough.lattice.seam_join
    places = np.column_stack([rough.vertices[:, :2] - rough.lattice.walls.sheets.offset_m[rough.lattice.column]])
    for place in np.unique(meeting.place):
        one, two = meeting.points[meeting.place == place]
        np.testing.assert_allclose(places[one], places[two], atol=1e-9)
        assert rough.vertices[one, 2] == rough.vertices[two, 2]
    # The rock stands out on the seam, too: it is not smoothed away there.
    assert np.abs(rough.vertices - rough.lattice.vertices)[meeting.points].max() > 0.1


@pytest.mark.parametrize("name", ["ramp", pytest.param("under", marks=pytest.mark.slow)])
def test_a_world_with_heights_and_rock_holds_its_certificate(name, config, request):
    mine = request.getfixturevalue(name)
    validator = Validator(certificate_params(config, 100), mine.bundle, mine.cleaned, mine.raw, mine.survey)
    assert {n: c.value for n, c in validator.certificate.clauses.items() if not c.holds} == {}


def test_rock_that_is_not_folded_is_refused(ramp, tmp_path):
    folder = copied(ramp, tmp_path / "world")
    visible(folder)
    folding, record = Folding(ramp.floor), read_record(folder)
    for name in rough_meshes(name[7:-4] for name in record.files if name.startswith("meshes/")):
        mesh = decode_msh((folder / mesh_file(name)).read_bytes())
        plan = folding.unfold(mesh.vertices.astype(np.float64), record.height_m)
        (folder / mesh_file(name)).write_bytes(encode_msh(replace(mesh, vertices=plan)))
    with pytest.raises(ArtifactError, match=r"has the texture of a place|m from the smooth surface"):
        visible(folder)


def test_a_gap_of_a_centimetre_at_a_seam_is_refused_with_its_place(under, tmp_path):
    folder = copied(under, tmp_path / "world")
    ((one, _),) = under.floor.seams()
    record, opened = read_record(folder), 0
    for name in rough_meshes(name[7:-4] for name in record.files if name.startswith("meshes/roof")):
        mesh = decode_msh((folder / mesh_file(name)).read_bytes())
        plan = Folding(under.floor).unfold(mesh.vertices.astype(np.float64), record.height_m)
        on_seam = np.abs(plan[:, :2] - one).max(axis=1) < 1.0
        moved = mesh.vertices + np.where(on_seam, 0.01, 0.0)[:, None].astype(np.float32) * [0, 0, 1]
        opened += int(on_seam.sum())
        (folder / mesh_file(name)).write_bytes(encode_msh(replace(mesh, vertices=moved)))
    assert opened
    with pytest.raises(ArtifactError, match=r"a hole at \["):
        visible(folder)


def test_folding_and_unfolding_rock_behind_the_walls_returns_it(under):
    folding, rng = Folding(under.floor), np.random.default_rng(4)
    for sheet in range(2):
        own = under.floor.wall_segments()
        own = own[under.floor.sheets_at(own.mean(axis=1)) == sheet]
        along = own[:, 1] - own[:, 0]
        away = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
        places = own.mean(axis=1) + rng.uniform(-0.3, 0.4, (len(own), 1)) * away
        points = np.column_stack([places, rng.uniform(0, 3.5, len(own))])
        np.testing.assert_allclose(folding.unfold(folding.fold(points), 3.5), points, atol=1e-9)


def test_fittings_follow_the_floor_and_no_level_plane_is_built(under):
    checked = check_world(under.bundle)
    names = [name[7:-4] for name in checked.files if name.startswith("meshes/")]
    assert any(is_cover(name) for name in names)
    assert any(is_fitting(name) and not is_cover(name) for name in names)
    assert not any(
        is_shade(geom.name) or geom.name.startswith("puddle_") for geom in load_world(under.bundle).spec().geoms
    )
    folding, spread = Folding(under.floor), []
    for name in filter(is_cover, names):
        mesh = decode_msh(checked.files[mesh_file(name)])
        plan = folding.unfold(mesh.vertices.astype(np.float64), 3.5)
        assert plan[:, 2].min() > 0
        assert plan[:, 2].max() < 0.1 + 1e-3
        spread.append(float(mesh.vertices[:, 2].mean()))
    assert np.ptp(spread) > 5


def up_the_shaft(mine, place, far_m):
    """Return the range, m, of a beam upwards from a place of the mine frame."""
    lidar = shared_lidar(mine.bundle, load_world(mine.bundle).record["world_sha256"], far_m, "auto")
    return float(lidar.cast(np.array([place], float), np.array([[[0.0, 0.0, 1.0]]]))[0, 0])


def test_a_shaft_is_open_through_the_rock_and_closed_round_its_sides(under):
    (opening,) = under.openings
    middle = [30.1, 0.2]
    assert up_the_shaft(under, [*middle, 1.0], 30.0) == pytest.approx(11.5, abs=0.6)  # to the roof over the collar
    assert up_the_shaft(under, [31.2, 0.2, 1.0], 30.0) == pytest.approx(2.5, abs=0.6)  # to the roof beside the shaft
    lidar = shared_lidar(under.bundle, load_world(under.bundle).record["world_sha256"], 30.0, "auto")
    angle = np.radians(np.arange(0, 360, 5))
    level = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))])
    side = lidar.cast(np.array([[*middle, 6.0]]), level[None])[0]
    ends = middle + side[:, None] * level[:, :2]
    np.testing.assert_allclose(np.abs(ends - [30, 0]).max(axis=1), 0.75, atol=1e-3)
    fence = lidar.cast(np.array([[27.0, 0.1, 9.5]]), level[None, :1])[0, 0]
    assert fence == pytest.approx(2.25, abs=1e-3)
    assert (opening.bottom_m, opening.top_m) == pytest.approx((0.0, 9.0))


@pytest.mark.parametrize(
    ("mesh", "change", "said"),
    [
        ("roof", lambda mesh: replace(mesh, faces=mesh.faces[1:]), r"a hole at \["),
        ("shaft", lambda mesh: replace(mesh, vertices=mesh.vertices * np.float32([1, 1, 1.001])), r"shaft_0000\.msh: "),
        ("fence", lambda mesh: replace(mesh, faces=mesh.faces[2:]), r"fence_0000\.msh: "),
    ],
)
def test_a_forged_hole_lining_or_fence_is_refused(mesh, change, said, config, under, tmp_path):
    folder = copied(under, tmp_path / "world")
    record = read_record(folder)
    name = min(name for name in record.files if name.startswith(f"meshes/{mesh}"))
    (folder / name).write_bytes(encode_msh(change(decode_msh((folder / name).read_bytes()))))

    def check():
        visible(folder)
        require_fittings(folder, record, drifts_of(under), config.validation.fittings)

    with pytest.raises(ArtifactError, match=said):
        check()


def test_a_lining_outside_its_opening_and_a_missing_fence_are_refused_by_the_schema(under):
    files = read_folder(under.bundle)
    lining = decode_msh(files["meshes/shaft_0000.msh"])
    moved = encode_msh(replace(lining, vertices=lining.vertices + np.float32([0.05, 0, 0])))
    low = encode_msh(replace(lining, vertices=lining.vertices - np.float32([0, 0, 2.6])))
    without = {name: data for name, data in files.items() if name != "meshes/fence_0000.msh"}
    model = files["mine.xml"].decode().splitlines()
    without["mine.xml"] = "\n".join(line for line in model if "fence_" not in line).encode()
    for forged, said in (
        ({**files, "meshes/shaft_0000.msh": moved}, r"shaft_0000\.msh: 0\.050 m outside openings\[0\]"),
        ({**files, "meshes/shaft_0000.msh": low}, r"shaft_0000\.msh: from .* openings\[0\] has 1\.000 to 9"),
        (without, "'fence_0000': missing, or no opening has it"),
    ):
        forged = sealed(forged)
        with pytest.raises(BundleError, match=said):
            check_files(under.bundle, forged, hash_files(forged))


def test_an_open_shaft_shows_its_lining_and_no_fence(under):
    openings = Openings(under.openings)
    floor = filled_floor(under.floor, openings)
    for fenced, names in ((True, {"fence_0000", "shaft_0000"}), (False, {"shaft_0000"})):
        assert show_openings(openings, floor, {}, 3.5, fenced).keys() == names


def test_rock_that_hangs_low_under_a_shaft_shows_no_hole(config, under, capsys):
    openings = Openings(under.openings)
    floor = filled_floor(under.floor, openings)
    rough = rough_surface(config, drifts_of(under), floor, under.network)
    assert len(open_roof(rough, openings, floor).mesh.vertices) > len(rough.mesh.vertices)
    sunk = replace(rough.mesh, vertices=rough.mesh.vertices - [0, 0, 2.0])
    assert len(open_roof(replace(rough, mesh=sunk), openings, floor).mesh.vertices) == len(sunk.vertices)
    assert "the rock under the shaft at (30.0, 0.0) shows no hole" in capsys.readouterr().err


def test_split_edges_leave_no_crack_between_neighbours():
    corners = np.array([[0, 0, 0], [7, 0, 0], [7, 3, 0], [0, 3, 0], [3, 9, 0.0]])
    whole = np.array([[0, 1, 2], [0, 2, 3], [3, 2, 4]])
    points, faces = split_edges(corners, whole, lambda one, two: np.linalg.norm(one - two, axis=1) > 1.0)
    sides = np.linalg.norm(points[faces] - np.roll(points[faces], 1, axis=1), axis=2)
    assert sides.max() <= 1.0
    edges, count = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_counts=True)
    assert count.max() == 2
    rim = np.linalg.norm(points[edges[count == 1, 0]] - points[edges[count == 1, 1]], axis=1).sum()
    assert rim == pytest.approx(7 + 3 + 3 + np.hypot(4, 6) + np.hypot(3, 6))


def test_the_smooth_surface_of_a_straight_decline_has_few_faces_and_follows_its_floor():
    pieces = smooth_surface(STRAIGHT, 3.5, 0.3, 0.9, 2.0)
    floor = build_floor(STRAIGHT, [np.array([[0, 2.5, 0], [100, 2.5, -12.0]])], 30.0)
    for name, mesh in fold_smooth(pieces, floor).items():
        assert len(mesh.faces) < 2000, name  # halved down to 1 m, the roof alone had 30,000
        middle, plan = (mesh.vertices[mesh.faces].mean(axis=1), mesh.texcoords[mesh.faces].mean(axis=1) * 2.0)
        if name != "walls":  # textured along the wall
            inside = (plan[:, 0] > 6) & (plan[:, 0] < 94)
            above = middle[inside, 2] + 0.12 * plan[inside, 0]
            level = pieces[name].vertices[:, 2]
            assert (above > level.min() - 0.02).all()
            assert (above < level.max() + 0.02).all()
