"""Scan patterns against the figures of their data sheets."""

import json
from pathlib import Path

import numpy as np
import pytest

import minexplore
from minexplore.sensing.scanners.pattern_files import load_pattern, parse_pattern, pattern_names


def angles(rays):
    directions = rays.directions.astype(float)
    return np.degrees(np.arctan2(directions[:, 1], directions[:, 0])), np.degrees(np.arcsin(directions[:, 2]))


@pytest.mark.parametrize(
    ("name", "points_per_s", "low_deg", "high_deg"),
    [("vlp-16", 300_000, -15, 15), ("os1-64", 655_360, -16.6, 16.6), ("mid-360", 200_000, -7, 52)],
)
def test_a_scan_has_the_rate_and_the_field_of_its_data_sheet(name, points_per_s, low_deg, high_deg):
    pattern = load_pattern(name)
    rays = pattern.scan()
    assert len(rays.time_s) == pattern.rays
    assert pattern.rays / pattern.period_s == pytest.approx(points_per_s, rel=0.04)
    azimuth, elevation = angles(rays)
    assert elevation.min() == pytest.approx(low_deg, abs=0.1)
    assert elevation.max() == pytest.approx(high_deg, abs=0.1)
    assert np.diff(np.sort(azimuth)).max() < 1.0  # all round
    assert np.allclose(np.linalg.norm(rays.directions, axis=1), 1, atol=1e-6)
    assert (rays.time_s >= 0).all()
    assert rays.time_s.max() <= pattern.period_s


def test_the_riegl_fires_122_thousand_pulses_a_second_over_100_degrees_and_is_not_cheap():
    pattern = load_pattern("vz-400")
    lines, columns = pattern.about["lines"], pattern.about["columns"]
    assert lines * columns / pattern.period_s == pytest.approx(122_000, rel=0.01)
    assert max(pattern.elevations_deg) - min(pattern.elevations_deg) == 100


def test_the_ousters_beams_are_those_of_the_makers_software():
    # Elevations from 16.611 deg down in steps of one and a half columns; azimuths in steps of six columns.
    pattern = load_pattern("os1-64")
    column_deg = 360 / pattern.about["columns"]
    np.testing.assert_allclose(pattern.elevations_deg, 16.611 - 1.5 * column_deg * np.arange(64), atol=2e-3)
    azimuths = np.reshape(pattern.about["azimuths_deg"], (16, 4))
    np.testing.assert_allclose(azimuths, np.tile(azimuths[0], (16, 1)))
    np.testing.assert_allclose(np.diff(azimuths), -6 * column_deg, atol=2e-3)


def test_the_rosette_turns_fast_and_covers_its_field_as_a_measured_unit_does():
    # One unit: 1.303 deg a firing of four lines; of the cells of 1 deg 61.9 % in a frame and 97.6 % in ten.
    pattern = load_pattern("mid-360")
    azimuth, _ = angles(pattern.scan())
    steps = np.diff(azimuth.reshape(-1, 4).mean(axis=1)) % 360
    assert np.median(steps) == pytest.approx(1.303, abs=0.01)
    seen = np.zeros((360, 59), dtype=bool)
    covered = []
    for number in range(10):
        azimuth, elevation = angles(pattern.scan(number))
        rows = np.clip(np.floor(elevation + 7), 0, 58).astype(int)
        seen[np.floor(azimuth % 360).astype(int) % 360, rows] = True
        covered.append(seen.mean())
    assert covered[0] == pytest.approx(0.619, abs=0.03)
    assert covered[-1] == pytest.approx(0.976, abs=0.01)


def test_rings_are_numbered_from_the_lowest_channel():
    rays = load_pattern("vlp-16").scan()
    _, elevation = angles(rays)
    for ring in range(16):
        assert np.allclose(elevation[rays.ring == ring], -15 + 2 * ring, atol=0.01)


def test_a_rosette_does_not_repeat_and_the_others_do():
    rosette, spinning = load_pattern("mid-360"), load_pattern("os1-64")
    one, two = (rosette.scan(number).directions for number in (0, 1))
    assert np.abs(one - two).max() > 0.1
    assert spinning.scan(0) is spinning.scan(1)


def test_every_pattern_names_its_source():
    for name in pattern_names():
        assert "data sheet" in load_pattern(name).source


def test_a_pattern_of_a_users_own_file_scans_as_the_one_that_ships(tmp_path):
    shipped = Path(minexplore.__file__).parent / "sensing/scanners/patterns/vlp-16.json"
    record = json.loads(shipped.read_text()) | {"columns": 90, "rate_hz": 20.0}
    (tmp_path / "own.json").write_text(json.dumps(record))
    own = load_pattern(tmp_path / "own.json")
    assert (own.name, own.rays, len(own.scan().time_s)) == ("own", 90 * 16, 90 * 16)
    assert own.scan().time_s.max() == pytest.approx(1 / 20, rel=0.02)
    np.testing.assert_allclose(own.scan().directions[:16], load_pattern("vlp-16").scan().directions[:16])


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("rate_hz", 0, "LiDAR own: rate_hz = 0: want a number from 0.0001 to 1,000,000"),
        ("rate_hz", "10", "LiDAR own: rate_hz = '10': want a number"),
        ("range_m", [-1, 5], r"LiDAR own: range_m = \[-1, 5\]: want a list of 2, each a number from 0"),
        ("range_m", [5, 1], r"LiDAR own: range_m = \(5, 1\): want 0 < near < far"),
        ("range_m", 7, "LiDAR own: range_m = 7: want a list of 2"),
        ("noise_m", -0.1, "LiDAR own: noise_m = -0.1: want a number from 0"),
        ("range_at_ten_percent_m", None, "LiDAR own: range_at_ten_percent_m = None: want a number"),
        ("columns", 1.5, "LiDAR own: columns = 1.5: want a whole number from 1"),
        ("columns", 20_000_000, "LiDAR own: 320,000,000 rays a scan: want 1 to 20,000,000"),
        ("elevations_deg", [], r"LiDAR own: elevations_deg = \[\]: want a list of one or more"),
        ("firing_s", [0.0], r"LiDAR own: firing_s = \[0.0\]: want a list of 16, each a number from 0"),
        ("azimuths_deg", ["a"] * 16, "LiDAR own: azimuths_deg = .*: want a list of 16"),
    ],
)
def test_a_field_of_a_pattern_beyond_its_limit_is_refused_in_one_line(field, value, words):
    shipped = Path(minexplore.__file__).parent / "sensing/scanners/patterns/vlp-16.json"
    with pytest.raises(ValueError, match=words) as refused:
        parse_pattern("own", json.loads(shipped.read_text()) | {field: value})
    assert "\n" not in str(refused.value)


def test_bad_patterns_are_refused_in_one_line(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"LiDAR = 'none\.json': no such file"):
        load_pattern("none.json")
    (tmp_path / "own.json").write_text("[")
    with pytest.raises(ValueError, match=r"own\.json: not JSON from line 1"):
        load_pattern(tmp_path / "own.json")
    rosette = json.loads((Path(minexplore.__file__).parent / "sensing/scanners/patterns/mid-360.json").read_text())
    with pytest.raises(ValueError, match=r"LiDAR own: fan_deg = \[\[1\]\]: want a list of pairs"):
        parse_pattern("own", rosette | {"fan_deg": [[1]]})
    with pytest.raises(ValueError, match=r"LiDAR = 'vlp-17': valid choices are mid-360, os1-64, vlp-16, vz-400"):
        load_pattern("vlp-17")
    with pytest.raises(ValueError, match="own: kind = None: valid choices are spinning"):
        parse_pattern("own", {})
    with pytest.raises(ValueError, match="own: azimuths_deg: missing or unknown"):
        parse_pattern("own", {"kind": "spinning"})
