"""Points that were not measured, counts of several scans, viewpoints, and coordinates that are too coarse."""

import numpy as np
import pytest

from minesurveys.coordinates.precision import require_fine, steps_of_floats, steps_seen
from pipeline.errors import InputError
from pipeline.geometry.ray_scene import load_open3d
from pipeline.survey.clouds.points import ScanFile, read_here
from tests.project import shared_file
from tests.scans.test_cloud import read, write_open3d

POINTS = np.random.default_rng(0).uniform(-5, 5, (200, 3)).round(3)
GRID = np.array([456_780.0, 5_712_340.0, 400.0])


def as_scan(path, points, text="%.3f", unit_m=1.0):
    """Read points as a scan, thinned to 1 mm."""
    np.savetxt(path, points, fmt=text) if path.suffix == ".xyz" else write_open3d(path, points)
    return read_here(vars(ScanFile(path.as_posix(), unit_m, "z", None, 0.001)))


@pytest.mark.parametrize(
    ("name", "how"),
    [
        ("a.pcd", {}),
        ("a.pcd", {"write_ascii": True}),
        ("a.pcd", {"compressed": True}),
        ("a.ply", {}),
        ("a.ply", {"write_ascii": True}),
        ("a.xyz", {}),
    ],
)
def test_points_that_are_nan_or_lie_at_0_0_0_are_left_out_and_counted(tmp_path, capsys, name, how):
    rows = np.concatenate([np.full((7, 3), np.nan), POINTS[:100], np.zeros((5, 3)), POINTS[100:]])
    write_open3d(tmp_path / name, rows, **how)
    assert read(tmp_path / name) == pytest.approx(POINTS, abs=1e-5)
    said = capsys.readouterr().err
    assert f"{name}: 7 of 212 points are no finite numbers (NaN), as scanners write missed points; left out" in said
    assert f"{name}: 5 of 212 points lie at 0 0 0, as scanners write missed points; left out" in said


def test_a_cloud_that_another_made_is_read_without_its_200_nan():
    found = read(shared_file("nan-points.pcd"))
    assert len(found) == 9800
    assert np.isfinite(found).all()


def test_an_organised_cloud_has_width_times_height_points(tmp_path):
    write_open3d(tmp_path / "a.pcd", POINTS)
    data = (tmp_path / "a.pcd").read_bytes().replace(b"WIDTH 200\nHEIGHT 1\n", b"WIDTH 20\nHEIGHT 10\n")
    assert b"HEIGHT 10" in data
    (tmp_path / "a.pcd").write_bytes(data)
    open3d = load_open3d()
    assert read(tmp_path / "a.pcd") == pytest.approx(
        np.asarray(open3d.io.read_point_cloud(str(tmp_path / "a.pcd")).points)
    )


def test_a_viewpoint_is_named_and_moves_no_point_as_in_open3d(tmp_path, capsys):
    write_open3d(tmp_path / "a.pcd", POINTS)
    plain, turned = b"VIEWPOINT 0 0 0 1 0 0 0", b"VIEWPOINT 100 20 3 0.7071 0 0 0.7071"
    read(tmp_path / "a.pcd")
    assert capsys.readouterr().err == ""
    (tmp_path / "a.pcd").write_bytes((tmp_path / "a.pcd").read_bytes().replace(plain, turned))
    open3d = load_open3d()
    assert read(tmp_path / "a.pcd") == pytest.approx(
        np.asarray(open3d.io.read_point_cloud(str(tmp_path / "a.pcd")).points)
    )
    assert "a.pcd: states the VIEWPOINT 100 20 3 0.7071 0 0 0.7071, the scanner's place and turn; it moves no" in (
        capsys.readouterr().err
    )


def pts(*scans):
    rows = (f"{len(scan)}\n" + "".join(f"{x:.3f} {y:.3f} {z:.3f} 12 9 8 7\n" for x, y, z in scan) for scan in scans)
    return "".join(rows)


@pytest.mark.parametrize("block", [7, 1_000_000])
def test_a_pts_file_of_several_scans_has_a_count_above_each(tmp_path, monkeypatch, capsys, block):
    monkeypatch.setattr("minesurveys.clouds.text_clouds._BLOCK", block)
    (tmp_path / "a.pts").write_text(pts(POINTS[:50], POINTS[50:50], POINTS[50:180], POINTS[180:]))
    assert read(tmp_path / "a.pts") == pytest.approx(POINTS)
    assert capsys.readouterr().err == ""


def test_a_pts_file_of_other_points_than_its_counts_state_is_named(tmp_path, capsys):
    (tmp_path / "a.pts").write_text(pts(POINTS[:50], POINTS[50:]).rsplit("\n", 11)[0] + "\n")
    assert len(read(tmp_path / "a.pts")) == 190
    assert "a.pts: 190 points, but the counts above its 2 scans state 200" in capsys.readouterr().err


def test_a_pts_row_that_is_no_point_is_refused_by_its_line_below_the_second_count(tmp_path):
    (tmp_path / "a.pts").write_text(pts(POINTS[:2], POINTS[2:4]) + "1 2 x 3 4 5 6\n")
    with pytest.raises(InputError, match=r"a\.pts:7: 'x' is not a number"):
        read(tmp_path / "a.pts")


def test_zeros_among_points_of_a_national_grid_are_left_out_and_not_taken_for_a_unit(tmp_path, capsys):
    found = as_scan(tmp_path / "a.xyz", np.concatenate([np.zeros((9, 3)), POINTS + GRID]))
    assert found.values["total"] == 200
    assert "9 of 209 points lie at 0 0 0" in capsys.readouterr().err


def test_a_few_points_far_from_all_others_are_named_and_not_taken_for_a_unit(tmp_path):
    points = np.concatenate([POINTS + GRID, [[1.5, 2.5, 3.5]]])
    with pytest.raises(
        InputError,
        match=r"1 of 201 points lie more than 10000 from the others, the first at \(1\.5, 2\.5, 3\.5\), the others "
        r"about \(45678\d, 571234\d, 400\); cut them off, or --unit states",
    ):
        as_scan(tmp_path / "a.xyz", points)
    assert as_scan(tmp_path / "a.xyz", points[:-1]).values["total"] == 200  # as the refusal says


def test_half_of_the_points_far_from_the_others_are_no_unit_either(tmp_path):
    points = np.concatenate([POINTS + GRID, POINTS])
    with pytest.raises(InputError, match=r"200 of 400 points lie more than 10000 from the others, .*; cut them off"):
        as_scan(tmp_path / "a.xyz", points)
    in_mm = np.concatenate([1000.0 * POINTS, 1000.0 * POINTS + [30_000, 0, 0]])
    assert as_scan(tmp_path / "a.xyz", in_mm, unit_m=0.001).values["total"] == 400


@pytest.mark.parametrize("how", [{}, {"compressed": True}])
def test_a_cloud_of_32_bits_in_map_coordinates_is_refused_and_read_with_a_local_origin(tmp_path, how):
    path = tmp_path / "a.pcd"
    write_open3d(path, POINTS + GRID, **how)
    with pytest.raises(
        InputError,
        match=r"a\.pcd: its y coordinates come in steps of 0\.5 m, .*; at most 0\.01 m is read: export it with a local",
    ):
        read_here(vars(ScanFile(path.as_posix(), 1.0, "z", None, 0.001)))
    assert as_scan(path, POINTS).values["total"] == 200  # as the refusal says


def test_a_cloud_that_states_32_bits_and_is_written_as_a_finer_text_is_read(tmp_path):
    write_open3d(tmp_path / "a.pcd", POINTS + GRID, write_ascii=True)  # 10 digits
    found = read_here(vars(ScanFile((tmp_path / "a.pcd").as_posix(), 1.0, "z", None, 0.001)))
    assert found.values["total"] == 200


def test_a_cloud_of_32_bits_near_enough_is_read_with_a_remark_on_its_steps(tmp_path, capsys):
    as_scan(tmp_path / "a.pcd", POINTS + np.array([100_100, 20, 0]))
    assert "a.pcd: its x coordinates come in steps of 0.0078 m" in capsys.readouterr().err


@pytest.mark.parametrize(("text", "step"), [("%.8g", "0.1"), ("%.7g", "1"), ("%.6g", "10")])
def test_a_text_whose_last_digits_are_cut_off_is_refused_by_its_steps(tmp_path, text, step):
    points = POINTS * [3, 30, 1] + GRID
    with pytest.raises(InputError, match=rf"its y coordinates come in steps of {step} m"):
        as_scan(tmp_path / "a.xyz", points, text)
    assert as_scan(tmp_path / "a.xyz", points, "%.12g").values["total"] == 200


def test_points_on_a_grid_and_points_of_millimetres_are_as_fine_as_they_are_written():
    assert steps_seen(POINTS + GRID).tolist() == [0, 0, 0]
    assert steps_seen(np.rint(POINTS * 2) / 2 + GRID).tolist() == [0, 0, 0]
    assert steps_seen(np.rint(POINTS * 2) / 2).tolist() == [0, 0, 0]
    assert steps_of_floats(np.array([[1.0, 16_777_217.0, 0.1]]))[:2].tolist() == [2**-23, 2.0]


def test_steps_below_a_millimetre_need_no_remark(tmp_path, capsys):
    require_fine(tmp_path / "a.stl", np.array([0.0009, 0.0, 0.0]))
    assert capsys.readouterr().err == ""
    with pytest.raises(InputError, match=r"steps of 0\.011 m"):
        require_fine(tmp_path / "a.stl", np.array([0.0, 0.0, 0.011]))
