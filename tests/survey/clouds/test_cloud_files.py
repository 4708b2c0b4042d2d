"""Scans as files: formats, origins, units and axes, trajectories, and what is refused."""

import re

import laspy
import manifold3d
import numpy as np
import pytest
import trimesh

from benchmarks.scans.truth import mesh_of, truth_of
from minesurveys.remarks import collect_remarks
from pipeline.errors import InputError
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import CloudSurveyParams
from pipeline.survey.clouds.points import ScanFile, read_points
from pipeline.survey.clouds.read import read_scan
from pipeline.survey.clouds.trajectory import read_trajectory
from pipeline.survey.detect import detect_survey
from pipeline.survey.load import read_unlimited
from tests.survey.clouds.test_cloud_volume import drift, noisy, sampled

PARAMS = CloudSurveyParams(kind="cloud", name="a", file="data/x", heights=None)
GRID = np.array([351234.0, 6301118.0, 2412.5])


@pytest.fixture(scope="module")
def points():
    return noisy(sampled(drift()))


def write(path, points):
    match path.suffix:
        case ".xyz":
            np.savetxt(path, points, fmt="%.4f")
        case ".ply":
            trimesh.PointCloud(points).export(path)
        case ".pcd":
            head = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
            head += f"WIDTH {len(points)}\nHEIGHT 1\nPOINTS {len(points)}\nDATA binary\n"
            path.write_bytes(head.encode() + points.astype("<f4").tobytes())
        case _:
            cloud = laspy.LasData(laspy.LasHeader(point_format=0, version="1.2"))
            cloud.header.scales, cloud.header.offsets = [0.001] * 3, points.min(axis=0).round()
            cloud.x, cloud.y, cloud.z = points.T
            cloud.write(str(path))
    return path


def read(path, **values):
    return read_scan(PARAMS.model_copy(update={"file": path.as_posix(), **values}))


@pytest.mark.parametrize("suffix", [".las", ".laz", ".ply", ".pcd", ".xyz"])
def test_points_of_each_format_are_those_that_were_written(tmp_path, points, suffix):
    path = write(tmp_path / f"a{suffix}", points)
    found = read_points(ScanFile(path.as_posix(), 1.0, "z", None, 0.001))
    assert found.cloud.total == len(points)
    assert found.cloud.points_m.min(axis=0) + found.origin == pytest.approx(points.min(axis=0), abs=0.002)


@pytest.mark.parametrize("more", [1, -7])
def test_a_las_file_has_as_many_points_as_its_header_counts_or_it_is_listed(tmp_path, points, more):
    path = write(tmp_path / "a.las", points)
    data = bytearray(path.read_bytes())
    data[107:111] = (len(points) + more).to_bytes(4, "little")
    path.write_bytes(data)
    if more > 0:
        with pytest.raises(InputError, match=rf"^{path}: {len(points)} points, but its header states"):
            read_points(ScanFile(path.as_posix(), 1.0, "z", None, 0.001))
        return
    with collect_remarks() as remarks:
        read_points(ScanFile(path.as_posix(), 1.0, "z", None, 0.001))
    text = f"a.las: 7 of {len(points):,} points lie behind those that its header counts, and are not read"
    assert any(text in remark.line() for remark in remarks)


def test_coordinates_of_a_national_grid_and_elevations_get_an_origin(tmp_path, points):
    found = read(write(tmp_path / "a.laz", points + GRID))
    assert found.georeference.origin == (351230.0, 6301110.0)
    assert found.solid.datum_m == 2412
    low = found.solid.vertices.min(axis=0)
    assert low == pytest.approx([4.0, 8.0, 0.5], abs=0.15)


def test_the_plan_is_the_view_from_above(tmp_path, points):
    found = read(write(tmp_path / "a.las", points))
    assert found.workings.bounds == pytest.approx((0, 0, 14, 4), abs=0.15)
    assert found.workings.area == pytest.approx(14 * 4, rel=0.03)


def test_a_stated_unit_scales_the_scan(tmp_path, points):
    found = read(write(tmp_path / "a.las", points / 0.3048), unit="ft")
    assert found.workings.bounds == pytest.approx((0, 0, 14, 4), abs=0.15)


def test_a_file_with_y_up_is_turned_by_the_option(tmp_path, points):
    found = read(write(tmp_path / "a.las", points[:, [0, 2, 1]] * [1, 1, -1]), up="y")
    assert found.workings.bounds == pytest.approx((0, 0, 14, 4), abs=0.15)
    assert np.ptp(found.solid.vertices[:, 2]) == pytest.approx(3.0, abs=0.3)


def test_a_ply_without_faces_is_a_scan_and_with_them_a_solid(tmp_path, points):
    assert detect_survey(write(tmp_path / "a.ply", points)).values["kind"] == "cloud"
    trimesh.creation.box([8, 4, 3]).export(tmp_path / "b.ply")
    assert detect_survey(tmp_path / "b.ply").values["kind"] == "solid"


def test_a_mesh_with_a_stated_voxel_is_read_as_a_scan_however_it_is_folded(tmp_path):
    box = trimesh.creation.box([6, 4, 3])
    open_box = trimesh.Trimesh(box.vertices, box.faces[:-1]).subdivide()
    open_box.faces[::3] = open_box.faces[::3, ::-1]
    open_box.export(tmp_path / "a.stl")
    found = detect_survey(tmp_path / "a.stl", StatedOptions(voxel_m=0.2, close_m=6.0))
    assert (found.values["kind"], found.values["voxel_m"]) == ("cloud", 0.2)
    solid = read(tmp_path / "a.stl", voxel_m=0.2, close_m=6.0).solid
    assert np.ptp(solid.vertices, axis=0) == pytest.approx([6, 4, 3], abs=0.3)


def test_the_section_that_is_detected_is_a_survey_section(tmp_path, points):
    found = detect_survey(write(tmp_path / "a.laz", points))
    section = CloudSurveyParams.model_validate(found.values | {"name": "a", "heights": None, "file": "data/x"})
    assert 0.05 <= section.voxel_m <= 0.25


def test_what_is_guessed_is_listed_with_its_option(tmp_path, points):
    with collect_remarks() as said:
        detect_survey(write(tmp_path / "a.laz", points))
    text = " ".join(remark.line() for remark in said)
    assert re.search(
        r"read as metres, 14\.\d+ x 4\.\d+ x 3\.\d+ m, its passages [23]\.\d+ m across; --unit states", text
    )
    assert "y axis" not in text
    assert re.search(r"points are 0\.\d\d m apart; its surface is found to 0\.\d+ m; --voxel M", text)


def test_a_world_in_feet_with_y_up_is_noticed_as_a_scan_and_as_a_solid_and_changed_by_neither(tmp_path):
    _, world = truth_of(2)
    mesh = mesh_of(world)
    vertices = mesh.vertices[:, [0, 2, 1]] * [1, 1, -1] / 0.3048
    trimesh.Trimesh(vertices, mesh.faces, process=False).export(tmp_path / "a.obj")
    write(tmp_path / "a.las", noisy(sampled(world, 20))[:, [0, 2, 1]] * [1, 1, -1] / 0.3048)
    for name in ("a.obj", "a.las"):
        with collect_remarks() as said:
            found = detect_survey(tmp_path / name)
        text = " ".join(remark.line() for remark in said)
        assert "most level surfaces face along its y axis; z is taken as up; --up y turns it" in text
        assert re.search(r"its passages 1\d\.\d m across; in feet they are 3\.\d+ m across: --unit ft", text)
        assert found.values["unit"] in (None, "m")
        assert found.values["up"] is None
        with collect_remarks() as said:
            detect_survey(tmp_path / name, StatedOptions(unit="ft", up="y"))
        assert not re.search("y axis|in feet", " ".join(remark.line() for remark in said))


def test_points_that_no_unit_brings_near_are_called_broken(tmp_path, points):
    with pytest.raises(
        InputError, match=r"a\.ply: reaches .* m from its first points, .*; it is broken, or has points"
    ):
        read(write(tmp_path / "a.ply", points * 1e7))


def test_a_hole_of_the_scan_is_listed_with_place_and_width(tmp_path, points):
    path = write(tmp_path / "a.las", points[np.linalg.norm(points - [7, 2, 0], axis=1) > 1.0])
    with collect_remarks() as said:
        read(path)
    assert "1 holes of the scan, at most 3 m wide (--close M), are closed" in " ".join(remark.line() for remark in said)


def test_points_behind_walls_are_listed_and_purple_on_the_plan(tmp_path, points):
    far = np.random.default_rng(3).uniform([3, 4.7, 0], [5, 5.2, 3], (300, 3))
    path = write(tmp_path / "a.las", np.concatenate([points, far]))
    with collect_remarks() as said:
        read_of = read_unlimited(PARAMS.model_copy(update={"file": path.as_posix()}))
    assert re.search(r"\d+ voxels with points lie behind the walls", " ".join(remark.line() for remark in said))
    plan, frame = read_of.plan, read_of.survey.frame
    purple = np.argwhere((plan == (160, 60, 140)).all(axis=2))[:, ::-1]
    x, y = frame.to_mine(purple).T
    assert ((x > 2.9) & (x < 5.1) & (y > 4.6)).sum() > 50


def test_a_trajectory_has_rows_of_time_and_place(tmp_path):
    path = tmp_path / "way.txt"
    path.write_text("# time x y z\n0.0 1 2 3 0 0 0 1\n1.0, 4, 5, 6\n")
    found = read_trajectory(path)
    assert found.places.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert found.time_s.tolist() == [0, 1]


def test_places_lie_between_rows_by_their_times_in_any_order_and_none_beyond_them(tmp_path):
    path = tmp_path / "way.txt"
    path.write_text("20 4 5 6\n10 1 2 3\n")
    found = read_trajectory(path).at(np.array([10, 15, 20, 9.9, 20.1, np.nan]))
    assert found[:3].tolist() == [[1, 2, 3], [2.5, 3.5, 4.5], [4, 5, 6]]
    assert np.isnan(found[3:]).all()


@pytest.mark.parametrize("row", ["0 1 2", "0 1 2 x", "0 1 2 nan", "noon 1 2 3"])
def test_a_row_that_is_no_place_is_refused_by_its_line(tmp_path, row):
    path = tmp_path / "way.txt"
    path.write_text(f"0 1 2 3\n{row}\n")
    with pytest.raises(InputError, match=r"way\.txt:2: .* is no row of time x y z"):
        read_trajectory(path)


def test_a_trajectory_chooses_the_space_that_is_built(tmp_path, points):
    other = noisy(sampled(drift())) * [0.5, 0.75, 1] + [0, 10, 0]
    way = tmp_path / "way.txt"
    way.write_text("0 3 11.5 1.5\n1 4 11.5 1.5\n")
    found = read(write(tmp_path / "a.las", np.concatenate([points, other])), trajectory=way.as_posix())
    assert found.workings.bounds == pytest.approx((0, 10, 7, 13), abs=0.15)


def write_timed(path, points, time_s):
    """Write points (n, 3) with their times (n,)."""
    rows = np.column_stack([points, time_s])
    match path.suffix:
        case ".csv":
            np.savetxt(path, rows, fmt="%.4f", delimiter=",", header="x,y,z,gps_time", comments="")
        case ".dat":
            np.savetxt(path, rows[:, [3, 0, 1, 2]], fmt="%.4f", header="time x y z", comments="")
        case ".ply":
            fields = "".join(f"property double {name}\n" for name in ("x", "y", "z", "timestamp"))
            head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{fields}end_header\n"
            path.write_bytes(head.encode() + rows.astype("<f8").tobytes())
        case ".pcd":
            head = "VERSION 0.7\nFIELDS x y z time\nSIZE 8 8 8 8\nTYPE F F F F\nCOUNT 1 1 1 1\n"
            head += f"WIDTH {len(rows)}\nHEIGHT 1\nPOINTS {len(rows)}\nDATA binary\n"
            path.write_bytes(head.encode() + rows.astype("<f8").tobytes())
        case _:
            cloud = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
            cloud.header.scales = [0.001] * 3
            cloud.x, cloud.y, cloud.z = points.T
            cloud.gps_time = time_s
            cloud.write(str(path))
    return path


@pytest.mark.parametrize("suffix", [".las", ".laz", ".ply", ".pcd", ".csv", ".dat"])
def test_times_of_points_are_read_where_the_format_has_them(tmp_path, points, suffix):
    some, time_s = points[:400].round(4), 1000 + np.arange(400) / 8
    path = write_timed(tmp_path / f"a{suffix}", some, time_s)
    found = read_points(ScanFile(path.as_posix(), 1.0, "z", None, 0.001, timed=True))
    order = np.argsort(found.cloud.time_s)
    assert found.cloud.time_s[order] == pytest.approx(time_s)
    assert found.cloud.points_m[order] + found.origin == pytest.approx(some, abs=0.002)
    assert read_points(ScanFile(path.as_posix(), 1.0, "z", None, 0.001)).cloud.time_s.shape == (0,)


def test_a_pcd_file_whose_times_have_an_unknown_type_is_refused_by_name_where_they_are_wanted(tmp_path, points, walked):
    path, way = write_timed(tmp_path / "a.pcd", points, np.arange(len(points))), tmp_path / "way.txt"
    path.write_bytes(path.read_bytes().replace(b"TYPE F F F F", b"TYPE F F F 4"))
    way.write_text(walked[1])
    with pytest.raises(InputError, match=r"a\.pcd: its header states time as 1 numbers 4 of 8 bytes"):
        read(path, trajectory=way.as_posix())
    assert len(read(path).solid.scan_m)


@pytest.fixture(scope="module")
def walked(points):
    """Return the times of a drift's points, and the text of the trajectory along it: a metre a second."""
    rows = [f"{100 + x} {x} 2.0 1.3\n" for x in range(1, 14)]
    return 100 + np.clip(points[:, 0], 1, 13), "".join(rows)


def test_with_times_rays_start_where_the_scanner_was(tmp_path, points, walked):
    time_s, text = walked
    (tmp_path / "way.txt").write_text(text)
    way = (tmp_path / "way.txt").as_posix()
    rays = read(write_timed(tmp_path / "a.las", points, time_s), trajectory=way).solid.rays_m
    starts, ends = rays[:, 0], rays[:, 1]
    assert len(rays) > 3000
    assert starts[:, 0] == pytest.approx(np.clip(ends[:, 0], 1, 13), abs=0.1)  # the mean of a voxel, its first time
    assert np.ptp(starts[:, 1:], axis=0) == pytest.approx([0, 0], abs=1e-9)
    assert starts[0, 2] - ends[:, 2].min() == pytest.approx(1.3, abs=0.1)


@pytest.mark.parametrize("clock", ["of another day", "none"])
def test_clocks_that_differ_are_refused_with_both_ranges_and_without_a_clock_places_count(
    tmp_path, points, walked, clock
):
    time_s, text = walked
    way, path = tmp_path / "way.txt", write_timed(tmp_path / "a.las", points, time_s + 86_400)
    if clock == "none":
        way.write_text("".join(f"0 {line.partition(' ')[2]}\n" for line in text.splitlines()))
        rays = read(path, trajectory=way.as_posix()).solid.rays_m
        assert len(rays) > 3000
        assert np.abs(rays[:, 0, 0] - rays[:, 1, 0]).max() < 4  # at the ends a nearer place is not there
        return
    way.write_text(text)
    message = (
        r"a\.las: its points' times, 86501\.000 to 86513\.000 s, are not those of .*way\.txt, 101\.000 to 113\.000 s"
    )
    with pytest.raises(InputError, match=message + ": the clocks differ; .* time 0 in every row"):
        read(path, trajectory=way.as_posix())


def test_a_scan_that_encloses_nothing_is_refused_by_name(tmp_path):
    sheet = np.random.default_rng(0).uniform(0, 10, (5000, 3)) * [1, 1, 0]
    with pytest.raises(InputError, match=r"a\.xyz: its points bound no space of 5 m3: above and below"):
        read(write(tmp_path / "a.xyz", sheet))


def test_too_few_points_are_refused_by_name(tmp_path):
    path = write(tmp_path / "a.xyz", np.random.default_rng(0).uniform(0, 1, (20, 3)))
    with pytest.raises(InputError, match=r"a\.xyz: its points fill 20 voxels of 0\.1 m, at least 100"):
        read(path)


def test_a_unit_that_makes_a_scan_too_large_is_refused(tmp_path, points):
    with pytest.raises(InputError, match=r"a\.las: reaches .* m from its first points, beyond .*; --unit"):
        read(write(tmp_path / "a.las", points * 10_000))


def test_the_plan_shows_what_is_left_out_in_red_and_a_hole_in_blue(tmp_path, points):
    x, y = 4.0, 2.0
    person = noisy(sampled(manifold3d.Manifold.cube([0.5, 0.4, 1.7]).translate([x, y, 0]), 400))
    path = write(tmp_path / "a.las", np.concatenate([points[np.linalg.norm(points - [9, 2, 0], axis=1) > 1.0], person]))
    read_of = read_unlimited(PARAMS.model_copy(update={"file": path.as_posix()}))
    plan, frame = read_of.plan.astype(int), read_of.survey.frame
    row, col = (np.argwhere(plan[:, :, 2] - plan[:, :, 0] > 100).mean(axis=0)).tolist()
    assert frame.to_mine(np.array([[col, row]]))[0] == pytest.approx([x + 0.25, y + 0.2], abs=0.4)
    blue = np.argwhere(plan[:, :, 0] - plan[:, :, 2] > 100)[:, ::-1]
    assert frame.to_mine(blue.mean(axis=0)[None])[0] == pytest.approx([9, 2], abs=0.4)
