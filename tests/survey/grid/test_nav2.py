import shutil

import cv2
import numpy as np
import pytest
from PIL import Image as Pillow

from minesurveys.grid.nav2 import files_of_map, read_nav2_map
from pipeline.errors import InputError
from pipeline.geometry.maps.occupancy import nav2_map, occupancy_grid
from tests.mines import TEE
from tests.project import shared_file


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
        ("image: map.png\n", "resolution is missing; expected the metres of a cell"),
        ("- 1\n", "map.yaml"),
        ("image: ../../etc/passwd\nresolution: 1\norigin: [0, 0, 0]\n", "is outside the map's folder, and no plain"),
        (
            "image: none.png\nresolution: 1\norigin: [0, 0, 0]\n",
            r"image = none\.png is missing; put the picture",
        ),
        (f"image: {'a' * 300}.png\nresolution: 1\norigin: [0, 0, 0]\n", "image has 304 bytes, the limit is 255"),
        ("image: map.png\nresolution: 1\norigin: [1, 2, nan]\n", r"write 0: origin: \[1, 2, 0\]"),
        ("image: map.png\nresolution: 1\norigin: [1, 2, .nan]\n", r"write 0: origin: \[1, 2, 0\]"),
        ("image: map.png\nresolution: 1\norigin: [1, 2]\n", r"has no yaw; .* write 0: origin: \[1, 2, 0\]"),
        ("image: map.png\nresolution: 1\norigin: [.nan, 2, 0]\n", "expected three finite numbers"),
        ("image: map.png\nresolution: 1\norigin: [1, 2, 0, 0]\n", "expected three finite numbers"),
        (
            "image: map.png\nresolution: -1\norigin: [0, 0, 0]\n",
            "resolution = -1: expected the metres of a cell, more than 0",
        ),
        (
            "image: map.png\nresolution: 1\norigin: [0, 0, 0]\noccupied_thresh: 65\n",
            "occupied_thresh = 65: expected a share from 0 to 1, such as 0.65",
        ),
        ("- 1\n- 2\n", "not a map: expected keys and values, image, resolution and origin among them"),
        ("image: map.png\nresolution: 1\norigin: [0, x, 0]\n", "origin"),
        ("image: !!python/object/apply:os.system [true]\n", "cannot be read as YAML"),
    ],
)
def test_a_map_that_cannot_be_used_is_refused(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read_nav2_map(write(tmp_path, text))


@pytest.mark.parametrize("kind", ["P2", "P5"])
@pytest.mark.parametrize("largest", [1, 100, 200, 1000, 65534])
def test_a_pgm_has_the_white_that_its_header_states(tmp_path, kind, largest):
    values = np.array([[largest, round(0.5 * largest) if largest > 1 else 1, 0]])
    binary = values.astype(">u2" if largest > 255 else "u1").tobytes()
    body = binary if kind == "P5" else " ".join(map(str, values[0])).encode()
    (tmp_path / "map.pgm").write_bytes(f"{kind}\n# a comment\n3 1\n{largest}\n".encode() + body)
    (tmp_path / "map.yaml").write_text("image: map.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n")
    nav2 = read_nav2_map(tmp_path / "map.yaml")
    assert nav2.free.tolist() == [[True, largest == 1, False]]
    assert nav2.occupied.tolist() == [[False, False, True]]


def written_by_pillow(folder, pixels, text, name="map.png"):
    Pillow.fromarray(np.array(pixels)).save(folder / name)
    return write(folder, f"image: {name}\nresolution: 0.1\norigin: [1, 2, 0.5]\n{text}")


OPAQUE_AND_CLEAR = np.array([[[254, 254, 254, 255], [254, 254, 254, 0], [0, 0, 0, 255], [0, 0, 0, 0]]], np.uint8)


@pytest.mark.parametrize(
    ("mode", "free", "occupied"),
    [
        # of a fourth colour: shares of 0.00, 0.25, 0.75 and 1.00
        ("trinary", [1, 0, 0, 0], [0, 0, 1, 1]),
        ("scale", [1, 0, 0, 0], [0, 0, 1, 0]),
        # 254 is beyond 100, 0 is free
        ("raw", [0, 0, 1, 1], [0, 0, 0, 0]),
    ],
)
def test_opacity_is_read_by_the_maps_mode_as_map_server_does(tmp_path, capsys, mode, free, occupied):
    path = written_by_pillow(tmp_path, OPAQUE_AND_CLEAR, f"mode: {mode}\nfree_thresh: 0.196\n")
    nav2 = read_nav2_map(path)
    assert nav2.free.astype(int).tolist() == [free]
    assert nav2.occupied.astype(int).tolist() == [occupied]
    assert (nav2.origin_m, nav2.yaw_rad, nav2.cell_m) == ((1.0, 2.0), 0.5, 0.1)
    assert "map.yaml: 2 cells are not opaque: " in capsys.readouterr().err


def test_a_map_of_grey_and_opacity_and_a_palette_with_a_clear_colour_are_unknown_where_clear(tmp_path):
    grey = Pillow.fromarray(np.array([[254, 254, 0]], np.uint8))
    grey.putalpha(Pillow.fromarray(np.array([[255, 100, 255]], np.uint8)))
    indexed = Pillow.fromarray(np.array([[0, 1, 2]], np.uint8))
    indexed = indexed.convert("P")
    indexed.putpalette([254] * 6 + [0] * 3)
    for picture, how in ((grey, {}), (indexed, {"transparency": 1})):
        for name in ("map.png", "map.gif") if how else ("map.png",):
            picture.save(tmp_path / name, **how)
            nav2 = read_nav2_map(write(tmp_path, f"image: {name}\nresolution: 0.1\norigin: [0, 0, 0]\nmode: scale\n"))
            assert nav2.free.tolist() == [[True, False, False]]
            assert nav2.occupied.tolist() == [[False, False, True]]


def test_shades_are_means_of_the_colours_and_cells_between_the_thresholds_are_uncertain_in_the_mode_scale(tmp_path):
    yellow, red = [255, 255, 0], [255, 0, 0]  # shares of a third and of two thirds
    path = written_by_pillow(tmp_path, np.array([[yellow, red]], np.uint8), "mode: scale\nfree_thresh: 0.3\n")
    nav2 = read_nav2_map(path)
    assert not nav2.free.any()
    assert nav2.occupied.tolist() == [[False, True]]


def test_the_grey_of_unknown_cells_in_a_map_with_opacity_is_named_where_it_is_free(tmp_path, capsys):
    pixels = np.array([[[205, 205, 205, 255]]], np.uint8)
    path = written_by_pillow(tmp_path, pixels, "free_thresh: 0.196\n")
    assert read_nav2_map(path).free.all()
    said = capsys.readouterr().err
    assert "1 cells of grey 205, often unknown ones, are free by free_thresh = 0.196; 0.147 leaves them out" in said
    assert not read_nav2_map(written_by_pillow(tmp_path, pixels, "free_thresh: 0.147\n")).free.any()


@pytest.mark.parametrize("name", ["map-alpha.yaml", "map-ascii100.yaml"])
def test_maps_that_others_made_have_the_area_that_is_theirs(name):
    nav2 = read_nav2_map(shared_file(name))
    # The room is 304 m2; its outline is half a cell smaller or larger.
    assert nav2.free.sum() * nav2.cell_m**2 == pytest.approx(304, abs=0.5)


def test_a_pgm_of_16_bits_and_a_bitmap_are_read(tmp_path):
    (tmp_path / "map.yaml").write_text("image: map.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n")
    free = np.zeros((20, 32), bool)
    free[5:15, 5:25] = True
    deep = np.where(free, 65535, 0).astype(">u2").tobytes()
    for data in (b"P5\n32 20\n65535\n" + deep, b"P4\n32 20\n" + np.packbits(~free, axis=1).tobytes()):
        (tmp_path / "map.pgm").write_bytes(data)
        assert (read_nav2_map(tmp_path / "map.yaml").free == free[::-1]).all()


def test_thresholds_that_make_cells_free_and_occupied_are_refused(tmp_path):
    text = "image: map.png\nresolution: 0.1\norigin: [0, 0, 0]\nfree_thresh: 0.8\noccupied_thresh: 0.2\n"
    (tmp_path / "map.yaml").write_text(text)
    with pytest.raises(InputError, match=r"free_thresh = 0\.8 exceeds occupied_thresh = 0\.2"):
        read_nav2_map(tmp_path / "map.yaml")


@pytest.mark.parametrize(
    "image",
    ["/home/robot/maps/map.png", "../maps/map.png", "$(find my_maps)/maps/map.png", r"C:\maps\map.png", "maps/map.png"],
)
def test_the_picture_beside_a_map_is_read_where_its_path_is_of_another_machine(tmp_path, capsys, image):
    grey = np.array([[254, 0]], np.uint8)
    path = write(tmp_path, f"image: '{image}'\nresolution: 0.1\norigin: [0, 0, 0]\n", grey)
    assert read_nav2_map(path).free.tolist() == [[True, False]]
    assert files_of_map(path) == [path, tmp_path / "map.png"]
    assert "map.yaml: the picture map.png beside it is read" in capsys.readouterr().err


@pytest.mark.parametrize("image", ["../maps/map.png", "{folder}/map.png", "../maps/pictures/map.png"])
def test_a_copy_of_a_map_and_its_picture_in_another_folder_reads_as_the_original(tmp_path, image):
    image = image.format(folder=tmp_path / "maps")
    folder = tmp_path / "maps"
    (folder / "pictures").mkdir(parents=True)
    (folder / "map.yaml").write_text(f"image: {image}\nresolution: 0.1\norigin: [0, 0, 0]\n")
    place = folder / ("pictures" if "pictures" in image else "")
    cv2.imwrite(str(place / "map.png"), np.array([[254, 0]], np.uint8))
    _, found = files_of_map(folder / "map.yaml")
    assert found.relative_to(folder) == (place / "map.png").relative_to(folder)
    shutil.copytree(folder, tmp_path / "copy")
    shutil.rmtree(folder)
    assert read_nav2_map(tmp_path / "copy" / "map.yaml").free.tolist() == [[True, False]]


def test_a_picture_outside_the_folder_is_never_read(tmp_path):
    (tmp_path / "maps").mkdir()
    cv2.imwrite(str(tmp_path / "map.png"), np.array([[254, 0]], np.uint8))
    (tmp_path / "maps" / "link.png").symlink_to(tmp_path / "map.png")
    for image in (str(tmp_path / "map.png"), "../map.png", "link.png", "/maps/link.png"):
        path = write(tmp_path / "maps", f"image: {image}\nresolution: 0.1\norigin: [0, 0, 0]\n")
        with pytest.raises(InputError, match="is outside the map's folder"):
            read_nav2_map(path)


def test_a_map_that_is_free_everywhere_is_read(tmp_path):
    path = write(tmp_path, "image: map.png\nresolution: 1\norigin: [0, 0, 0]\n", np.full((5, 6), 254, np.uint8))
    assert read_nav2_map(path).free.all()


def test_cells_of_the_grey_of_unknown_ones_that_the_threshold_frees_are_counted(tmp_path, capsys):
    grey = np.array([[254, 205, 205, 0]], np.uint8)
    head = "image: map.png\nresolution: 1\norigin: [0, 0, 0]\nfree_thresh: "
    assert read_nav2_map(write(tmp_path, head + "0.25\n", grey)).free.sum() == 3
    assert "map.yaml: 2 cells of grey 205" in capsys.readouterr().err
    assert read_nav2_map(write(tmp_path, head + "0.196\n", grey)).free.sum() == 1
    assert capsys.readouterr().err == ""


def test_a_map_of_decimal_numbers_without_a_last_line_end_and_with_tabs_is_read(tmp_path):
    (tmp_path / "m.pgm").write_text("P2\n# CREATOR: map_saver\n3 1\n255\n254 205 254")
    lines = ["image:\tm.pgm", "resolution:\t0.5", "origin:\t[0, 0, 0]", "negate:\t0"]
    (tmp_path / "m.yaml").write_text("\n".join([*lines, "occupied_thresh: 0.65", "free_thresh: 0.196"]))
    assert read_nav2_map(tmp_path / "m.yaml").free.tolist() == [[True, False, True]]
