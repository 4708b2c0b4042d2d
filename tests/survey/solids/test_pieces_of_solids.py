"""Pieces of solids: free space and rock by their sense, and blocks that share faces, edges and corners."""

import numpy as np
import pytest
import trimesh

from pipeline.survey.solids.closing import close_pieces
from pipeline.survey.solids.free_space import free_space_of

WELD_M = 0.001
ROOM = [[0, 0, 0], [30, 30, 6]]
BLOCK = [[0, 0, 0], [30, 4, 3.5]]
TURN = trimesh.transformations.rotation_matrix(0.3, [1, 0.4, 0.2], [40, -20, 8])  # corners are then rounded


def box(low_high, is_rock=False, turn=None):
    found = trimesh.creation.box(bounds=low_high)
    vertices = found.vertices if turn is None else trimesh.transform_points(found.vertices, turn)
    return vertices.astype(np.float32).astype(float), found.faces[:, ::-1] if is_rock else found.faces


def soup(*boxes):
    """Vertices and faces of boxes, one after another, that share no vertex."""
    first = np.cumsum([0, *(len(vertices) for vertices, _ in boxes)])
    faces = np.concatenate([faces + start for (_, faces), start in zip(boxes, first[:-1], strict=True)])
    return np.concatenate([vertices for vertices, _ in boxes]), faces


def shuffled(vertices, faces):
    return vertices, np.random.default_rng(0).permutation(faces)


def found(vertices, faces):
    pieces = close_pieces(vertices, faces, WELD_M, 1.0)
    return pieces, free_space_of(pieces, WELD_M)


@pytest.mark.parametrize("turn", [None, TURN])
@pytest.mark.parametrize(
    ("low_high", "left_m3"),
    [
        ([[12, 12, 0], [18, 18, 6]], 5400 - 216),  # a pillar: floor and roof are those of the room
        ([[12, 12, 2], [18, 18, 4]], 5400 - 72),  # it floats
        ([[12, 12, -1], [18, 18, 7]], 5400 - 216),  # it stands out
        ([[0, 0, 0], [6, 6, 6]], 5400 - 216),  # in a corner: they share faces, edges and a corner
    ],
)
def test_a_piece_of_the_other_sense_in_the_others_is_rock(low_high, left_m3, turn):
    for inside_out in (False, True):
        vertices, faces = soup(box(ROOM, inside_out, turn), box(low_high, not inside_out, turn))
        for mesh in ((vertices, faces), shuffled(vertices, faces)):
            _, space = found(*mesh)
            assert space.solid.volume() == pytest.approx(left_m3, abs=0.05)
            assert (len(space.rock), space.turned) == (1, int(inside_out))
            assert space.rock[0].volume_m3 == pytest.approx(np.prod(np.subtract(*low_high)) * -1, rel=1e-3)


def test_a_piece_of_the_other_sense_beside_the_others_is_turned():
    for low_high in ([[29, 0, 0], [60, 4, 3.5]], [[30, 0, 0], [60, 4, 3.5]], [[15, 1, -20], [16, 2, 1]]):
        _, space = found(*soup(box(BLOCK), box(low_high, is_rock=True)))
        assert (space.rock, space.turned) == ([], 1)
        assert space.solid.volume() > 420


def test_a_copy_of_the_workings_in_the_other_sense_is_turned():
    for mesh in (soup(box(BLOCK), box(BLOCK, is_rock=True)), soup(box(BLOCK), box(BLOCK))):
        _, space = found(*mesh)
        assert (space.rock, space.solid.volume()) == ([], pytest.approx(420))


def test_a_piece_of_free_space_in_rock_is_cut_into_it():
    drift = [[10, 28, 0], [50, 32, 3.5]]
    _, space = found(*soup(box([[0, 0, 0], [60, 60, 6]]), box([[10, 10, 0], [50, 50, 6]], True), box(drift)))
    assert space.solid.volume() == pytest.approx(6 * 2000 + 40 * 4 * 3.5)
    assert len(space.solid.decompose()) == 1


@pytest.mark.parametrize("turn", [None, TURN])
@pytest.mark.parametrize(
    ("other", "m3"),
    [
        ([[30, 0, 0], [60, 4, 3.5]], 840),  # a face
        ([[30, 1, 0.5], [60, 3, 3]], 570),  # a part of a face
        ([[30, 1, 0], [60, 6, 3.5]], 945),  # parts of two faces
        ([[20, 4, 0], [24, 40, 3.5]], 924),  # a face within an edge: T-junctions
    ],
)
def test_blocks_with_a_common_face_are_one_space(other, m3, turn):
    apart = soup(box(BLOCK, turn=turn), box(other, turn=turn))
    for mesh in (apart, shuffled(*apart)):
        pieces, space = found(*mesh)
        assert (len(pieces.solids), pieces.holes, pieces.dropped, space.touching) == (2, [], 0, [])
        assert space.solid.volume() == pytest.approx(m3, abs=0.01)
        assert len(space.solid.decompose()) == 1


def test_eight_blocks_about_a_corner_are_one_space():
    blocks = [box([[x, y, z], [x + 10, y + 10, z + 4]]) for x in (0, 10) for y in (0, 10) for z in (0, 4)]
    for mesh in (soup(*blocks), shuffled(*soup(*blocks))):
        pieces, space = found(*mesh)
        assert (len(pieces.solids), len(space.solid.decompose())) == (8, 1)
        assert space.solid.volume() == pytest.approx(3200)


def test_blocks_whose_common_face_is_written_once_are_one_space():
    vertices, faces = soup(box(BLOCK), box([[30, 0, 0], [60, 4, 3.5]]))
    at_face = np.flatnonzero((vertices[faces][:, :, 0] == 30).all(axis=1))
    _, space = found(vertices, np.delete(faces, at_face[2:], axis=0))
    assert space.solid.volume() == pytest.approx(840)


def test_triangles_of_a_block_that_are_turned_over_are_turned_back_beside_another():
    vertices, faces = soup(box(BLOCK), box([[30, 0, 0], [60, 4, 3.5]]))
    faces[[1, 5, 14, 20]] = faces[[1, 5, 14, 20]][:, ::-1]
    pieces, space = found(vertices, faces)
    assert (pieces.flipped, space.solid.volume()) == (4, pytest.approx(840))


def test_a_mesh_with_each_triangle_twice_is_one_piece():
    vertices, faces = box(BLOCK)
    for again in (faces, faces[:, ::-1]):
        pieces, space = found(vertices, np.stack([faces, again], axis=1).reshape(-1, 3))
        assert (len(pieces.solids), space.solid.volume()) == (1, pytest.approx(420))


@pytest.mark.parametrize("turn", [None, TURN])
@pytest.mark.parametrize("other", [[[30, 4, 0], [60, 8, 3.5]], [[30, 4, 3.5], [60, 8, 7]], [[10, 4, 3.5], [40, 8, 7]]])
def test_spaces_that_touch_at_an_edge_or_a_point_get_rock_between_them(other, turn):
    _, space = found(*soup(box(BLOCK, turn=turn), box(other, turn=turn)))
    one, two = space.solid.decompose()
    assert len(space.touching) == 1
    assert one.min_gap(two, 1.0) > 0.02
    assert space.solid.volume() == pytest.approx(840, abs=0.1)


def test_corners_nearer_than_the_weld_are_one_wherever_they_lie():
    vertices, faces = box([[0, 0, 0], [10.00025, 4.00025, 3.00025]])  # corners straddle cells
    apart = vertices[faces].reshape(-1, 3)
    apart += np.random.default_rng(0).uniform(-0.25, 0.25, apart.shape) * WELD_M
    pieces = close_pieces(apart, np.arange(len(apart)).reshape(-1, 3), WELD_M, 1.0)
    assert (len(pieces.solids), pieces.holes) == (1, [])
    assert pieces.solids[0].num_vert() == 8
    assert pieces.solids[0].volume() == pytest.approx(10.00025 * 4.00025 * 3.00025, rel=1e-3)


def test_corners_of_a_dense_mesh_keep_a_weld_between_them():
    dense = trimesh.creation.icosphere(subdivisions=5, radius=1.0)  # 4 cm from corner to corner
    solid = close_pieces(dense.vertices, dense.faces, 0.1, 1.0).solids[0]
    corners = np.unique(np.asarray(solid.to_mesh64().vert_properties)[:, :3], axis=0)
    apart = np.linalg.norm(corners[:, None] - corners, axis=2)
    assert apart[np.triu_indices(len(corners), 1)].min() > 0.1
    assert solid.volume() == pytest.approx(4 / 3 * np.pi, rel=0.05)
