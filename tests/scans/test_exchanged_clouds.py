"""Scans as PTX, and trees of OctoMap."""

import numpy as np
import pyoctomap
import pytest
import rasterio
import rasterio.shutil
from rasterio.transform import from_origin

from benchmarks.fuzzing.clouds import ptx_text, seen_drift
from minesurveys.clouds.cloud_formats import read_blocks
from minesurveys.clouds.point_blocks import PLACES, Wanted
from minesurveys.height_raster import read_raster
from minesurveys.remarks import collect_remarks
from pipeline.errors import InputError
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import CloudSurveyParams
from pipeline.survey.clouds.read import read_scan
from pipeline.survey.detect import detect_survey
from tests.octomap import OCCUPIED, BinaryTree
from tests.survey.clouds.test_cloud_volume import drift, noisy, sampled

SCANNER = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
PLAIN = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
# The example that LAStools publishes with its conversion, and the points that `las2txt` prints of the result.
MATRIX = "-0.955179 0.296021 -0.002106 0\n-0.296023 -0.955180 0.001152 0\n-0.001670 0.001724 0.999997 0\n"
MATRIX += "3.847211 12.235314 -0.425777 1\n"
ROWS = "1.111111 2.111111 3.111 0.111\n1.222222 2.222222 3.222 0.212\n0 0 0 0\n0 0 0 0\n1.333333 2.333333 3.333 0.312\n"
ROWS += "1.444444 2.444444 3.444 0.423\n0 0 0 0\n1.555555 2.555555 3.555 0.534\n1.666666 2.666666 3.666 0.678\n"
BY_LASTOOLS = [
    [2.156, 10.553, 2.685],
    [2.017, 10.480, 2.796],
    [1.877, 10.407, 2.907],
    [1.738, 10.334, 3.018],
    [1.599, 10.261, 3.129],
    [1.460, 10.188, 3.240],
]
SCAN = f"3\n3\n{SCANNER}{MATRIX}{ROWS}"


def read(path, text=None, wanted=PLACES):
    if text is not None:
        path.write_text(text)
    with collect_remarks() as remarks:
        blocks = list(read_blocks(path, 1.0, wanted))
    return blocks, " ".join(remark.line() for remark in remarks)


def test_points_of_a_ptx_file_are_where_lastools_has_them_and_directions_without_a_return_are_counted(tmp_path):
    blocks, remarks = read(tmp_path / "a.ptx", SCAN)
    np.testing.assert_allclose(np.concatenate([block.points for block in blocks]), BY_LASTOOLS, atol=6e-4)
    assert remarks == "a.ptx: 3 directions have no return (0 0 0, or no numbers) and are left out"


def test_each_scan_of_a_ptx_file_has_its_own_transformation(tmp_path):
    moved = PLAIN.replace("0 0 0 1", "351234.25 6301118.25 400 1")
    text = f"1\n2\n{SCANNER}{moved}1 2 3 0.5 9 8 7\nnan nan nan 0\n{SCAN}"
    blocks, remarks = read(tmp_path / "a.ptx", text, Wanted(colours=True))
    assert blocks[0].points.tolist() == [[351235.25, 6301120.25, 403.0]]
    assert blocks[0].colours.tolist() == [[9, 8, 7]]
    np.testing.assert_allclose(blocks[1].points, BY_LASTOOLS, atol=6e-4)
    assert "4 directions" in remarks


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (SCAN.replace("1.666666 2.666666 3.666 0.678\n", ""), r":18: the file ends within a scan; it is cut off"),
        (SCAN.replace("3\n3\n", "3\n3.5\n", 1), r":1: a scan of 3 columns and 3\.5 rows"),
        (
            SCAN.replace("3\n3\n", "99999\n99999\n", 1),
            r":1: a scan states 9,999,800,001 points, more than the file can",
        ),
        (SCAN.replace("3\n3\n", "1e308\n1e308\n", 1), r":1: a scan states inf points, more than the file can hold"),
        (SCAN.replace("0.999997", "2"), r":7: a scan's transformation is no rotation with a shift"),
        (SCAN.replace("1.444444", "x"), r":16: 'x 2\.444444 3\.444 0\.423' is no row of numbers"),
        (SCAN.replace("1.444444 2.444444", "1.4"), r":16: 3 columns|:16: .*columns"),
        (ROWS, r":1: '1\.111111 .*', want 1 numbers of a scan's header"),
    ],
)
def test_a_broken_ptx_file_is_refused_with_the_line(tmp_path, text, message):
    if "columns|" in message:
        text = text.replace("1.4 3.444 0.423", "1.4 3.444")
    with pytest.raises(InputError, match=message):
        read(tmp_path / "a.ptx", text)


@pytest.fixture(scope="module")
def tree():
    return seen_drift()


@pytest.mark.parametrize("suffix", [".bt", ".ot"])
def test_occupied_voxels_of_a_tree_are_points_at_their_middles(tmp_path, tree, suffix):
    path = tmp_path / f"a{suffix}"
    (tree.writeBinary if suffix == ".bt" else tree.write)(str(path))
    blocks, remarks = read(path)
    points = np.concatenate([block.points for block in blocks])
    tree.writeBinary(str(tmp_path / "b.bt"))
    comments = b"# (feel free to add / change comments, but leave the first line as it is!)\n#\n"
    leaves = BinaryTree((tmp_path / "b.bt").read_bytes().replace(comments, b"")).leaves
    occupied = np.array([key[1:] for key, state in leaves.items() if state == OCCUPIED and key[0] == 16])
    occupied = (occupied - 2**15 + 0.5) * 0.1
    by_row = lambda rows: rows[np.lexsort(rows.round(3).T)]  # noqa: E731
    np.testing.assert_allclose(by_row(points), by_row(occupied), atol=1e-5)
    assert "an octree of 0.1 m; the middles of its occupied voxels are read as a scan" in remarks


@pytest.mark.slow
def test_the_free_space_of_a_tree_is_built_as_that_of_a_scan(tmp_path, tree):
    tree.writeBinary(str(tmp_path / "a.bt"))
    values = detect_survey(tmp_path / "a.bt", StatedOptions()).values
    assert values["kind"] == "cloud"
    params = CloudSurveyParams(kind="cloud", name="a", file="data/x", heights=None, voxel_m=values["voxel_m"])
    found = read_scan(params.model_copy(update={"file": (tmp_path / "a.bt").as_posix()}))
    low, high = found.solid.vertices.min(axis=0), found.solid.vertices.max(axis=0)
    np.testing.assert_allclose(high - low, [10, 4, 3], atol=0.2)  # two voxels


def test_a_leaf_of_many_voxels_has_those_on_its_faces(tmp_path):
    tree = pyoctomap.OcTree(0.5)
    for x in np.arange(4) * 0.5 + 0.25:
        for y in np.arange(4) * 0.5 + 0.25:
            for z in np.arange(4) * 0.5 + 0.25:
                for _ in range(9):  # to the greatest certainty, so that the eight children become one leaf
                    tree.updateNode([x, y, z], True)
    tree.writeBinary(str(tmp_path / "a.bt"))
    points = np.concatenate([block.points for block in read(tmp_path / "a.bt")[0]])
    assert len(points) == 4**3 - 2**3
    assert points.min(axis=0) == pytest.approx([0.25] * 3)
    assert points.max(axis=0) == pytest.approx([1.75] * 3)


@pytest.mark.parametrize("suffix", [".bt", ".ot"])
@pytest.mark.parametrize("change", [lambda b: b[:5000], lambda b: b.replace(b"\nsize ", b"\nsize 99999")])
def test_a_tree_that_its_bytes_do_not_hold_is_refused(tmp_path, tree, suffix, change):
    path = tmp_path / f"a{suffix}"
    (tree.writeBinary if suffix == ".bt" else tree.write)(str(path))
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(InputError, match=r"states '\d+' nodes, which [\d,]+ bytes do not hold|it is broken"):
        read(path)


def test_a_tree_with_bytes_put_in_is_refused_before_the_library_reserves_memory(tmp_path, tree):
    tree.write(str(tmp_path / "a.ot"))
    data = (tmp_path / "a.ot").read_bytes()
    (tmp_path / "a.ot").write_bytes(data[:5000] + bytes(23) + data[5000:])
    with pytest.raises(InputError, match=r"a\.ot: states '\d+' nodes, which [\d,]+ bytes do not hold"):
        read(tmp_path / "a.ot")


@pytest.mark.parametrize("kind", ["OcTree", "ColorOcTree", "OcTreeStamped"])
def test_each_kind_of_tree_is_read_from_either_form(tmp_path, kind):
    tree = getattr(pyoctomap, kind)(0.1)
    for step in range(200):
        tree.updateNode(np.array([0.1 * step + 0.05, 0.05, 0.05]), True)
    tree.write(str(tmp_path / "a.ot"))
    tree.writeBinary(str(tmp_path / "a.bt"))
    for suffix in (".ot", ".bt"):
        assert len(np.concatenate([block.points for block in read(tmp_path / f"a{suffix}")[0]])) == 200


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"binterr1.3" + bytes(300), r"a terrain \(VTP\); `gdal_translate a\.bt out\.tif`"),
        (b"anything", r"not a tree of OctoMap"),
        (b"# Octomap OcTree binary file\nid Other\nsize 1\nres 0.1\ndata\n", r"a tree of 'Other'"),
    ],
)
def test_a_file_that_is_no_tree_is_refused_by_what_it_is(tmp_path, data, message):
    (tmp_path / "a.bt").write_bytes(data)
    with pytest.raises(InputError, match=message):
        read(tmp_path / "a.bt")


@pytest.mark.parametrize(("suffix", "said"), [(".ptx", "its format counts in metres, 14"), (".xyz", "states no unit")])
def test_formats_that_count_in_metres_are_no_guess(tmp_path, suffix, said):
    points = noisy(sampled(drift()))
    if suffix == ".ptx":
        (tmp_path / "a.ptx").write_text(ptx_text(points))
    else:
        np.savetxt(tmp_path / "a.xyz", points, "%.3f")
    with collect_remarks() as remarks:
        detect_survey(tmp_path / f"a{suffix}", StatedOptions())
    assert any(said in remark.line() for remark in remarks)


def test_a_terrain_is_read_as_the_geotiff_that_the_refusal_asks_for(tmp_path):
    """GDAL writes both formats; it is what `gdal_translate` calls."""
    heights = np.full((40, 40), 400, np.int16)
    size = {"height": 40, "width": 40, "count": 1, "dtype": "int16", "crs": "EPSG:32632"}
    with rasterio.open(tmp_path / "a.tif", "w", driver="GTiff", transform=from_origin(5e5, 5e6, 1, 1), **size) as file:
        file.write(heights, 1)
    rasterio.shutil.copy(tmp_path / "a.tif", tmp_path / "a.bt", driver="BT")
    with pytest.raises(InputError, match=r"a terrain \(VTP\); `gdal_translate a\.bt out\.tif`"):
        read(tmp_path / "a.bt")
    rasterio.shutil.copy(tmp_path / "a.bt", tmp_path / "out.tif", driver="GTiff")
    assert (read_raster(tmp_path / "out.tif").points[:, 2] == 400).all()
