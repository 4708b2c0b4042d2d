"""Point clouds as tables with names, in zip files and in E57 files."""

import zipfile

import numpy as np
import pytest

from minesurveys.clouds import zipped_clouds
from minesurveys.clouds.text_clouds import has_point_rows
from minesurveys.limits import reader_limits
from pipeline.errors import InputError
from tests.scans.test_cloud import read

POINTS = np.random.default_rng(0).uniform(-5, 5, (200, 3)).round(3)


def rows(mark=" ", points=POINTS):
    return "".join(mark.join(f"{value:.3f}" for value in point) + "\n" for point in points)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.csv", "x,y,z\n" + rows(",")),
        ("a.csv", '"X";"Y";"Z"\n' + rows(";")),
        ("a.csv", rows(", ")),
        ("a.csv", rows(";").replace(".", ",")),
        ("a.csv", "x;y;z\n" + rows("; ").replace(".", ",")),
        ("a.txt", rows("\t").replace(".", ",")),
        ("a.txt", rows(",\t")),
        ("a.txt", "//X Y Z\n" + rows()),
        ("a.txt", "# a scan\n" + rows("\t")),
        ("a.pts", "200\n" + rows()),
        ("a.asc", rows()),
        ("a.xyz", "\n".join(f"{line} 255 0 17" for line in rows().splitlines())),
    ],
)
def test_points_of_a_table_are_those_that_were_written_whatever_separates_them(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    assert read(tmp_path / name) == pytest.approx(POINTS)


def test_columns_are_found_by_their_names(tmp_path):
    text = "".join(f"{k},{n},{e},7,{z}\n" for k, (e, n, z) in enumerate(POINTS.tolist()))
    (tmp_path / "a.csv").write_text("time,Northing,Easting,intensity,Elevation\n" + text)
    assert read(tmp_path / "a.csv") == pytest.approx(POINTS)


def test_a_table_of_stations_is_no_table_of_points(tmp_path):
    for name, text, expected in (
        ("s.csv", "leg,station,easting_m,northing_m,elevation_m\nA,1,0,0,0\n", False),
        ("p.csv", "x,y,z\n1,2,3\n", True),
        ("n.csv", "1,2,3\n", True),
        ("w.csv", "a,b,c\n1,2,3\n", False),
    ):
        (tmp_path / name).write_text(text)
        assert has_point_rows(tmp_path / name) is expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("east of here\n1 2 3\n", r"a\.txt:1: 'east of here' is no row of numbers, and does not name x, y and z"),
        ("adit   (m, 360)\n\n[1]: 2017/08/04\n", r"a\.txt: shots that PocketTopo exports, .*: give the \.th$"),
        ("x y z\n1 2 3\n1 2\n", r"a\.txt:3: 2 columns, at least 3 are needed"),
        ("1,5 2,5 3,5\n4 5 6\n", r"a\.txt:1: '5 2' is not a number"),
        ("1,5;2,5;3,5\n4;5;6,x\n", r"a\.txt:2: '6.x' is not a number"),
        ("x,y,z\n1,2,inf\n0,0,0\n", r"a\.txt: none of its 2 points was measured: 1 are NaN, 1 lie at 0 0 0"),
    ],
)
def test_a_row_that_is_no_point_is_refused_by_its_line(tmp_path, text, message):
    (tmp_path / "a.txt").write_text(text)
    with pytest.raises(InputError, match=message):
        read(tmp_path / "a.txt")


def zipped(path, members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in members.items():
            archive.writestr(name, text)
    return path


def test_the_clouds_of_a_zip_file_are_joined_and_other_files_left_out(tmp_path):
    members = {
        "scan/1.xyz": rows(points=POINTS[:100]),
        "../../2.csv": "x,y,z\n" + rows(",", POINTS[100:]),
        "__MACOSX/scan/1.xyz": "no points",
        "readme.md": "no points",
    }
    assert read(zipped(tmp_path / "a.zip", members)) == pytest.approx(POINTS)
    assert [path.name for path in tmp_path.parent.rglob("2.csv")] == []


def test_an_error_in_a_zipped_cloud_names_both(tmp_path):
    path = zipped(tmp_path / "a.zip", {"scan/1.xyz": "1 2 3\n1 2\n"})
    with pytest.raises(InputError, match=r"a\.zip: scan/1\.xyz:2: 2 columns"):
        read(path)


def test_a_zip_file_without_a_cloud_or_with_too_much_is_refused(tmp_path, monkeypatch):
    with pytest.raises(InputError, match=r"a\.zip: no point cloud in it \(.*\); it holds plan\.pdf"):
        read(zipped(tmp_path / "a.zip", {"plan.pdf": "x"}))
    small = reader_limits().model_copy(update={"unpacked_bytes": 100})
    monkeypatch.setattr(zipped_clouds, "reader_limits", lambda: small)
    with pytest.raises(InputError, match=r"b\.zip: its clouds are [\d,]+ bytes; the limit is 100"):
        read(zipped(tmp_path / "b.zip", {"a.xyz": rows()}))


def test_a_broken_zip_file_is_refused_by_name(tmp_path):
    path = zipped(tmp_path / "a.zip", {"a.xyz": rows()})
    data = bytearray(path.read_bytes())
    data[60:200] = bytes(140)
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"a\.zip: "):
        read(path)
    path.write_bytes(data[:300])
    with pytest.raises(InputError, match=r"a\.zip: cannot be read as a zip file"):
        read(path)


def test_the_scans_of_an_e57_file_are_joined_in_its_frame(tmp_path):
    pye57 = pytest.importorskip("pye57", reason="pye57 is not installed (extra `e57`)")
    file = pye57.E57(str(tmp_path / "a.e57"), mode="w")
    for some, shift in ((POINTS[:100], (0, 0, 0)), (POINTS[100:], (10, 0, 0))):
        columns = {f"cartesian{axis}": some[:, k] for k, axis in enumerate("XYZ")}
        file.write_scan_raw(columns, rotation=np.array([1.0, 0, 0, 0]), translation=np.array(shift, float))
    file.close()
    assert read(tmp_path / "a.e57") == pytest.approx(POINTS + np.repeat([[0, 0, 0], [10, 0, 0]], 100, axis=0))
    (tmp_path / "b.e57").write_bytes((tmp_path / "a.e57").read_bytes()[:2000])
    with pytest.raises(InputError, match=r"b\.e57: cannot be read as E57; it is broken or cut off"):
        read(tmp_path / "b.e57")


def test_points_of_an_e57_file_that_are_stated_as_invalid_or_lie_at_the_scanner_are_left_out(tmp_path, capsys):
    pye57 = pytest.importorskip("pye57", reason="pye57 is not installed (extra `e57`)")
    rows = np.concatenate([POINTS, np.full((7, 3), 99.0), np.zeros((5, 3))])
    columns = {f"cartesian{axis}": rows[:, k] for k, axis in enumerate("XYZ")}
    columns["cartesianInvalidState"] = np.repeat([0, 2, 0], [200, 7, 5]).astype(np.int8)
    quarter = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    file = pye57.E57(str(tmp_path / "a.e57"), mode="w")
    file.write_scan_raw(columns, rotation=quarter, translation=np.array([1000.0, 2000, 30]))
    file.close()
    assert read(tmp_path / "a.e57") == pytest.approx(POINTS[:, [1, 0, 2]] * [-1, 1, 1] + [1000, 2000, 30])
    said = capsys.readouterr().err
    assert "a.e57: 7 points that the file states as invalid are left out" in said
    assert "a.e57: 5 of 205 points lie at 0 0 0" in said


def test_without_its_reader_an_e57_file_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pye57", None)
    (tmp_path / "a.e57").write_bytes(b"ASTM-E57")
    with pytest.raises(InputError, match=r"a\.e57: E57 is read by pye57: pip install 'minexplore-pipeline\[e57\]'"):
        read(tmp_path / "a.e57")
