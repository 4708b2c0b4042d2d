import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.geometry.maps.octree import Columns, build_octree, to_bt
from tests.octomap import FREE, OCCUPIED, UNKNOWN, BinaryTree


def _octree(free, origin_m, cell_m, height_m):
    return build_octree(Columns.of_cells(np.argwhere(free), origin_m, cell_m, height_m), cell_m)


def test_free_volume_is_the_cells_times_the_height():
    free = np.zeros((9, 13), dtype=bool)
    free[2:6, 3:11] = True
    tree = BinaryTree(to_bt(_octree(free, np.array([-3.0, 2.0]), 0.5, 3.5)))
    assert tree.volume_m3(FREE) == pytest.approx(4 * 8 * 0.25 * 3.5)


def test_points_are_free_in_the_drift_occupied_in_its_walls_and_unknown_beyond():
    free = np.ones((4, 8), dtype=bool)
    tree = BinaryTree(to_bt(_octree(free, np.array([0.0, 0.0]), 1.0, 3.0)))
    points = [[4.5, 2.5, 1.5], [4.5, 2.5, -0.5], [4.5, 2.5, 3.5], [-0.5, 2.5, 1.5], [-2.5, 2.5, 1.5], [4.5, 2.5, 9.5]]
    assert tree.query(np.array(points)).tolist() == [FREE, OCCUPIED, OCCUPIED, OCCUPIED, UNKNOWN, UNKNOWN]


@given(st.integers(0, 10_000))
@settings(deadline=None, max_examples=30)
def test_the_tree_equals_its_grid(seed):
    rng = np.random.default_rng(seed)
    free = rng.random((rng.integers(1, 20), rng.integers(1, 20))) < 0.5
    origin = np.array([rng.integers(-40, 40), rng.integers(-40, 40)]) * 0.5
    tree = BinaryTree(to_bt(_octree(free, origin, 0.5, 2.0)))
    rows, cols = np.indices(free.shape).reshape(2, -1)
    knee = np.column_stack([origin[0] + (cols + 0.5) * 0.5, origin[1] + (rows + 0.5) * 0.5, np.full(len(rows), 0.9)])
    assert ((tree.query(knee) == FREE) == free.ravel()).all()
    assert tree.volume_m3(FREE) == pytest.approx(free.sum() * 0.25 * 2.0)


def test_a_tree_with_only_unknown_space_has_no_node():
    tree = _octree(np.zeros((2, 3), dtype=bool), np.array([0.0, 0.0]), 0.5, 2.0)
    assert tree.nodes == 0
    assert BinaryTree(to_bt(tree)).nodes == 0


def test_a_tree_of_one_voxel_is_written_in_octomaps_format():
    # One free voxel at the origin's positive corner: 15 nodes that have only child 0 (after the root's child 7),
    # the last with the free leaf. OctoMap writes inner children as bits 11, free as 10 (low bit first).
    tree = _octree(np.array([[True]]), np.array([0.0, 0.0]), 1.0, 1.0)
    data = to_bt(tree)
    head, body = data.split(b"data\n", 1)
    assert head.splitlines()[:2] == [b"# Octomap OcTree binary file", b"id OcTree"]
    assert f"size {tree.nodes}".encode() in head
    assert len(body) == 2 * sum(int((s == 3).sum()) for s in tree.states)
    assert (
        np.frombuffer(body[:2], "<u2")[0] == 0xFFFF
    )  # the voxel and its rock lie on both sides of the origin in x, y and z
