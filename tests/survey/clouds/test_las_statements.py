"""What LAS files state beside their coordinates: unit, axes, flags, limits. Files are written by laspy."""

import re
import struct
import zipfile
from pathlib import Path

import laspy
import numpy as np
import pyproj
import pytest

from minesurveys.remarks import collect_remarks
from pipeline.errors import InputError
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import CloudSurveyParams
from pipeline.survey.clouds.points import ScanFile, read_points
from pipeline.survey.clouds.read import read_scan
from pipeline.survey.detect import detect_survey
from tests.project import ROOT
from tests.survey.clouds.test_cloud_volume import drift, noisy, sampled

SHARED = ROOT.parent / "shared/data/turn4"
US_FOOT_M = 1200 / 3937
PLACE = {  # in each system's own unit, x and y as stored
    "EPSG:2272": (2_700_000.0, 250_000.0),
    "EPSG:32633": (500_000.0, 5_550_000.0),
    "EPSG:5513": (1_043_000.0, 743_000.0),
    "EPSG:2048": (-28_000.0, 3_431_000.0),
}
PARAMS = CloudSurveyParams(kind="cloud", name="a", file="data/x", heights=None)


@pytest.fixture(scope="module")
def points():
    return noisy(sampled(drift()))


def write(path, points, crs=None, keys=None, point_format=6, version="1.4", scale=0.0001, edit=None):
    """Write points in the file's unit, with a system as well-known text or as keys of GeoTIFF."""
    cloud = laspy.LasData(laspy.LasHeader(point_format=point_format, version=version))
    cloud.header.scales, cloud.header.offsets = [scale] * 3, np.floor(points.min(axis=0))
    cloud.x, cloud.y, cloud.z = points.T
    if crs is not None:
        cloud.header.add_crs(pyproj.CRS(crs), keep_compatibility=False)
    if keys is not None:
        rows = struct.pack("<4H", 1, 1, 0, len(keys)) + b"".join(struct.pack("<4H", key, 0, 1, v) for key, v in keys)
        cloud.header.vlrs.append(laspy.VLR("LASF_Projection", 34735, "", rows))
    if edit is not None:
        edit(cloud)
    cloud.write(str(path))
    return path


def found_in(path, **options):
    """Return the mean places of points, m, as they lie about the first of them, and the remarks."""
    with collect_remarks() as remarks:
        found = read_points(ScanFile(path.as_posix(), options.get("unit_m"), "z", None, 0.001))
    return found, [remark.line() for remark in remarks]


def require_same(found, wanted_m):
    """The extent and the moments of points are those of the points that were meant, m."""
    given = found.cloud.points_m
    assert np.ptp(given, axis=0) == pytest.approx(np.ptp(wanted_m, axis=0), abs=0.01)
    np.testing.assert_allclose(np.cov(given.T), np.cov(wanted_m.T), atol=0.05)


def stored(points, crs, plan_m, up_m):
    x, y = PLACE[crs]
    return np.column_stack([x + points[:, 0] / plan_m, y + points[:, 1] / plan_m, points[:, 2] / up_m])


@pytest.mark.parametrize(
    ("crs", "plan_m", "up_m"),
    [
        ("EPSG:2272", US_FOOT_M, US_FOOT_M),
        ("EPSG:2272+6360", US_FOOT_M, US_FOOT_M),
        ("EPSG:2272+5703", US_FOOT_M, 1.0),
        ("EPSG:32633+6360", 1.0, US_FOOT_M),
        ("EPSG:32633+5773", 1.0, 1.0),
        ("EPSG:32633+6357", 1.0, -1.0),
        ("EPSG:32633", 1.0, 1.0),
    ],
)
@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_the_text_of_a_system_states_the_unit_of_the_plan_and_of_heights(tmp_path, points, crs, plan_m, up_m, suffix):
    path = write(tmp_path / f"a{suffix}", stored(points, crs.split("+")[0], plan_m, up_m), crs)
    found, remarks = found_in(path)
    require_same(found, points)
    assert found.axes.crs == crs.split("+")[0]
    assert any("its coordinate system states the unit" in remark for remark in remarks)


@pytest.mark.parametrize(
    ("keys", "plan_m", "up_m"),
    [
        ([(1024, 1), (3072, 2272)], US_FOOT_M, US_FOOT_M),
        ([(1024, 1), (3072, 2272), (3076, 9003)], US_FOOT_M, US_FOOT_M),
        ([(1024, 1), (3072, 2272), (4096, 6360)], US_FOOT_M, US_FOOT_M),
        ([(1024, 1), (3072, 2272), (4096, 5703)], US_FOOT_M, 1.0),
        ([(1024, 1), (3072, 2272), (4099, 9001)], US_FOOT_M, 1.0),
        ([(1024, 1), (3072, 32633), (4099, 9003)], 1.0, US_FOOT_M),
        ([(1024, 1), (3072, 2272), (4096, 5103), (4099, 9003)], US_FOOT_M, US_FOOT_M),  # a datum's code, as often
        ([(1024, 1), (3076, 9002)], 0.3048, 0.3048),
        ([(1024, 1), (3072, 32633)], 1.0, 1.0),
    ],
)
def test_the_keys_of_old_records_state_units_too(tmp_path, points, keys, plan_m, up_m):
    code = dict(keys).get(3072, 2272)
    path = write(tmp_path / "a.las", stored(points, f"EPSG:{code}", plan_m, up_m), None, keys, 1, "1.2")
    found, _ = found_in(path)
    require_same(found, points)
    assert found.axes.is_stated


def test_of_both_records_the_one_that_the_flag_names_counts(tmp_path, points):
    metric = [(1024, 1), (3072, 32633)]
    path = write(tmp_path / "a.las", stored(points, "EPSG:2272", US_FOOT_M, US_FOOT_M), "EPSG:2272", metric)
    require_same(found_in(path)[0], points)


@pytest.mark.parametrize("crs", ["EPSG:5513", "EPSG:2048"])
def test_a_scan_in_a_system_that_points_south_and_west_is_not_mirrored(tmp_path, points, crs):
    east, north, up = points.T
    x, y = PLACE[crs]
    xy = [x - north, y - east] if crs == "EPSG:5513" else [x - east, y - north]
    found, remarks = found_in(write(tmp_path / "a.las", np.column_stack([*xy, up]), crs))
    require_same(found, points)
    assert any("do not point east and north" in remark for remark in remarks)


def test_a_stated_unit_overrules_the_systems(tmp_path, points):
    path = write(tmp_path / "a.las", np.add(points, [*PLACE["EPSG:2272"], 0]), "EPSG:2272")
    require_same(found_in(path, unit_m=1.0)[0], points)


def test_a_file_without_a_system_states_no_unit_and_is_in_metres(tmp_path, points):
    found, remarks = found_in(write(tmp_path / "a.las", points))
    require_same(found, points)
    assert not found.axes.is_stated
    assert not remarks


@pytest.mark.skipif(not SHARED.is_dir(), reason=f"no {SHARED}")
def test_feet_of_the_shared_scan_are_listed_and_its_size_is_right():
    with collect_remarks() as remarks:
        detect_survey(SHARED / "feet-by-crs.las", StatedOptions())
        scan = read_points(ScanFile((SHARED / "feet-by-crs.las").as_posix(), None, "z", None, 0.01))
    lines = [remark.line() for remark in remarks]
    assert not any("states no unit;" in line for line in lines)
    assert np.ptp(scan.cloud.points_m, axis=0)[:2] == pytest.approx([22.0, 18.7], abs=0.05)


def test_a_scan_in_feet_becomes_a_world_in_metres(tmp_path, points):
    path = write(tmp_path / "a.las", stored(points, "EPSG:2272", US_FOOT_M, US_FOOT_M), "EPSG:2272")
    found = read_scan(PARAMS.model_copy(update={"file": path.as_posix()}))
    west, south, east, north = found.workings.bounds
    assert (east - west, north - south) == pytest.approx((14, 4), abs=0.3)  # voxels of 10 cm on either side
    assert found.georeference.metres_per_unit == pytest.approx(US_FOOT_M)


def test_degrees_and_stretched_maps_are_refused_until_the_advised_zone_is_used(tmp_path, points):
    utm = pyproj.CRS("EPSG:32633")
    meant = np.add(points, [*PLACE["EPSG:32633"], 0])
    for crs, text in (("EPSG:4326", "are in degrees"), ("EPSG:3857", "1.55"), ("EPSG:4978", "the Earth's centre")):
        vertical = "EPSG:4979" if crs == "EPSG:4978" else utm
        source = pyproj.Transformer.from_crs(utm, vertical, always_xy=True)
        xyz = np.column_stack(source.transform(*meant.T))
        xyz = np.column_stack(pyproj.Transformer.from_crs(vertical, crs, always_xy=True).transform(*xyz.T))
        path = write(tmp_path / "a.las", xyz, crs, scale=1e-8 if crs == "EPSG:4326" else 1e-4)
        with pytest.raises(InputError, match=text) as refused:
            found_in(path)
        advised = re.search(r"EPSG:\d+", str(refused.value).split("transform it")[-1].split("transform them")[-1])[0]
        assert advised == "EPSG:32633"
    require_same(found_in(write(tmp_path / "utm.las", meant, advised))[0], points)


@pytest.mark.parametrize(("point_format", "version"), [(1, "1.2"), (6, "1.4")])
def test_points_flagged_withheld_or_classed_as_noise_are_left_out_and_counted(tmp_path, points, point_format, version):
    stray = np.array([[7.0, 2.0, 1.0 + k] for k in range(30)])

    def mark(cloud):
        cloud.withheld[-30:-10] = 1
        cloud.classification[-10:] = 7
        cloud.synthetic[:5] = 1

    path = write(tmp_path / "a.las", np.vstack([points, stray]), point_format=point_format, version=version, edit=mark)
    found, remarks = found_in(path)
    require_same(found, points)
    assert found.cloud.total == len(points)
    assert any("20 flagged withheld and 10 low noise (class 7) of" in remark for remark in remarks)
    assert any("points flagged 5 synthetic are read as the others" in remark for remark in remarks)


def test_a_file_all_of_whose_points_are_withheld_is_refused_with_that_reason(tmp_path, points):
    def mark(cloud):
        cloud.withheld[:] = 1

    with pytest.raises(InputError, match=r"all of its points are left out: \d+ flagged withheld; clear the flags"):
        found_in(write(tmp_path / "a.las", points, edit=mark))


def test_coordinates_clamped_at_the_limit_of_a_record_are_refused_until_the_advice_is_followed(tmp_path, points):
    meant = np.add(points, [*PLACE["EPSG:32633"], 0])
    raw = np.clip(np.round(meant / 0.001), -(2.0**31), 2.0**31 - 1)

    def clamp(cloud):
        cloud.X, cloud.Y, cloud.Z = raw.astype(np.int32).T

    path = write(tmp_path / "a.las", points - points.min(axis=0), scale=0.001, edit=clamp)
    with pytest.raises(InputError, match=r"100 % of its Y are 2147483647.*an offset near the workings"):
        found_in(path)
    require_same(found_in(write(tmp_path / "b.las", meant, scale=0.001))[0], points)


@pytest.mark.skipif(not SHARED.is_dir(), reason=f"no {SHARED}")
def test_the_shared_clamped_scan_is_refused_with_its_share():
    with pytest.raises(InputError, match=r"25 % of its Y are 2147483647"):
        detect_survey(SHARED / "clipped-int32.las")


def test_coarse_scale_factors_are_listed_and_none_are_refused(tmp_path, points):
    _, remarks = found_in(write(tmp_path / "a.las", points, scale=0.05))
    assert any("its coordinates come in steps of 0.05 m" in remark for remark in remarks)
    data = bytearray((path := write(tmp_path / "b.las", points)).read_bytes())
    data[131:139] = struct.pack("<d", 0.0)  # the scale factor of x (LAS 1.4, table 3)
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"b\.las: its header states the scale factors \[0\.0, .*expected numbers"):
        found_in(path)


def test_clouds_of_one_zip_file_in_two_units_are_refused_and_in_one_are_read(tmp_path, points):
    feet = write(tmp_path / "feet.las", stored(points, "EPSG:2272", US_FOOT_M, US_FOOT_M), "EPSG:2272")
    more = write(tmp_path / "more.las", stored(points, "EPSG:2272", US_FOOT_M, US_FOOT_M), "EPSG:2272", scale=0.001)
    bare = write(tmp_path / "bare.las", np.add(points, [*PLACE["EPSG:2272"], 0]))
    for names, is_read in (((feet, more), True), ((feet, bare), False)):
        with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
            for name in names:
                archive.write(name, Path(name).name)
        if is_read:
            require_same(found_in(tmp_path / "a.zip")[0], points)
        else:
            with pytest.raises(InputError, match="its clouds state different coordinate systems or units"):
                found_in(tmp_path / "a.zip")


def test_unknown_records_and_extra_bytes_change_nothing(tmp_path, points):
    def add(cloud):
        cloud.header.vlrs.append(laspy.VLR("somebody", 7, "", b"feet feet feet"))
        cloud.add_extra_dim(laspy.ExtraBytesParams("height", "f8"))
        cloud["height"] = np.full(len(cloud), 5.0)

    found, remarks = found_in(write(tmp_path / "a.las", points, edit=add))
    require_same(found, points)
    assert not remarks
