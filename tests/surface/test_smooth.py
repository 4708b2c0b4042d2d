import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from minexplore.bundle import ROOF
from pipeline.errors import GeometryError
from pipeline.surface.mesh.mesh_checks import check_mesh, join_meshes
from pipeline.surface.mesh.smooth import smooth_surface
from pipeline.surface.texture.picture import make_texture
from pipeline.types import Mesh
from tests.mines import RING, STRAIGHT, TEE, random_mine


def prismatoid_m3(length, width, chamfer):
    """Return the volume that a 45 deg chamfer along all sides of a rectangle cuts off."""
    inner = (length - 2 * chamfer) * (width - 2 * chamfer)
    middle = (length - chamfer) * (width - chamfer)
    return chamfer * length * width - chamfer / 6 * (length * width + 4 * middle + inner)


def test_the_smooth_surface_of_a_rectangle_has_exactly_the_volume_of_its_octagon():
    report = check_mesh(*join_meshes(smooth_surface(STRAIGHT, 3.5, 0.3, 0.9, 2.0)))
    expected = STRAIGHT.area * 3.5 - prismatoid_m3(100, 5, 0.3) - prismatoid_m3(100, 5, 0.9)
    assert report.volume_m3 == pytest.approx(expected, rel=1e-6)


def test_the_cross_section_is_an_octagon():
    smooth = smooth_surface(STRAIGHT, 3.5, 0.3, 0.9, 2.0)
    widths = {}
    for name, z in (("floor", 0.0), ("walls", 0.3), ("walls", 2.6), (ROOF, 3.5)):
        v = smooth[name].vertices
        level = v[np.isclose(v[:, 2], z)]
        widths[z] = np.ptp(level[:, 1])
    assert widths == pytest.approx({0.0: 4.4, 0.3: 5.0, 2.6: 5.0, 3.5: 3.2})


@pytest.mark.parametrize("mine", [RING, TEE], ids=["ring", "tee"])
def test_junctions_and_islands_are_closed_without_a_crack(mine):
    report = check_mesh(*join_meshes(smooth_surface(mine, 3.5, 0.3, 0.9, 2.0)))
    assert report.watertight
    assert report.winding_consistent
    assert not report.self_intersecting


@given(seed=st.integers(0, 10_000), drifts=st.integers(1, 5))
@settings(deadline=None, max_examples=15)
def test_the_smooth_surface_of_a_random_mine_is_watertight_even_where_chamfers_meet(seed, drifts):
    mine = random_mine(np.random.default_rng(seed), drifts).simplify(0.2)
    narrow = shapely.union_all([mine, shapely.box(-20, -0.4, 0, 0.4)])  # narrower than two chamfers
    check_mesh(*join_meshes(smooth_surface(shapely.set_precision(narrow, 1e-3), 3.5, 0.3, 0.9, 2.0)))


def test_a_missing_face_and_a_flipped_face_are_found():
    whole = smooth_surface(STRAIGHT, 3.5, 0.3, 0.9, 2.0)
    walls = whole["walls"]
    with pytest.raises(GeometryError, match="crack"):
        check_mesh(*join_meshes({**whole, "walls": Mesh(walls.vertices, walls.faces[:-1], walls.texcoords)}))
    flipped = walls.faces.copy()
    flipped[0] = flipped[0][::-1]
    with pytest.raises(GeometryError, match="flipped"):
        check_mesh(*join_meshes({**whole, "walls": Mesh(walls.vertices, flipped, walls.texcoords)}))


def test_chamfers_higher_than_the_drift_are_refused():
    with pytest.raises(GeometryError, match="do not fit into 3"):
        smooth_surface(STRAIGHT, 3.0, 1.5, 1.5, 2.0)


def test_the_texture_repeats_without_a_seam_and_has_the_given_mean_colour():
    texture = make_texture(128, 1.1, 0.2, (140, 110, 90), np.random.default_rng(3)).astype(float)
    across = np.abs(texture[:, 0] - texture[:, -1]).mean()
    inside = np.abs(np.diff(texture, axis=1)).mean()
    assert across < 1.5 * inside
    assert texture.mean(axis=(0, 1)) == pytest.approx([90, 110, 140], abs=4)


def test_a_self_intersection_is_found():
    whole = smooth_surface(TEE, 3.5, 0.3, 0.9, 2.0)
    roof = whole[ROOF]
    sunk = roof.vertices.copy()
    inside = np.argmin(np.linalg.norm(sunk - [40.5, 2.5, 3.5], axis=1))
    sunk[inside, 2] = -2.0  # one vertex of the roof is moved below the floor
    with pytest.raises(GeometryError, match="intersects itself"):
        check_mesh(*join_meshes({**whole, ROOF: Mesh(sunk, roof.faces, roof.texcoords)}))
