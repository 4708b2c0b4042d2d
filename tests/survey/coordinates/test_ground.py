"""Coordinate systems whose unit is no metre on the ground are noticed, corrected and told."""

import re

import cv2
import numpy as np
import pyproj
import pytest
import rasterio
import shapely

from minesurveys.coordinates.ground import ground_scale, is_true_to_scale
from minesurveys.pictures.georeference import find_placement
from minesurveys.vector.geodata import read_geodata
from minesurveys.vector.shapes import locate
from pipeline.errors import InputError
from pipeline.survey.detect import detect_survey
from pipeline.survey.vector.enclosed import workings_of
from tests.mines import TEE
from tests.survey.shape_files import write_shapes

_PLACE = (12.0, 55.0)


def in_system(shape, crs):
    """Return a shape in metres, laid on the ground near 12 E 55 N, in the coordinates of a system."""
    local = f"+proj=tmerc +lon_0={_PLACE[0]} +lat_0={_PLACE[1]} +ellps=WGS84 +units=m"
    to_map = pyproj.Transformer.from_crs(local, crs, always_xy=True)
    return shapely.transform(shape, lambda p: np.column_stack(to_map.transform(*p.T)))


@pytest.mark.parametrize(("crs", "east", "north"), [("EPSG:3857", 1.74, 1.74), ("EPSG:32662", 1.74, 1.0)])
def test_web_mercator_and_plate_carree_stretch_lengths_at_latitude_55(crs, east, north):
    place = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(*_PLACE)
    assert ground_scale(pyproj.CRS(crs), *place) == pytest.approx((east, north), abs=0.01)


@pytest.mark.parametrize(
    ("crs", "place"), [("EPSG:32719", (-69, -23)), ("EPSG:2263", (-74, 40.7)), ("EPSG:3035", (12, 55))]
)
def test_systems_made_for_lengths_are_true_to_scale_in_metres_and_feet(crs, place):
    at = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(*place)
    assert is_true_to_scale(ground_scale(pyproj.CRS(crs), *at))


@pytest.mark.parametrize("crs", ["EPSG:3857", "EPSG:32662"])
def test_a_vector_mine_in_a_stretched_system_has_its_true_area_and_width_and_says_so(tmp_path, crs):
    path = write_shapes(tmp_path / "mine.gpkg", [in_system(TEE, crs)], crs)
    shapes, georeference = locate(path, read_geodata(path, None), None, None)
    assert workings_of(path, shapes, 0.25, []).area == pytest.approx(TEE.area, rel=1e-3)
    assert "tmerc" in georeference.projection
    assert "no metres on the ground" in detect_survey(path).remarks["projection"]


def test_a_local_grid_with_a_wrong_system_keeps_its_lengths(tmp_path):
    path = write_shapes(tmp_path / "mine.gpkg", [TEE])
    shapes, georeference = locate(path, read_geodata(path, None), None, None)
    assert workings_of(path, shapes, 0.25, []).area == pytest.approx(TEE.area, rel=1e-9)
    assert georeference.projection is None


def geotiff(path, crs, size):
    east, north = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(*_PLACE)
    picture = np.full((3, 200, 200), 255, np.uint8)
    picture[:, 40:160, 90:110] = 30
    place = rasterio.transform.from_origin(east, north, size, size)
    with rasterio.open(
        path, "w", driver="GTiff", width=200, height=200, count=3, dtype="uint8", crs=crs, transform=place
    ) as file:
        file.write(picture)
    return path


def test_a_picture_in_web_mercator_has_metres_of_the_ground_and_says_so(tmp_path):
    path = geotiff(tmp_path / "plan.tif", "EPSG:3857", 0.4)
    placement = find_placement(path)
    assert placement.size * placement.metres_per_unit == pytest.approx(0.4 / 1.7425, rel=2e-3)
    assert re.search(r"whose metre is 0\.57\d\d m on the ground \(EPSG:3857\)", detect_survey(path).remarks["scale"])


def test_a_picture_that_is_stretched_along_one_axis_is_refused(tmp_path):
    assert cv2.imread(str(geotiff(tmp_path / "plan.tif", "EPSG:32662", 0.4))) is not None
    with pytest.raises(InputError, match=r"1\.7\d\d .east. and 1\.00\d .north. times those on the ground; warp it"):
        find_placement(tmp_path / "plan.tif")
