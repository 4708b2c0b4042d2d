"""Coordinates follow the axes that their system states: direction and unit, of the plan and of heights apart.

Files are written by pyogrio (GDAL), and the right places are PROJ's.
"""

import re

import numpy as np
import pyproj
import pytest
import rasterio
import shapely
from rasterio.transform import Affine

from minesurveys.coordinates.ground import ground_scale, is_true_to_scale
from minesurveys.coordinates.map_axes import axes_of, metres_of_unit
from minesurveys.pictures.georeference import find_placement
from minesurveys.remarks import collect_remarks
from minesurveys.vector.geodata import read_geodata
from minesurveys.vector.geojson import read_geojson
from minesurveys.vector.shapes import locate, with_heights
from pipeline.errors import InputError
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import CentrelineSurveyParams
from pipeline.survey.detect import detect_survey
from pipeline.survey.vector_survey import read_vector_survey
from tests.mines import TEE
from tests.survey.shape_files import write_shapes

PRAGUE, KAROO, SAN_DIEGO, PARIS = (14.4, 50.1), (19.3, -31.0), (-116.9, 32.8), (2.6, 48.7)
US_FOOT_M = 1200 / 3937


def laid(shape, place, crs):
    """Return a shape in metres, laid at longitude and latitude in the coordinates of a system."""
    to_map = pyproj.Transformer.from_crs(pyproj.CRS(crs).geodetic_crs, crs, always_xy=True)
    east, north = to_map.transform(*place)
    return shapely.transform(shape, lambda p: np.column_stack([east + p[:, 0], north + p[:, 1]]))


def moved_to(shape, system, other):
    transform = pyproj.Transformer.from_crs(system, other, always_xy=True)
    return shapely.transform(shape, lambda p: np.column_stack(transform.transform(*p.T)))


@pytest.mark.parametrize(
    ("crs", "same", "place", "told"),
    [
        ("EPSG:5513", "EPSG:5514", PRAGUE, "east is -y, north is -x"),
        ("EPSG:2065", "EPSG:5221", PRAGUE, "east is -y, north is -x"),
        ("EPSG:2048", "+proj=tmerc +lon_0=19 +ellps=WGS84 +units=m", KAROO, "east is -x, north is -y"),
        ("EPSG:3031", "EPSG:3031", (40, -71), ""),
        ("EPSG:2193", "EPSG:2193", (175, -38), ""),
        ("EPSG:32661", "EPSG:32661", (40, 81.1), ""),
    ],
)
def test_a_mine_in_a_system_whose_axes_point_south_and_west_is_not_mirrored(tmp_path, crs, same, place, told):
    wanted = laid(TEE, place, same)
    path = write_shapes(tmp_path / "mine.gpkg", [moved_to(wanted, same, crs) if told else wanted], crs)
    with collect_remarks() as remarks:
        (found,), georeference = locate(path, read_geodata(path, None), None, None)
    there = shapely.transform(found, lambda p: p + georeference.origin)
    assert there.hausdorff_distance(wanted) < 0.01
    assert not told or any(told in remark.line() for remark in remarks)
    assert told or not any("axes" in remark.line() for remark in remarks)


@pytest.mark.parametrize("suffix", [".gpkg", ".shp", ".geojson"])
def test_every_format_with_a_system_that_points_south_and_west_is_read_by_its_axes(tmp_path, suffix):
    wanted = laid(TEE, PRAGUE, "EPSG:5514")
    path = write_shapes(tmp_path / f"mine{suffix}", [moved_to(wanted, "EPSG:5514", "EPSG:5513")], "EPSG:5513")
    read = read_geojson if suffix == ".geojson" else read_geodata
    (found,), georeference = locate(path, read(path, None), None, None)
    assert shapely.transform(found, lambda p: p + georeference.origin).hausdorff_distance(wanted) < 0.01


def test_a_picture_in_a_system_that_points_south_and_west_is_not_called_mirrored(tmp_path):
    """Columns go east and rows south; PROJ's x is southing, y is westing."""
    path, cell = tmp_path / "plan.tif", 0.5
    place = Affine(0.0, cell, 1_043_000.0, -cell, 0.0, 743_000.0)
    options = {"height": 100, "width": 200, "count": 1, "dtype": "uint8", "crs": "EPSG:5513", "transform": place}
    with rasterio.open(path, "w", driver="GTiff", **options) as file:
        file.write(np.full((100, 200), 255, np.uint8), 1)
    found = find_placement(path)
    assert (found.size, found.turned_deg) == pytest.approx((cell, 0.0))
    assert (found.east, found.north) == pytest.approx((-743_000.0, -1_043_000.0))


@pytest.mark.parametrize("crs", ["EPSG:5513", "EPSG:2048"])
def test_without_its_system_the_same_file_has_x_east_and_y_north_as_the_remark_says(tmp_path, crs):
    path = write_shapes(tmp_path / "mine.gpkg", [laid(TEE, PRAGUE if crs == "EPSG:5513" else KAROO, crs)], None)
    (found,), georeference = locate(path, read_geodata(path, None), None, None)
    offset = np.array(shapely.get_coordinates(laid(TEE, PRAGUE if crs == "EPSG:5513" else KAROO, crs))[0])
    first = shapely.get_coordinates(found)[0] + georeference.origin
    assert first == pytest.approx(offset, abs=1e-6)


RAMP = [(0, 0, 100), (60, 0, 103), (120, 0, 106)]  # m: 5 % up to the east


@pytest.mark.parametrize(
    ("crs", "plan_m", "up_m", "place"),
    [
        ("EPSG:2230+5703", US_FOOT_M, 1.0, SAN_DIEGO),
        ("EPSG:2230+6360", US_FOOT_M, US_FOOT_M, SAN_DIEGO),
        ("EPSG:32611+6360", 1.0, US_FOOT_M, SAN_DIEGO),
        ("EPSG:32611+8228", 1.0, 0.3048, SAN_DIEGO),
        ("EPSG:32611+5715", 1.0, -1.0, SAN_DIEGO),
        ("EPSG:32611+6358", 1.0, -US_FOOT_M, SAN_DIEGO),
        ("EPSG:2230", US_FOOT_M, US_FOOT_M, SAN_DIEGO),
        ("EPSG:32611", 1.0, 1.0, SAN_DIEGO),
    ],
)
@pytest.mark.parametrize("suffix", [".gpkg", ".shp"])
def test_heights_have_the_unit_and_the_direction_of_their_own_axis(tmp_path, crs, plan_m, up_m, place, suffix):
    plan = pyproj.CRS(crs).sub_crs_list[0] if "+" in crs else pyproj.CRS(crs)
    x, y = pyproj.Transformer.from_crs(plan.geodetic_crs, plan, always_xy=True).transform(*place)
    line = shapely.LineString([(x + e / plan_m, y + n / plan_m, up / up_m) for e, n, up in RAMP])
    path = write_shapes(tmp_path / f"ramp{suffix}", [line], crs)
    params = CentrelineSurveyParams(kind="centrelines", name="a", file="data/x", half_width_m=2.0, heights=None)
    with collect_remarks() as remarks:
        legs = read_vector_survey(params.model_copy(update={"file": path.as_posix()})).shape
    ends = legs.positions_m[[0, -1]]
    rise, run = abs(ends[1, 2] - ends[0, 2]), np.linalg.norm(ends[1, :2] - ends[0, :2])
    assert (rise, run) == pytest.approx((6.0, 120.0), abs=0.01)
    assert legs.datum_m + ends[:, 2].min() == pytest.approx(100.0, abs=0.01)
    listed = [remark.line() for remark in remarks if "its coordinate system states" in remark.line()]
    assert len(listed) == (crs != "EPSG:32611")
    assert not listed or ("no unit of heights" in listed[0]) == ("+" not in crs)


def test_a_stated_unit_overrules_that_of_both_axes_but_not_their_direction(tmp_path):
    line = shapely.LineString([(0, 0, -10), (50, 0, -20)])
    path = write_shapes(tmp_path / "ramp.gpkg", [line], "EPSG:2230+6358")
    found = with_heights(path, read_geodata(path, None), "ft").shapes[0]
    assert shapely.get_coordinates(found, include_z=True)[:, 2].tolist() == [10, 20]


@pytest.mark.parametrize(
    ("crs", "place", "radius_m"),
    [
        ("EPSG:4326", PRAGUE, None),
        ("EPSG:4807", PARIS, None),  # grads from Paris
        ("IAU_2015:30100", (23.5, 0.7), 1_737_400.0),  # the Moon's sphere
        ("IAU_2015:49900", (-5.4, -4.6), None),  # Mars
    ],
)
def test_degrees_are_projected_on_the_ellipsoid_of_their_own_body(tmp_path, crs, place, radius_m):
    system = pyproj.CRS(crs)
    unit = np.degrees(system.axis_info[0].unit_conversion_factor)
    offset = system.prime_meridian.longitude if system.prime_meridian.unit_name == "degree" else 2.33722917
    geod = system.get_geod()

    def on_body(p):
        azimuth, far = np.degrees(np.arctan2(p[:, 0], p[:, 1])), np.hypot(p[:, 0], p[:, 1])
        lon, lat, _ = geod.fwd([place[0]] * len(p), [place[1]] * len(p), azimuth, far)
        return np.column_stack([np.array(lon) - offset, lat]) / unit

    path = write_shapes(tmp_path / "mine.gpkg", [shapely.transform(TEE, on_body)], crs)
    (found,), georeference = locate(path, read_geodata(path, None), None, None)
    assert found.area == pytest.approx(TEE.area, rel=1e-4)
    assert found.length == pytest.approx(TEE.length, abs=0.01)
    assert ("+R=1737400" in georeference.projection) == (radius_m is not None)


def test_a_mine_in_degrees_on_the_moon_is_detected_with_metres_of_its_sphere(tmp_path):
    degree_m = 1_737_400 * np.pi / 180
    path = write_shapes(
        tmp_path / "mine.gpkg", [shapely.transform(TEE, lambda p: p / degree_m + [23.5, 0.0])], "IAU_2015:30100"
    )
    found = detect_survey(path, StatedOptions())
    assert found.width_m == pytest.approx(4.7, abs=0.1)
    assert "+R=1737400" in found.remarks["projection"]


def test_coordinates_from_the_earths_centre_are_refused_and_the_advised_zone_is_read(tmp_path):
    to_centre = pyproj.Transformer.from_crs("EPSG:32633", "EPSG:4978", always_xy=True)

    def at(p):
        return np.column_stack(to_centre.transform(500_000 + p[:, 0], 5_550_000 + p[:, 1], 300 + p[:, 2]))

    line = shapely.LineString(RAMP)
    path = write_shapes(tmp_path / "mine.gpkg", [shapely.transform(line, at, include_z=True)], "EPSG:4978")
    with pytest.raises(InputError, match=r"x, y and z from the Earth's centre") as refused:
        locate(path, read_geodata(path, None), None, None)
    advised = re.search(r"EPSG:326\d\d", str(refused.value))[0]
    back = pyproj.Transformer.from_crs("EPSG:4978", advised, always_xy=True)
    again = shapely.transform(read_geodata(path, None).shapes[0], lambda p: np.column_stack(back.transform(*p.T)), True)
    path = write_shapes(tmp_path / "utm.gpkg", [again], advised)
    (found,), _ = locate(path, read_geodata(path, None), None, None)
    assert found.length == pytest.approx(120.0, abs=0.01)


def test_a_french_map_whose_degrees_are_grads_is_true_to_scale():
    east, north = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:27572", always_xy=True).transform(3, 47)
    assert is_true_to_scale(ground_scale(pyproj.CRS("EPSG:27572"), east, north))


def test_each_axis_of_a_system_with_heights_has_its_own_unit():
    axes = axes_of(pyproj.CRS("EPSG:2263+6359"))
    assert (axes.metres, axes.up_metres) == pytest.approx((US_FOOT_M, -US_FOOT_M))
    assert axes.vertical == "NGVD29 depth (ftUS)"


@pytest.mark.parametrize(
    ("text", "metres"),
    [
        *[("m", 1), ("Metre", 1), ("cm", 0.01), ("dm", 0.1), ("decimeter", 0.1), ("km", 1000)],
        *[("feet", 0.3048), ("ft", 0.3048), ("in", 0.0254)],
        *[("US survey foot", US_FOOT_M), ("us-ft", US_FOOT_M), ("ftUS", US_FOOT_M)],
        *[("K", None), ("", None)],
    ],
)
def test_units_are_known_by_the_names_that_programs_write(text, metres):
    assert metres_of_unit(text) == (None if metres is None else pytest.approx(metres))
