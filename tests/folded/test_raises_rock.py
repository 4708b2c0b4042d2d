"""Raises in visible rock: a hole in the rough roof, and a lining up to a cap."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from minexplore.bundle import decode_msh, encode_msh
from minexplore.schema import check_files, hash_files, read_folder
from minexplore.schema.openings import BundleError
from pipeline.errors import ArtifactError
from pipeline.mjcf.bundle import read_record
from pipeline.proof.rebuilt.fittings import require_fittings
from pipeline.proof.rebuilt.visible import _round_shafts
from tests.composed import compose
from tests.folded.test_folded_rock import COARSE, copied, drifts_of, up_the_shaft, visible
from tests.folded.test_openings import broken, validator_of
from tests.heights import RAMP
from tests.mines import sealed

LEGS = {
    "A": [("a", 0, 0, 100), ("q", 10, 0, 100), *RAMP["A"][1:3], ("d", 40, 0, 101.5)],
    "S": [("q", 10, 0, 100), ("s", 10, 0.1, 118)],
}


@pytest.fixture(scope="module")
def config():
    return compose(COARSE)


@pytest.fixture(scope="module", params=[2.2, pytest.param(0.8, marks=pytest.mark.slow)], ids=["wide", "narrow"])
def raised(request, mine_of_legs):
    return mine_of_legs(LEGS, *COARSE, report=False, half_m=request.param)


@pytest.fixture(scope="module")
def wide(mine_of_legs):
    return mine_of_legs(LEGS, *COARSE, report=False, half_m=2.2)


def lining_of(mine):
    return decode_msh((mine.bundle / "meshes/shaft_0000.msh").read_bytes())


def test_a_raise_is_open_up_to_its_cap_and_its_lining_is_as_wide_as_the_hole(raised):
    (opening,) = raised.openings
    shaft, lining = shapely.Polygon(opening.outline_m), lining_of(raised)
    shown = shapely.convex_hull(shapely.multipoints(lining.vertices[:, :2].astype(float)))
    aside = shapely.hausdorff_distance(shown, shaft)
    assert (aside < 1e-3) == (shaft.length > 5)  # the narrow drift's walls reach into the shaft's section
    assert shown.area > 0.4**2
    assert shaft.buffer(1e-3).contains(shown)
    assert lining.vertices[:, 2].max() == pytest.approx(opening.top_m)
    west, south, east, north = shown.buffer(-0.06).bounds
    for place in ((west, south), (east, north), (west, north), (10.0, 0.0)):
        assert up_the_shaft(raised, [*place, 1.2], 30.0) == pytest.approx(opening.top_m - 1.2, abs=1e-3)
    assert up_the_shaft(raised, [13.0, 0.0, 1.2], 30.0) < 3.5


def test_a_world_with_a_raise_and_rock_holds_its_certificate(raised, config):
    assert broken(validator_of(raised, config, 100).certificate) == {}
    record = read_record(raised.bundle)
    visible(raised.bundle)
    require_fittings(raised.bundle, record, drifts_of(raised), config.validation.fittings)
    assert not any("fence" in name for name in record.files)


def with_a_hole(mesh):
    """Leave out the largest face away from the raise, at (10, 0), whose corners other faces of the chunk share.

    Of the others, some leave a vertex without a face, which is another fault, and some a hole no larger than the
    tolerance on the raise's section. So a face must not be chosen by its number.
    """
    corners = mesh.vertices[mesh.faces].astype(float)
    shared = (np.bincount(mesh.faces.ravel())[mesh.faces] > 1).all(axis=1)
    away = np.linalg.norm(corners.mean(axis=1)[:, :2] - [10.0, 0.0], axis=1) > 3.0
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return replace(mesh, faces=np.delete(mesh.faces, np.argmax(np.where(shared & away, area, 0.0)), axis=0))


@pytest.mark.parametrize(
    ("mesh", "change", "said"),
    [
        ("roof", with_a_hole, r"a hole at \["),
        ("shaft", lambda mesh: replace(mesh, faces=mesh.faces[:-1]), r"shaft_0000\.msh: "),
    ],
)
def test_a_forged_hole_or_cap_is_refused(mesh, change, said, config, wide, tmp_path):
    folder = copied(wide, tmp_path / "world")
    record = read_record(folder)
    name = min(name for name in record.files if name.startswith(f"meshes/{mesh}"))
    (folder / name).write_bytes(encode_msh(change(decode_msh((folder / name).read_bytes()))))

    def check():
        visible(folder)
        require_fittings(folder, record, drifts_of(wide), config.validation.fittings)

    with pytest.raises(ArtifactError, match=said):
        check()


def test_a_lining_above_the_cap_or_as_low_as_robots_is_refused_by_the_schema(wide):
    files, lining = read_folder(wide.bundle), lining_of(wide)
    for up_m in (0.1, -2.6):
        moved = encode_msh(replace(lining, vertices=lining.vertices + np.float32([0, 0, up_m])))
        forged = sealed({**files, "meshes/shaft_0000.msh": moved})
        with pytest.raises(BundleError, match=r"shaft_0000\.msh: from .* openings\[0\] has 1\.000 to 18\.000"):
            check_files(wide.bundle, forged, hash_files(forged))


def rim_of(loop):
    """Return the edges (k, 2, 3) of a closed loop at 2 m over the floor."""
    loop = np.column_stack([np.array(loop, dtype=float), np.full(len(loop), 2.0)])
    return np.stack([loop, np.roll(loop, -1, axis=0)], axis=1)


def test_the_rim_of_a_hole_may_cross_itself_down_a_steep_face_but_not_leave_a_part_open():
    hole = np.array([(0.0, 0.0), (1.3, 0.0), (1.3, 1.3), (0.0, 1.3)])
    steep = [(0, 0), (0.7, 0.001), (0.699, -0.001), (0.7005, 0.0), (0.6985, 0.0), (1.3, 0), (1.3, 1.3), (0, 1.3)]
    for loop in (hole, steep):
        assert _round_shafts(rim_of(loop), [hole]).all()
        assert not _round_shafts(rim_of(loop)[1:], [hole]).any()
    assert not _round_shafts(rim_of(hole), [hole + 0.1]).any()
    low = rim_of(hole) * [1, 1, 0.4]
    assert not _round_shafts(low, [hole]).any()
