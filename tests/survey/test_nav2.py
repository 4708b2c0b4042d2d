import cv2
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.geometry.occupancy import nav2_map, occupancy_grid
from pipeline.survey.nav2 import read_nav2_map
from tests.mines import TEE


def write(folder, text, grey=None):
    (folder / "map.yaml").write_text(text)
    if grey is not None:
        cv2.imwrite(str(folder / "map.png"), grey)
    return folder / "map.yaml"


def test_a_written_map_is_read_unchanged(tmp_path):
    grid = occupancy_grid(TEE, 0.5, (-4.0, -4.0, 84.0, 44.0))
    pixels, text = nav2_map(grid)
    nav2 = read_nav2_map(write(tmp_path, text, pixels))
    assert (nav2.free == grid.free).all()
    assert (nav2.occupied == ~grid.free).all()
    assert nav2.origin_m == tuple(grid.origin_m)
    assert nav2.cell_m == 0.5


def test_negated_maps_raw_maps_and_unknown_cells_are_read(tmp_path):
    grey = np.array([[254, 205, 0]], np.uint8)
    head = "image: map.png\nresolution: 0.1\norigin: [1, 2, 0.5]\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    nav2 = read_nav2_map(write(tmp_path, head + "negate: 0\n", grey))
    assert nav2.free.tolist() == [[True, False, False]]
    assert nav2.occupied.tolist() == [[False, False, True]]
    assert nav2.yaw_rad == 0.5
    nav2 = read_nav2_map(write(tmp_path, head + "negate: 1\n", grey))
    assert nav2.free.tolist() == [[False, False, True]]
    nav2 = read_nav2_map(write(tmp_path, head + "mode: raw\n", np.array([[0, 100, 255]], np.uint8)))
    assert nav2.free.tolist() == [[True, False, False]]
    assert nav2.occupied.tolist() == [[False, True, False]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("image: map.png\n", "resolution: Field required"),
        ("- 1\n", "map.yaml"),
        ("image: ../../etc/passwd\nresolution: 1\norigin: [0, 0, 0]\n", "is outside"),
        ("image: none.png\nresolution: 1\norigin: [0, 0, 0]\n", "missing, though map.yaml names it"),
        ("image: map.png\nresolution: -1\norigin: [0, 0, 0]\n", "greater than 0"),
        ("image: map.png\nresolution: 1\norigin: [0, x, 0]\n", "origin"),
        ("image: !!python/object/apply:os.system [true]\n", "cannot be read as YAML"),
    ],
)
def test_a_map_that_cannot_be_used_is_refused(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read_nav2_map(write(tmp_path, text))
