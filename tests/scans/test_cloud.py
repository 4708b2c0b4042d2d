import laspy
import numpy as np
import pytest
from scipy.spatial import cKDTree

from minesurveys.clouds import cloud_formats
from minesurveys.clouds.cloud_formats import read_blocks
from pipeline.errors import InputError
from pipeline.geometry.ray_scene import load_open3d
from pipeline.scans.cloud import CloudLimits, read_cloud, split_surfaces, without_outliers

LIMITS = CloudLimits(
    thin_m=0.05, range_m=(0.5, 50.0), max_points=1_000_000, height_m=(1.0, 12.0), mesh_points_per_m2=400
)


@pytest.fixture
def drift() -> np.ndarray:
    """A drift 12 m long, 5 m wide, 3 m high, seen from its middle: points on walls, roof and floor."""
    rng = np.random.default_rng(0)
    x, u = rng.uniform(-6, 6, 6000), rng.uniform(0, 1, 6000)
    side = np.arange(6000) % 4
    y = np.choose(side, [np.full(6000, 2.5), np.full(6000, -2.5), 5 * u - 2.5, 5 * u - 2.5])
    z = np.choose(side, [3 * u - 1, 3 * u - 1, np.full(6000, 2.0), np.full(6000, -1.0)])
    return np.column_stack([x, y, z]).round(4)


def read(path):
    """Return all points of a cloud in metres."""
    return np.concatenate([block.points for block in read_blocks(path, 1.0)])


def write_dat(path, points, header="time x y z intensity"):
    rows = [f"{1398177459 + i * 1e-5:.6f} {x:.4f} {y:.4f} {z:.4f} {i % 255}" for i, (x, y, z) in enumerate(points)]
    path.write_text("\n".join([header, *rows]) + "\n")


def write_las(path, points, scale=0.001):
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales, header.offsets = [scale] * 3, points.min(axis=0)
    las = laspy.LasData(header)
    las.x, las.y, las.z = points.T
    las.write(path)


def write_open3d(path, points, **how):
    open3d = load_open3d()
    open3d.io.write_point_cloud(str(path), open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points)), **how)


WRITERS = {
    "NN_lidar.dat": write_dat,
    "a.xyz": lambda path, points: np.savetxt(path, points, fmt="%.4f"),
    "a.ply": write_open3d,
    "a.pcd": write_open3d,
    "text.pcd": lambda path, points: write_open3d(path, points, write_ascii=True),
    "packed.pcd": lambda path, points: write_open3d(path, points, compressed=True),
    "a.las": write_las,
    "a.laz": write_las,
}


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_returns_the_points_that_were_written(name, drift, tmp_path):
    WRITERS[name](tmp_path / name, drift)
    read = read_cloud(tmp_path / name, "m", CloudLimits(0.0001, (0.0, 50.0), 10**6, (1.0, 12.0), 400))
    assert len(read) == len(drift)
    assert cKDTree(read).query(drift)[0].max() < 2e-3


def test_thinning_keeps_one_point_per_voxel_for_any_block_size(drift, tmp_path, monkeypatch):
    write_dat(tmp_path / "a.dat", drift)
    whole = read_cloud(tmp_path / "a.dat", "m", LIMITS)
    monkeypatch.setattr(cloud_formats, "_BLOCK", 777)
    parts = read_cloud(tmp_path / "a.dat", "m", LIMITS)
    cells = [set(map(tuple, np.floor(p / LIMITS.thin_m).astype(int).tolist())) for p in (whole, parts)]
    assert cells[0] == cells[1]
    assert len(cells[0]) == len(whole) == len(parts) < len(drift)


def test_the_range_gate_drops_near_and_far_points(drift, tmp_path):
    write_dat(tmp_path / "a.dat", drift)
    kept = read_cloud(tmp_path / "a.dat", "m", CloudLimits(0.001, (3.0, 5.0), 10**6, (1.0, 12.0), 400))
    far = np.linalg.norm(kept, axis=1)
    assert far.min() >= 3.0
    assert far.max() <= 5.0


@pytest.mark.parametrize(("units", "factor"), [("mm", 1000.0), ("ft", 1 / 0.3048)])
def test_stated_units_are_converted_and_wrong_units_are_named(units, factor, drift, tmp_path):
    np.savetxt(tmp_path / "a.xyz", drift * factor, fmt="%.4f")
    limits = CloudLimits(0.05, (0.5, 50000.0), 10**6, (1.0, 8.0), 400)
    assert np.ptp(read_cloud(tmp_path / "a.xyz", units, limits)[:, 2]) == pytest.approx(3.0, abs=0.05)
    with pytest.raises(InputError, match=rf"a\.xyz: .* m high .* surface\.cloud\.units={units}"):
        read_cloud(tmp_path / "a.xyz", "m", CloudLimits(1.0, (0.5, 50000.0), 10**6, (1.0, 8.0), 400))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no rows"),
        ("time x y z intensity\n", "no rows"),
        ("time x y z intensity\n1 2 3\n", r":2: 3 columns, at least 4"),
        ("time x y z intensity\n1 2 3 four 5\n", r":2: 'four' is not a number"),
        ("time x y z intensity\n1 inf 3 4 5\n1 nan 3 4 5\n", "none of its 2 points was measured: 2 are NaN"),
        ("1 2 3 4 5\n1 2 3 4 5\n", r":1: a row of numbers, expected the header line"),
        ("time x y z intensity\n1 2 3 4 5\n", "1 usable points of 1"),
    ],
)
def test_a_faulty_cloud_is_refused_with_its_line(text, message, tmp_path):
    (tmp_path / "a.dat").write_text(text)
    with pytest.raises(InputError, match=message):
        read_cloud(tmp_path / "a.dat", "m", LIMITS)


@pytest.mark.parametrize("name", ["a.las", "a.laz", "a.ply", "a.pcd", "packed.pcd"])
def test_a_truncated_binary_cloud_is_refused(name, drift, tmp_path):
    WRITERS[name](tmp_path / name, drift)
    data = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match=name):
        read_cloud(tmp_path / name, "m", LIMITS)


def test_a_cloud_with_too_many_points_is_refused(drift, tmp_path):
    write_dat(tmp_path / "a.dat", drift)
    with pytest.raises(InputError, match="more than 1,000 points remain after thinning"):
        read_cloud(tmp_path / "a.dat", "m", CloudLimits(0.01, (0.5, 50.0), 1000, (1.0, 12.0), 400))


def test_a_file_of_another_program_is_refused_with_what_it_exports(tmp_path):
    (tmp_path / "a.rcp").write_bytes(b"x")
    with pytest.raises(InputError, match=r"\.rcp is not read: Autodesk ReCap exports"):
        read_cloud(tmp_path / "a.rcp", "m", LIMITS)


def test_a_drift_is_split_into_walls_roof_and_floor(drift):
    parts = split_surfaces(drift)
    assert np.median(np.abs(parts["wall"][:, 1])) == pytest.approx(2.5)
    assert np.median(parts["roof"][:, 2]) == pytest.approx(2.0)
    assert np.median(parts["floor"][:, 2]) == pytest.approx(-1.0)
    assert sum(map(len, parts.values())) == len(drift)


def test_isolated_points_are_dropped_as_outliers(drift):
    isolated = np.array([[0.0, 0.0, 0.5], [1.0, 0.5, 0.2]])
    kept = without_outliers(np.concatenate([drift, isolated]), 20, 3.0)
    assert not any((kept == p).all(axis=1).any() for p in isolated)
    assert len(kept) > 0.95 * len(drift)


def test_a_scanned_cave_is_sampled_uniformly(shared_rock):
    points = read_cloud(shared_rock, "m", CloudLimits(0.02, (0.0, 100.0), 10**7, (1.0, 12.0), 2000))
    assert np.ptp(points, axis=0) == pytest.approx([11.6, 3.6, 2.0], abs=0.3)
    assert {k for k, v in split_surfaces(points).items() if len(v) > 1000} == {"wall", "roof", "floor"}


def las_head(version: int, at: int, count: int) -> bytes:
    head = bytearray(375)
    head[:4], head[25] = b"LASF", version
    head[at : at + 4] = count.to_bytes(4, "little")
    return bytes(head)


def test_a_las_file_whose_points_lie_behind_its_end_is_refused_at_once(tmp_path):
    (tmp_path / "c.las").write_bytes(las_head(2, 96, 2**32 - 1))
    with pytest.raises(InputError, match=r"header states points behind byte 4,294,967,295; the file has 375"):
        list(read_blocks(tmp_path / "c.las", 1.0))


@pytest.mark.parametrize(("version", "at"), [(2, 100), (4, 243)])
def test_a_las_file_with_more_records_than_bytes_is_refused_at_once(tmp_path, version, at):
    path = tmp_path / "c.las"
    path.write_bytes(las_head(version, at, 100_000))
    with pytest.raises(InputError, match=r"header states 100,000 variable length records, .* the file has 375"):
        list(read_blocks(path, 100.0))


def test_a_las_file_that_states_a_version_whose_header_it_does_not_hold_is_refused(drift, tmp_path):
    path = tmp_path / "c.las"
    write_las(path, drift)
    data = bytearray(path.read_bytes())
    data[25] = 5  # LAS 1.5 has times in its header
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"c\.las: cannot be read as LAS or LAZ; it is broken"):
        list(read_blocks(path, 100.0))


def test_a_mesh_with_a_vertex_far_away_is_refused_before_it_is_sampled(tmp_path):
    path = tmp_path / "c.obj"
    path.write_text("v 0 0 0\nv 1e6 0 0\nv 0 1e6 0\nf 1 2 3\n")
    with pytest.raises(InputError, match=r"its area of 5e\+05 million square units needs 2e\+15 points"):
        list(read_blocks(path, 4000.0))


def test_a_mesh_whose_face_names_a_missing_vertex_is_refused(tmp_path):
    path = tmp_path / "c.ply"
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    path.write_text(
        head + "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n"
    )
    with pytest.raises(InputError, match=r"c\.ply: (a face has vertex 0 or 9|cannot be read as a mesh)"):
        list(read_blocks(path, 100.0))


@pytest.mark.parametrize("rows", [150, 250])
def test_a_pcd_of_other_rows_than_it_states_is_refused(rows, tmp_path):
    path = tmp_path / "drift.pcd"
    head = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 200\nHEIGHT 1\n"
    text = f"{head}VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 200\nDATA ascii\n"
    path.write_text(text + "1.5 2 3\n" * 200)
    assert len(np.concatenate([block.points for block in read_blocks(path, 1.0)])) == 200
    path.write_text(text + "1.5 2 3\n" * rows)
    with pytest.raises(InputError, match=rf"{rows} rows, but its header states 200 points"):
        list(read_blocks(path, 1.0))


def test_a_ply_in_ascii_that_ends_early_is_refused(tmp_path):
    path, point = tmp_path / "drift.ply", "property float x\nproperty float y\nproperty float z\n"
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex 200\n{point}end_header\n" + "1 2 3\n" * 150)
    with pytest.raises(InputError, match="150 rows, its header states 200"):
        list(read_blocks(path, 1.0))
    faces = "element face 3\nproperty list uchar int vertex_indices\n"
    corners = "0 0 0\n9 0 0\n9 9 0\n0 9 0\n"
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex 4\n{point}{faces}end_header\n{corners}3 0 1 2\n")
    with pytest.raises(InputError, match=r"drift\.ply: "):
        list(read_blocks(path, 1.0))


POINT = "property float x\nproperty float y\nproperty float z\n"


@pytest.mark.parametrize(
    ("head", "message"),
    [
        (f"element vertex 150\n{POINT}", "200 rows, its header states 150"),
        (f"element vertex 200\n{POINT}element camera 2\nproperty float a\n", "200 rows, its header states 202"),
        (f"element vertex 100\n{POINT}element vertex 100\n{POINT}", "'element vertex 100': not whole, or twice"),
        (f"element vertex -5\n{POINT}", "'element vertex -5': not whole"),
        (f"element vertex {10**19}\n{POINT}", "'element vertex 1"),
        (f"element vertex 200\nproperty float x\n{POINT}", "'property float x': not whole, or twice"),
        ("element vertex 200\nproperty float a\n", "no vertices with x, y and z"),
    ],
)
def test_a_ply_of_which_a_part_would_be_read_is_refused(head, message, tmp_path):
    path, rows = tmp_path / "drift.ply", "1 2 3\n" * 200
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex 200\n{POINT}end_header\n{rows}")
    assert len(np.concatenate([block.points for block in read_blocks(path, 1.0)])) == 200
    path.write_text(f"ply\nformat ascii 1.0\n{head}end_header\n{rows}")
    with pytest.raises(InputError, match=message):
        list(read_blocks(path, 1.0))


@pytest.mark.parametrize("how", [{}, {"write_ascii": True}, {"compressed": True}])
def test_a_pcd_with_other_fields_holds_the_points_that_open3d_reads(how, drift, tmp_path):
    open3d = load_open3d()
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(np.tile(drift, (2, 1)).round(1)))
    cloud.colors = open3d.utility.Vector3dVector(np.full((len(cloud.points), 3), 0.5))
    cloud.normals = open3d.utility.Vector3dVector(np.tile([0.0, 0.0, 1.0], (len(cloud.points), 1)))
    open3d.io.write_point_cloud(str(tmp_path / "a.pcd"), cloud, **how)
    theirs = np.asarray(open3d.io.read_point_cloud(str(tmp_path / "a.pcd")).points)
    assert np.concatenate([block.points for block in read_blocks(tmp_path / "a.pcd", 1.0)]).tolist() == theirs.tolist()


@pytest.mark.parametrize(
    ("old", "new", "error"),
    [
        ("SIZE 4 4 4", "SIZE 4 4", "no FIELDS x y z with a SIZE, TYPE and COUNT each"),
        ("FIELDS x y z", "FIELDS x y i", "no FIELDS x y z"),
        ("SIZE 4 4 4", "SIZE 4 4 -4", "its header states SIZE 4 4 -4; want numbers"),
        ("SIZE 4 4 4", "SIZE 4 4 3", "states z as 1 numbers F of 3 bytes"),
        ("POINTS 200", "POINTS 0", "its header states 0 points, and DATA ascii"),
        ("DATA ascii", "DATA", "DATA of no kind"),
        ("DATA ascii", "DATA binary_compressed", "bytes, which hold .*; its header states points of 2400"),
    ],
)
def test_a_pcd_whose_header_is_not_whole_is_refused(old, new, error, tmp_path):
    head = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS 200\nDATA ascii\n"
    (tmp_path / "a.pcd").write_text(head.replace(old, new) + "1.5 2 3\n" * 200)
    with pytest.raises(InputError, match=rf"a\.pcd: .*{error}"):
        list(read_blocks(tmp_path / "a.pcd", 1.0))


def test_a_laz_whose_table_states_more_chunks_than_it_can_hold_is_refused(drift, tmp_path):
    write_las(tmp_path / "a.laz", drift)
    data = bytearray((tmp_path / "a.laz").read_bytes())
    table = int.from_bytes(data[(at := int.from_bytes(data[96:100], "little")) : at + 8], "little")
    data[table + 4 : table + 8] = b"\xff" * 4
    (tmp_path / "a.laz").write_bytes(data)
    with pytest.raises(InputError, match=r"a\.laz: its table states 4,294,967,295 packed chunks, more than it can"):
        list(read_blocks(tmp_path / "a.laz", 1.0))


def test_a_binary_pcd_of_more_points_than_it_states_is_refused(tmp_path):
    path, points = tmp_path / "drift.pcd", np.ones((200, 3), "<f4").tobytes()
    head = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {0}\nHEIGHT 1\n"
    head += "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {0}\nDATA binary\n"
    path.write_bytes(head.format(200).encode() + points)
    assert len(np.concatenate([block.points for block in read_blocks(path, 1.0)])) == 200
    path.write_bytes(head.format(150).encode() + points)
    with pytest.raises(InputError, match="2400 bytes of points, but its header states 150 points, which take 1800"):
        list(read_blocks(path, 1.0))
