"""Heights of the floor follow what a raster states beside its values.

Files are written by rasterio (GDAL); the right heights are those that were meant: 394 to 400 m, 5 % up along x.
"""

import re
import shutil
from pathlib import Path

import numpy as np
import pyproj
import pytest
import rasterio
import rasterio.shutil
import shapely
from rasterio.control import GroundControlPoint
from rasterio.enums import ColorInterp
from rasterio.transform import Affine

from minesurveys.remarks import collect_remarks
from pipeline.errors import InputError
from pipeline.params.survey import VectorSurveyParams
from pipeline.survey.load import read_unlimited
from pipeline.survey.surfaces import height_files
from tests.project import ROOT
from tests.survey.shape_files import write_shapes

EAST, NORTH, GRADE, LOW_M, LENGTH_M = 500_000.0, 5_000_000.0, 0.05, 394.0, 120.0
US_FOOT_M = 1200 / 3937
DRIFT = shapely.box(0, 0, LENGTH_M, 4).union(shapely.box(LENGTH_M - 4, 0, LENGTH_M, 40))
SHARED = ROOT.parent / "shared/data/turn4"


def plan_of(tmp_path, crs="EPSG:32633"):
    moved = shapely.transform(DRIFT, lambda p: np.add(p, [EAST, NORTH]))
    return write_shapes(tmp_path / "plan.gpkg", [moved], crs)


def dem(path, scale=1.0, offset=0.0, crs="EPSG:32633", unit=None, dtype="float32", cell_m=2.0, turn_deg=0.0, **options):
    """Write heights as a program of others would: values * scale + offset are the elevations in the stated unit."""
    middle = rasterio.transform.from_origin(EAST - 10, NORTH + 70, cell_m, cell_m)
    place = middle @ Affine.rotation(turn_deg)
    cols, rows = np.meshgrid(np.arange(90) + 0.5, np.arange(60) + 0.5)
    east, _ = place @ (cols, rows)
    up_m = options.pop("up_m", 1.0)
    values = ((LOW_M + GRADE * (east - EAST)) / up_m - offset) / scale
    values = (np.round(values) if np.issubdtype(np.dtype(dtype), np.integer) else values).astype(dtype)
    bands = options.pop("bands", 1)
    with rasterio.open(
        path, "w", driver="GTiff", height=60, width=90, count=bands, dtype=dtype, crs=crs, transform=place, **options
    ) as file:
        for band in range(bands):
            file.write(values + band, band + 1)
        file.scales, file.offsets = (scale,) * bands, (offset,) * bands
        if unit:
            file.units = (unit,) * bands
    return path


def spots_of(plan, heights):
    """Return the heights that stage 1 reads: places (k, 3), m, with elevations."""
    params = VectorSurveyParams(kind="vector", name="a", file="data/x")
    update = {"file": plan.as_posix(), "heights": heights.as_posix()}
    found = read_unlimited(params.model_copy(update=update)).survey.heights
    return np.add(found.spots, [0, 0, found.datum_m])


def require_meant(plan, heights, atol=0.01):
    spots, origin = spots_of(plan, heights), 10 * np.floor(EAST / 10)
    wanted = LOW_M + GRADE * (spots[:, 0] - (EAST - origin))
    np.testing.assert_allclose(spots[:, 2], wanted, atol=atol)


@pytest.mark.parametrize(
    "stated",
    [
        {},
        {"scale": 0.5},
        {"scale": 0.01, "offset": 300.0, "dtype": "int16", "nodata": -32768},
        {"scale": 0.001, "offset": 350.0, "dtype": "uint32"},
        {"scale": -1.0},
        {"unit": "ft", "up_m": 0.3048},
        {"unit": "feet", "up_m": 0.3048, "scale": 0.25},
        {"unit": "US survey foot", "up_m": US_FOOT_M},
        {"unit": "cm", "up_m": 0.01},
        {"crs": "EPSG:32633+6360", "up_m": US_FOOT_M},
        {"crs": "EPSG:32633+8228", "up_m": 0.3048},
        {"crs": "EPSG:32633+8228", "up_m": 0.3048, "GEOTIFF_VERSION": "1.0"},
        {"crs": "EPSG:32633+5773"},
        {"crs": "EPSG:32633+3855"},
        {"crs": "EPSG:32633+5715", "up_m": -1.0},
        {"turn_deg": 30.0},
        {"cell_m": 4.0, "turn_deg": 10.0},
        {"dtype": "float64", "compress": "deflate", "tiled": True, "blockxsize": 16, "blockysize": 16},
    ],
    ids=lambda stated: ",".join(f"{k}={v}" for k, v in stated.items()) or "plain",
)
def test_heights_of_a_raster_are_those_that_its_band_and_its_vertical_system_state(tmp_path, stated):
    require_meant(plan_of(tmp_path), dem(tmp_path / "dem.tif", **stated))


@pytest.mark.skipif(not SHARED.is_dir(), reason=f"no {SHARED}")
def test_the_scale_of_half_a_metre_is_used():
    spots = spots_of(SHARED / "heights-plan.geojson", SHARED / "heights-half.tif")
    assert (spots[:, 2].min(), spots[:, 2].max()) == pytest.approx((394, 400), abs=0.06)
    grade = np.polyfit(spots[:, 0], spots[:, 2], 1)[0]  # heights are whole numbers of half metres
    assert abs(grade) == pytest.approx(0.05, abs=2e-3)


def test_a_vertical_system_over_a_geoid_is_listed_and_is_no_other_system(tmp_path):
    with collect_remarks() as remarks:
        spots_of(plan_of(tmp_path), dem(tmp_path / "dem.tif", crs="EPSG:32633+5773"))
    assert "dem.tif: its coordinate system states EGM96 height in metre" in [remark.line() for remark in remarks]


def test_of_two_units_the_bands_is_used_and_the_other_listed(tmp_path):
    path = dem(tmp_path / "dem.tif", crs="EPSG:32633+5773", unit="ft", up_m=0.3048)
    with collect_remarks() as remarks:
        require_meant(plan_of(tmp_path), path)
    assert any("its band states 0.3048 m a unit of height, its coordinate system 1 m" in r.line() for r in remarks)


def test_pixels_that_are_points_lie_where_gdal_puts_them(tmp_path):
    for kind in ("Area", "Point"):
        with rasterio.open(dem(tmp_path / f"{kind}.tif"), "r+") as file:
            file.update_tags(AREA_OR_POINT=kind)
        with rasterio.open(tmp_path / f"{kind}.tif") as file:
            assert file.tags()["AREA_OR_POINT"] == kind
        require_meant(plan_of(tmp_path / ".") if kind == "Area" else tmp_path / "plan.gpkg", tmp_path / f"{kind}.tif")


def test_a_corner_and_a_centre_of_an_ascii_grid_differ_by_half_a_cell(tmp_path):
    plan = plan_of(tmp_path)
    rows = [" ".join(f"{LOW_M + GRADE * (4 * col - 8 + 2):.3f}" for col in range(36))] * 20
    for word, east in (("corner", EAST - 8), ("center", EAST - 6)):
        path = tmp_path / f"{word}.asc"
        head = f"ncols 36\nnrows 20\nxll{word} {east}\nyll{word} {NORTH - 8}\ncellsize 4\nNODATA_value -9999\n"
        path.write_text(head + "\n".join(rows) + "\n")
        require_meant(plan, path)


@pytest.mark.parametrize(("zunits", "up_m"), [("FEET", 0.3048), ("METERS", 1.0), ("NO", 1.0)])
def test_the_prj_beside_an_ascii_grid_states_its_system_and_its_unit_of_heights(tmp_path, zunits, up_m):
    plan = plan_of(tmp_path)
    value = LOW_M / up_m
    rows = [" ".join(f"{value:.4f}" for _ in range(36))] * 20
    head = f"ncols 36\nnrows 20\nxllcorner {EAST - 8}\nyllcorner {NORTH - 8}\ncellsize 4\n"
    (tmp_path / "dem.asc").write_text(head + "\n".join(rows) + "\n")
    (tmp_path / "dem.prj").write_text(
        f"Projection UTM\nZone 33\nDatum WGS84\nSpheroid WGS84\nUnits METERS\nZunits {zunits}\nParameters\n"
    )
    assert spots_of(plan, tmp_path / "dem.asc")[:, 2] == pytest.approx(LOW_M, abs=0.01)
    assert [Path(file).name for file in height_files(tmp_path / "dem.asc")] == ["dem.asc", "dem.prj"]


def test_cells_without_a_value_are_no_heights(tmp_path):
    """Hidden cells hold 9999 m; GDAL states them by a value, by a mask, or by an alpha band."""
    plan = plan_of(tmp_path)
    hidden = np.zeros((60, 90), bool)
    hidden[:, 30:50] = True
    for kind in ("nodata", "mask", "alpha"):
        path = tmp_path / f"{kind}.tif"
        stated = {"nodata": 9999} if kind == "nodata" else {"bands": 2} if kind == "alpha" else {}
        dem(path, scale=0.01, dtype="uint16", **stated)
        with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), rasterio.open(path, "r+") as file:
            values = file.read(1)
            values[hidden] = 9999
            file.write(values, 1)
            if kind == "mask":
                file.write_mask(~hidden)
            if kind == "alpha":
                file.colorinterp = (ColorInterp.gray, ColorInterp.alpha)
                file.write(np.where(hidden, 0, 65535).astype("uint16"), 2)
        require_meant(plan, path)
        x = spots_of(plan, path)[:, 0] - (EAST - 10 * np.floor(EAST / 10))
        assert not ((x > 52) & (x < 88)).any()


@pytest.mark.parametrize(("kind", "text"), [("aux", "dem.tif.aux.xml beside it states"), ("msk", "dem.tif.msk beside")])
def test_what_a_file_beside_the_raster_states_is_refused_until_the_advice_is_followed(tmp_path, kind, text):
    plan, path = plan_of(tmp_path), dem(tmp_path / "dem.tif")
    if kind == "aux":
        shutil.copy(dem(tmp_path / "half.tif", scale=0.5), path)
        (tmp_path / "dem.tif.aux.xml").write_text(
            '<PAMDataset><PAMRasterBand band="1"><Offset>0</Offset><Scale>0.5</Scale></PAMRasterBand></PAMDataset>'
        )
    else:
        with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=False), rasterio.open(path, "r+") as file:
            file.write_mask(np.ones((60, 90), bool))
    with pytest.raises(InputError, match=re.escape(text)) as refused:
        spots_of(plan, path)
    assert "`gdal_translate dem.tif out.tif` with GDAL_TIFF_INTERNAL_MASK=YES" in str(refused.value)
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True):
        rasterio.shutil.copy(path, tmp_path / "out.tif", driver="GTiff")
    require_meant(plan, tmp_path / "out.tif")


def test_statistics_beside_a_raster_state_nothing_of_its_heights(tmp_path):
    path = dem(tmp_path / "dem.tif")
    (tmp_path / "dem.tif.aux.xml").write_text(
        '<PAMDataset><PAMRasterBand band="1"><Metadata><MDI key="STATISTICS_MAXIMUM">400</MDI></Metadata>'
        "</PAMRasterBand></PAMDataset>"
    )
    require_meant(plan_of(tmp_path), path)


def test_the_first_of_several_bands_is_read_and_the_others_are_listed(tmp_path):
    path = dem(tmp_path / "dem.tif", bands=3)
    with rasterio.open(path, "r+") as file:
        file.descriptions = ("mean", "max", "count")
    with collect_remarks() as remarks:
        require_meant(plan_of(tmp_path), path)
    assert any("band 1 of 3 is read as heights, not max, count" in remark.line() for remark in remarks)


def test_colours_are_no_heights(tmp_path):
    plan, path = plan_of(tmp_path), dem(tmp_path / "dem.tif", dtype="uint8", photometric="palette", scale=10.0)
    with pytest.raises(InputError, match=r"dem\.tif: band 1 holds colours \(palette\): a picture, no heights"):
        spots_of(plan, path)
    path = dem(tmp_path / "rgb.tif", dtype="uint8", bands=3, photometric="RGB", scale=10.0)
    with pytest.raises(InputError, match=r"rgb\.tif: band 1 holds colours \(red\)"):
        spots_of(plan, path)


def test_a_unit_that_is_no_length_and_a_scale_of_zero_are_refused(tmp_path):
    plan = plan_of(tmp_path)
    with pytest.raises(InputError, match=r"its heights are in 'kelvin', which is no unit of length; `gdal_edit"):
        spots_of(plan, dem(tmp_path / "k.tif", unit="kelvin"))
    with rasterio.open(dem(tmp_path / "zero.tif"), "r+") as file:
        file.scales = (0.0,)
    with pytest.raises(InputError, match=r"zero\.tif: band 1 has the scale 0 and the offset 0, expected numbers, no 0"):
        spots_of(plan, tmp_path / "zero.tif")
    path = dem(tmp_path / "empty.tif", nodata=0)
    with rasterio.open(path, "r+") as file:
        file.write(np.zeros((60, 90), "float32"), 1)
    with pytest.raises(InputError, match=r"empty\.tif: no cell of band 1 has a value"):
        spots_of(plan, path)


def test_ground_control_points_are_named_as_what_the_georeference_is(tmp_path):
    path = tmp_path / "gcp.tif"
    points = [GroundControlPoint(r, c, EAST + 2 * c, NORTH - 2 * r, 0) for r, c in ((0, 0), (0, 9), (9, 0), (9, 9))]
    with rasterio.open(path, "w", driver="GTiff", height=10, width=10, count=1, dtype="float32") as file:
        file.write(np.ones((10, 10), "float32"), 1)
        file.gcps = points, "EPSG:32633"
    with pytest.raises(InputError, match=r"its georeference is by ground control points; `gdalwarp"):
        spots_of(plan_of(tmp_path), path)


def test_heights_in_feet_of_a_survey_without_a_system_have_their_own_unit(tmp_path):
    """The survey is a local drawing in metres, whose coordinates are those of the raster, in feet there."""
    moved = shapely.transform(DRIFT, lambda p: np.add(p, [400.0, 300.0]))
    plan = tmp_path / "plan.gpkg"
    with pytest.warns(UserWarning, match="crs"):
        write_shapes(plan, [moved], None)
    place = rasterio.transform.from_origin(1000.0, 1200.0, 2.0, 2.0)
    options = {"height": 200, "width": 400, "count": 1, "dtype": "float64", "crs": "EPSG:2272", "transform": place}
    with rasterio.open(tmp_path / "dem.tif", "w", driver="GTiff", **options) as file:
        cols = np.arange(400) + 0.5
        east_m = (1000 + 2 * cols) * US_FOOT_M
        file.write(np.tile((LOW_M + GRADE * (east_m - 400)) / US_FOOT_M, (200, 1)), 1)
    spots = spots_of(plan, tmp_path / "dem.tif")
    np.testing.assert_allclose(spots[:, 2], LOW_M + GRADE * (spots[:, 0] - 400), atol=0.01)


def test_a_raster_in_degrees_or_in_another_system_names_the_transformation(tmp_path):
    plan, path = plan_of(tmp_path), dem(tmp_path / "dem.tif", crs="EPSG:32632")
    with pytest.raises(InputError, match=r"is WGS 84 / UTM zone 32N, the survey's is .*33N; transform it .*gdalwarp"):
        spots_of(plan, path)


def test_a_surface_in_a_system_that_points_south_and_west_lies_where_the_plan_does(tmp_path):
    """The corner of Prague's grid that GDAL and PROJ give: x is southing, y is westing."""
    south, west = 1_043_000.0, 743_000.0
    stored = shapely.transform(DRIFT, lambda p: np.column_stack([south - p[:, 1], west - p[:, 0]]))
    plan = write_shapes(tmp_path / "plan.gpkg", [stored], "EPSG:5513")
    lines = [
        shapely.LineString([(south - n, west - e, LOW_M + GRADE * e) for n in (-10, 50)]) for e in range(-10, 140, 10)
    ]
    contours = write_shapes(tmp_path / "contours.gpkg", lines, "EPSG:5513+5705")
    assert pyproj.CRS("EPSG:5513").axis_info[0].direction == "south"
    spots = spots_of(plan, contours)
    np.testing.assert_allclose(spots[:, 2], LOW_M + GRADE * spots[:, 0], atol=0.6)
    assert np.polyfit(spots[:, 0], spots[:, 2], 1)[0] == pytest.approx(GRADE, abs=1e-3)
