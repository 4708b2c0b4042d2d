"""Colours of points: of each format, in voxels, and where there are none."""

import zipfile

import laspy
import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from minesurveys.clouds.cloud_formats import read_blocks
from minesurveys.clouds.point_blocks import COLOURS, PointBlock, Wanted, block_of, mean_colours
from pipeline.errors import InputError
from pipeline.survey.clouds.points import ScanFile, read_points
from pipeline.survey.clouds.thinned import thin

POINTS = np.random.default_rng(0).uniform(0, 5, (200, 3)).round(3)
RGB = np.random.default_rng(1).integers(1, 256, (200, 3))


def write(path, points=POINTS, rgb=RGB):
    match path.suffix:
        case ".xyz":
            np.savetxt(path, np.column_stack([rgb, points]), fmt="%.3f", header="red green blue x y z", comments="")
        case ".pts":
            rows = np.column_stack([points, np.full(len(points), -7), rgb])
            np.savetxt(path, rows, fmt="%.3f", header=str(len(points)), comments="")
        case ".ply":
            trimesh.PointCloud(points, colors=rgb.astype(np.uint8)).export(path)
        case ".pcd":
            packed = (rgb @ [1 << 16, 1 << 8, 1]).astype("<u4").view("<f4")
            head = "VERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
            head += f"WIDTH {len(points)}\nHEIGHT 1\nPOINTS {len(points)}\nDATA binary\n"
            path.write_bytes(head.encode() + np.column_stack([points.astype("<f4"), packed]).tobytes())
        case _:
            cloud = laspy.LasData(laspy.LasHeader(point_format=2, version="1.2"))
            cloud.header.scales, cloud.header.offsets = [0.001] * 3, [0.0] * 3
            cloud.x, cloud.y, cloud.z = points.T
            cloud.red, cloud.green, cloud.blue = 257 * rgb.T
            cloud.write(str(path))
    return path


def cloud_of(path, colours=True):
    return read_points(ScanFile(path.as_posix(), 1.0, "z", (0.0, 0.0, 0.0), 0.001, colours=colours)).cloud


@pytest.mark.parametrize("suffix", [".las", ".laz", ".ply", ".pcd", ".xyz", ".pts"])
def test_colours_of_each_format_are_those_that_were_written(tmp_path, suffix):
    cloud = cloud_of(write(tmp_path / f"a{suffix}"))
    assert cloud.rgb.dtype == np.uint8
    np.testing.assert_array_equal(cloud.rgb, RGB[cKDTree(POINTS).query(cloud.points_m)[1]])


def test_scans_of_an_e57_file_may_have_colours(tmp_path):
    pye57 = pytest.importorskip("pye57", reason="pye57 is not installed (extra `e57`)")
    file = pye57.E57(str(tmp_path / "a.e57"), mode="w")
    columns = {f"cartesian{axis}": POINTS[:, k] for k, axis in enumerate("XYZ")}
    file.write_scan_raw(columns)
    channels = {f"color{name}": RGB[:, k].astype(float) for k, name in enumerate(("Red", "Green", "Blue"))}
    file.write_scan_raw({**columns, "intensity": np.zeros(len(POINTS)), **channels})
    file.close()
    cloud = cloud_of(tmp_path / "a.e57")
    assert cloud.count.tolist() == [2] * len(POINTS)
    np.testing.assert_array_equal(cloud.rgb, RGB[cKDTree(POINTS).query(cloud.points_m)[1]])


@pytest.mark.parametrize("suffix", [".las", ".ply", ".xyz"])
def test_they_are_left_out_on_request(tmp_path, suffix):
    assert cloud_of(write(tmp_path / f"a{suffix}"), colours=False).rgb.shape == (0, 3)


def test_a_las_file_of_bytes_is_not_darkened(tmp_path):
    path = write(tmp_path / "a.las")
    cloud = laspy.read(path)
    cloud.red, cloud.green, cloud.blue = RGB.T
    cloud.write(str(path))
    assert sorted(cloud_of(path).rgb[:, 0].tolist()) == sorted(RGB[:, 0].tolist())


def test_a_ply_may_have_16_bits(tmp_path):
    head = "ply\nformat ascii 1.0\nelement vertex 200\nproperty float x\nproperty float y\nproperty float z\n"
    head += "property ushort red\nproperty ushort green\nproperty ushort blue\nend_header\n"
    rows = "".join(
        f"{x} {y} {z} {257 * r} {257 * g} {257 * b}\n" for (x, y, z), (r, g, b) in zip(POINTS, RGB, strict=True)
    )
    (tmp_path / "a.ply").write_text(head + rows)
    cloud = cloud_of(tmp_path / "a.ply")
    np.testing.assert_array_equal(cloud.rgb, RGB[cKDTree(POINTS).query(cloud.points_m)[1]])


def test_a_file_turned_up_keeps_its_colours(tmp_path):
    path = write(tmp_path / "a.las")
    found = read_points(ScanFile(path.as_posix(), 1.0, "y", (0.0, 0.0, 0.0), 0.001, colours=True)).cloud
    turned = POINTS[:, [0, 2, 1]] * [1, -1, 1]
    np.testing.assert_array_equal(found.rgb, RGB[cKDTree(turned).query(found.points_m)[1]])


def test_a_voxel_has_the_mean_of_its_colours_and_black_points_have_none():
    points = np.repeat(np.arange(200.0)[:, None] * [1, 0, 0] + 0.5, 3, axis=0)
    rgb = np.tile([[10, 20, 30], [30, 40, 50], [0, 0, 0]], (200, 1))
    rgb[-3:] = 0
    cloud = thin(iter([block_of(points, dict(zip(COLOURS, rgb.T, strict=True)))]), 1.0, 10**6)
    assert cloud.count.tolist() == [3] * 200
    assert cloud.rgb[:-1].tolist() == [[20, 30, 40]] * 199
    assert cloud.rgb[-1].tolist() == [0, 0, 0]


def test_a_zip_file_may_hold_clouds_with_colours_and_without(tmp_path):
    write(tmp_path / "a.las")
    plain = POINTS + np.array([0, 0, 10])
    np.savetxt(tmp_path / "b.xyz", plain, fmt="%.3f")
    with zipfile.ZipFile(tmp_path / "c.zip", "w") as archive:
        for name in ("b.xyz", "a.las"):
            archive.write(tmp_path / name, name)
    cloud = cloud_of(tmp_path / "c.zip")
    high = cloud.points_m[:, 2] > 7
    assert len(cloud) == 400
    assert not cloud.rgb[high].any()
    assert cloud.rgb[~high].all()


@pytest.mark.parametrize("value", ["nan", -1, 1e6])
def test_a_colour_that_is_none_is_black(value):
    rgb = np.full((3, 3), 9.0)
    rgb[1, 2] = float(value)
    assert block_of(np.zeros((3, 3)), dict(zip(COLOURS, rgb.T, strict=True))).colours.tolist() == [
        [9] * 3,
        [0] * 3,
        [9] * 3,
    ]


@pytest.mark.parametrize(("values", "found"), [([[1.0, 0.5, 0.2]], [255, 128, 51]), ([[65_535, 257, 0]], [255, 1, 0])])
def test_shares_and_16_bits_become_bytes(values, found):
    assert mean_colours(np.array(values), np.ones(1)).tolist() == [found]


def test_a_word_in_a_colour_is_refused_by_its_line(tmp_path):
    path = write(tmp_path / "a.xyz")
    path.write_text(path.read_text().replace("\n", "\nx 1 1 1 0 0\n", 1))
    with pytest.raises(Exception, match=r"a\.xyz:2: 'x' is not a number"):
        list(read_blocks(path, 1.0, Wanted(colours=True)))
    assert len(np.concatenate([block.points for block in read_blocks(path, 1.0)])) == 201


def pcd(rows, types, kind):
    """Return a PCD file of rows with names, written in a kind of DATA."""
    names, sizes = rows.dtype.names, [str(rows.dtype[name].itemsize) for name in rows.dtype.names]
    head = f"VERSION 0.7\nFIELDS {' '.join(names)}\nSIZE {' '.join(sizes)}\nTYPE {types}\n"
    head += f"POINTS {len(rows)}\nDATA {kind}\n"
    if kind == "ascii":
        return (head + "".join(" ".join(map(repr, row)) + "\n" for row in rows.tolist())).encode()
    if kind == "binary":
        return head.encode() + rows.tobytes()
    data = b"".join(rows[name].tobytes() for name in names)
    pieces = [data[k : k + 32] for k in range(0, len(data), 32)]
    packed = b"".join(bytes([len(piece) - 1]) + piece for piece in pieces)
    return head.encode() + len(packed).to_bytes(4, "little") + len(data).to_bytes(4, "little") + packed


@pytest.mark.parametrize("kind", ["ascii", "binary", "binary_compressed"])
@pytest.mark.parametrize(("names", "size", "letter"), [("rgb", "f4", "F"), ("rgba", "u4", "U"), ("r g b", "u1", "U")])
def test_a_pcd_file_has_colours_as_it_states_beside_coordinates_of_64_bits_and_times(
    tmp_path, kind, names, size, letter
):
    channels = names.split()
    rows = np.zeros(len(POINTS), [*((name, "f8") for name in ("x", "y", "z", "time")), *((n, size) for n in channels)])
    rows["x"], rows["y"], rows["z"] = POINTS.T + 1e6
    rows["time"] = np.arange(len(POINTS)) / 8
    columns = RGB.T if len(channels) > 1 else [(RGB @ [1 << 16, 1 << 8, 1]).astype("<u4").view(size)]
    for channel, values in zip(channels, columns, strict=True):
        rows[channel] = values
    (tmp_path / "a.pcd").write_bytes(pcd(rows, f"F F F F {' '.join(letter * len(channels))}", kind))
    (block,) = read_blocks(tmp_path / "a.pcd", 1.0, Wanted(colours=True, times=True))
    np.testing.assert_array_equal(block.points, POINTS + 1e6)
    np.testing.assert_array_equal(block.colours, RGB)
    np.testing.assert_array_equal(block.times, rows["time"])
    (plain,) = read_blocks(tmp_path / "a.pcd", 1.0)
    assert plain.colours is None
    assert plain.times is None


def test_a_pcd_file_whose_colours_take_other_bytes_is_refused_where_they_are_wanted(tmp_path):
    head = "VERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 2\nTYPE F F F U\nPOINTS 2\nDATA ascii\n"
    (tmp_path / "a.pcd").write_text(head + "1 2 3 4\n" * 2)
    with pytest.raises(InputError, match=r"a\.pcd: its header states rgb as 1 numbers U of 2 bytes"):
        list(read_blocks(tmp_path / "a.pcd", 1.0, Wanted(colours=True)))
    assert len(next(read_blocks(tmp_path / "a.pcd", 1.0))) == 2


def test_voxels_keep_colours_and_first_times_of_blocks_that_have_them_in_part():
    places = np.arange(150.0)[:, None] * [1, 0, 0] + 0.5
    both = PointBlock(places, np.full((150, 3), 40.0), np.arange(150.0))
    blocks = [PointBlock(places), both, PointBlock(places + np.array([0, 5, 0]), np.full((150, 3), 9.0)), both]
    cloud = thin(blocks, 1.0, 10**6)
    near = cloud.points_m[:, 1] < 2
    assert cloud.count[near].tolist() == [3] * 150
    assert cloud.rgb[near].tolist() == [[40] * 3] * 150
    assert cloud.rgb[~near].tolist() == [[9] * 3] * 150
    assert np.isnan(cloud.time_s).all()  # the first point of each voxel has none
    again = thin([both, *blocks], 1.0, 10**6)
    assert again.time_s[near].tolist() == np.arange(150.0).tolist()
    assert np.isnan(again.time_s[~near]).all()
    assert again.some(near).rgb.shape == (150, 3)
