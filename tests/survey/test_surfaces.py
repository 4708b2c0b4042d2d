"""Heights of the floor from a surface: a raster, contour lines, labels, walls with elevations."""

import ezdxf
import numpy as np
import pytest
import rasterio
import shapely
from rasterio.transform import from_origin
from shapely import LineString

from minesurveys.frames import Heights
from pipeline.errors import GeometryError, InputError
from pipeline.geometry.floor.network_heights import floor_lines
from pipeline.params.survey import VectorSurveyParams
from pipeline.store.mine_survey import FLOORS
from pipeline.survey.detect import detect_survey
from pipeline.survey.load import read_unlimited
from pipeline.types import DriftNetwork, Leg
from stages.contours import trace_free_space
from tests.composed import compose
from tests.project import ROOT
from tests.survey.levels.test_level_floors import heights_at
from tests.survey.shape_files import write_shapes

WORKINGS = shapely.box(0, 0, 80, 5).union(shapely.box(40, 0, 45, 40))
EAST, NORTH, GRADE = 500_000.0, 7_000_000.0, 0.1
PLACES = np.array([[20, 1], [60, 4], [30.0, 2.5], [42.5, 20], [42.5, 35]])


def plan_of(tmp_path):
    moved = shapely.transform(WORKINGS, lambda p: np.add(p, [EAST, NORTH]))
    return write_shapes(tmp_path / "plan.gpkg", [moved])


def raster(tmp_path, crs="EPSG:32719", east=EAST, lift_m=0.0):
    x, y = np.meshgrid(np.arange(-10, 95) + 0.5, 50 - np.arange(60) - 0.5)
    values = (100 + lift_m + GRADE * x + 0 * y).astype("float32")
    values[0, :5] = -9999
    path = tmp_path / "dem.tif"
    place = from_origin(east - 10, NORTH + 50, 1, 1)
    shape = {"height": values.shape[0], "width": values.shape[1], "count": 1, "dtype": "float32"}
    with rasterio.open(path, "w", driver="GTiff", crs=crs, transform=place, nodata=-9999, **shape) as file:
        file.write(values, 1)
    return path


def contours(tmp_path):
    lines = [LineString([(EAST + 10 * k, NORTH - 9, 100 + k), (EAST + 10 * k, NORTH + 49, 100 + k)]) for k in range(9)]
    return write_shapes(tmp_path / "contours.gpkg", lines)


def labels(tmp_path):
    drawing = ezdxf.new()
    space = drawing.modelspace()
    for x in range(2, 80, 6):
        space.add_text(f"{100 + GRADE * x:.2f}".replace(".", ","), dxfattribs={"insert": (EAST + x, NORTH + 2.5)})
    space.add_text("CROSSCUT 5", dxfattribs={"insert": (EAST + 42, NORTH + 20)})
    space.add_point((EAST + 42.5, NORTH + 36, 104.25))
    space.add_line((EAST, NORTH), (EAST + 5, NORTH))
    drawing.saveas(tmp_path / "labels.dxf")
    return tmp_path / "labels.dxf"


def read(plan, heights):
    params = VectorSurveyParams(kind="vector", name="a", file="data/x")
    found = heights.as_posix() if heights else None
    return read_unlimited(params.model_copy(update={"file": plan.as_posix(), "heights": found}))


def floor_of(mine, monkeypatch):
    monkeypatch.chdir(ROOT)
    config = compose(["preset=light"])
    return trace_free_space(config.contours, mine)["traced"][FLOORS]


def heights_of(floors, places):
    """Return the elevation of the floor at each place; there is one."""
    found = [heights_at(floors, *place) for place in places.tolist()]
    return np.array(found)[:, 0] + floors.datum_m


@pytest.mark.parametrize("source", [raster, contours, labels])
def test_the_floor_follows_a_surface_within_a_centimetre_along_the_drifts(tmp_path, source, monkeypatch):
    floor = floor_of(read(plan_of(tmp_path), source(tmp_path)), monkeypatch)
    known = PLACES if source is raster else PLACES[:4]  # beyond the last height the floor is level
    wanted = 100 + GRADE * known[:, 0]
    np.testing.assert_allclose(heights_of(floor, known), wanted, atol=0.012)


def test_between_the_rings_of_a_polygon_there_is_no_wall(tmp_path):
    """The middle drift is 3 m higher than both pillars' first corners: no line from pillar to pillar may cross it."""
    rings = [
        [(0, 0), (85, 0), (85, 45), (0, 45)],
        [(5, 5), (40, 5), (40, 20), (40, 40), (5, 40)],
        [(45, 20), (45, 5), (80, 5), (80, 40), (45, 40)],
    ]
    high = {(40, 5): 3, (40, 20): 3, (40, 40): 3, (45, 5): 3, (45, 20): 3, (45, 40): 3}
    solid = [[(EAST + x, NORTH + y, 100 + high.get((x, y), 0)) for x, y in ring] for ring in rings]
    path = write_shapes(tmp_path / "walls.gpkg", [shapely.Polygon(solid[0], solid[1:])])
    spots = np.array(read(path, None).survey.heights.spots)
    inside = (spots[:, 0] > 40.5) & (spots[:, 0] < 44.5) & (spots[:, 1] > 6) & (spots[:, 1] < 39)
    assert not inside.any()


def landxml(path, unit, metres):
    """Write a floor of one plane as Civil 3D does: northing first, with a hidden face round it."""
    places = [(EAST + x, NORTH + y, 100 + GRADE * x) for x, y in ((-10, -10), (95, -10), (95, 50), (-10, 50))]
    points = "".join(
        f'<P id="{k}">{y / metres:.6f} {x / metres:.6f} {z / metres:.6f}</P>' for k, (x, y, z) in enumerate(places, 1)
    )
    faces = '<F n="0 2 0">1 2 3</F><F n="1 0 0">1 3 4</F><F i="1">1 2 4</F>'
    units = f'<Imperial areaUnit="squareFoot" linearUnit="{unit}" volumeUnit="cubicYard" temperatureUnit="fahrenheit"/>'
    surface = f'<Definition surfType="TIN"><Pnts>{points}</Pnts><Faces>{faces}</Faces></Definition>'
    path.write_text(
        '<?xml version="1.0"?><LandXML xmlns="http://www.landxml.org/schema/LandXML-1.2" version="1.2">'
        f'<Units>{units}</Units><Application name="Autodesk Civil 3D"/>'
        f'<Surfaces><Surface name="FLOOR"><SourceData/>{surface}</Surface></Surfaces></LandXML>'
    )
    return path


@pytest.mark.parametrize(("unit", "metres"), [("foot", 0.3048), ("USSurveyFoot", 1200 / 3937)])
def test_a_landxml_surface_in_feet_gives_the_floor_of_a_plan_in_metres(tmp_path, monkeypatch, unit, metres):
    plan = plan_of(tmp_path)
    with pytest.raises(InputError, match=r"floor\.xml: its surfaces are those of a floor or a terrain.*--heights"):
        detect_survey(landxml(tmp_path / "floor.xml", unit, metres))
    found = floor_of(read(plan, tmp_path / "floor.xml"), monkeypatch)
    np.testing.assert_allclose(heights_of(found, PLACES), 100 + GRADE * PLACES[:, 0], atol=0.02)


def test_a_surface_that_does_not_belong_to_the_plan_is_refused(tmp_path):
    plan = plan_of(tmp_path)
    with pytest.raises(InputError, match=r"dem\.tif: its coordinate system is WGS 84 / UTM zone 18S, the survey's"):
        read(plan, raster(tmp_path, "EPSG:32718"))
    with pytest.raises(InputError, match=r"dem\.tif: none of its 6295 heights lies in the workings"):
        read(plan, raster(tmp_path, east=EAST + 5000))
    assert read(plan, raster(tmp_path)) is not None  # in the survey's coordinates
    with pytest.raises(InputError, match=r"dem\.tif: an elevation of .* m, at most 10000 m"):
        read(plan, raster(tmp_path, lift_m=20_000))
    (tmp_path / "dem.tif").write_bytes(b"II*\0nothing")
    with pytest.raises(InputError, match=r"dem\.tif: not a raster of heights"):
        read(plan, tmp_path / "dem.tif")
    empty = write_shapes(tmp_path / "flat.gpkg", [LineString([(EAST, NORTH), (EAST + 9, NORTH)])])
    with pytest.raises(InputError, match=r"flat\.gpkg: no point, line or label with an elevation"):
        read(plan, empty)
    with pytest.raises(InputError, match=r"dem\.png: survey\.heights is read from \.csv, \.tif"):
        read(plan, tmp_path / "dem.png")


def test_a_raster_of_complex_numbers_is_no_surface(tmp_path):
    path = raster(tmp_path)
    with rasterio.open(path) as file:
        profile, values = file.profile, file.read(1)
    with rasterio.open(path, "w", **{**profile, "dtype": "complex64", "nodata": None}) as file:
        file.write(values.astype("complex64") + 1j, 1)
    with pytest.raises(InputError, match=r"dem\.tif: band 1 has values of complex64; heights are real numbers"):
        read(plan_of(tmp_path), path)


def test_a_stray_elevation_of_0_is_refused_with_its_place(tmp_path):
    points = [shapely.Point(EAST + x, NORTH + 2.5, 0.0 if x == 30 else 100 + x / 10) for x in range(5, 80, 5)]
    with pytest.raises(
        InputError, match=r"1 points have elevation 0, the first at \(30\.0, 2\.5\) m in the mine frame"
    ):
        read(plan_of(tmp_path), write_shapes(tmp_path / "spots.gpkg", points))


def network_of(*places):
    leg = Leg("A", "a", "b", 40.0, [], list(places), [2.0] * len(places))
    return DriftNetwork({}, [leg], [], [], 0, 1, 40.0, [], list(places), 40.0, 0.25)


def test_spots_count_where_they_are_and_two_heights_of_one_place_are_refused():
    network = network_of((0.0, 0.0), (20.0, 0.0), (40.0, 0.0))
    (line,) = floor_lines(Heights(spots=[(5.0, 1.0, 10.0), (15.0, -1.0, 11.0)]), network, (0.0, 0.0))
    np.testing.assert_allclose(np.interp([2, 5, 10, 15, 30], line[:, 0], line[:, 2]), [10, 10, 10.5, 11, 11])
    with pytest.raises(GeometryError, match=r"the spot \(5\.1, -1\.0\) is 12\.00 m high, another at the same place"):
        floor_lines(Heights(spots=[(5.0, 1.0, 10.0), (5.1, -1.0, 12.0)]), network, (0.0, 0.0))
    with pytest.raises(GeometryError, match=r"the spot \(5\.0, 60\.0\), 9\.00 m high, is 60\.0 m from"):
        floor_lines(Heights(spots=[(5.0, 60.0, 9.0)]), network, (0.0, 0.0))
