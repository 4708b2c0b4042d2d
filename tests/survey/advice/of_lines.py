"""Refusals of drawings, geodata and station surveys, and what follows their advice."""

from __future__ import annotations

from functools import partial

from shapely import Point, box

from tests.survey.advice.advice import Advice, WayOn, by
from tests.survey.advice.of_pictures import picture
from tests.survey.advice.written import csv, dxf, faces, geojson, geopackage, placed, points, svx

DRIFT = [[0, 0], [60, 0], [60, 4], [0, 4], [0, 0]]
WALLS = [[[0, 0], [60, 0]], [[60, 4], [0, 4]]]
TEE = [[[0, 0], [60, 0]], [[30, 0], [30, 40]]]


UTM = {"a": "EPSG:32632", "b": "EPSG:32632"}
DEGREES = {"a": "EPSG:4326"}
FAR = [[x + 500, y + 500] for x, y in DRIFT]
NEAR = [[x + 500_000, y + 5_000_000] for x, y in DRIFT]
GRID = [[[x, 0, x / 10], [x, 60, x / 10]] for x in (0, 20, 40, 60)]
GRID += [[[0, y, 0], [60, y, 6]] for y in (0, 20, 40, 60)]
SECTION = [[[0, 0, 0], [80, 40, -10], [80, 40, -14], [0, 0, -4], [0, 0, 0]]]
PIT = [[[x, y, -10.0 * k] for x, y in Point(0, 0).buffer(200 - 20 * k).exterior.coords] for k in range(5)]
FRAMED = [
    [[x, y] for x, y in box(*bounds).exterior.coords]
    for bounds in ((-20, -20, 110, 70), (0, 0, 80, 50), (20, 20, 30, 30))
]
CAVE = [[[10, 10, 5], [30, 22, 5]], [[30, 22, 5], [61, 64, 4]]]
RULED = [[[0, 50, 0], [130, 50, 0]], [[50, 0, 0], [50, 118, 0]]]
SVX = "*fix 1 0 0 0\n*data normal from to tape compass clino\n1 2 30 90 0\n2 3 20 0 0\n"
LEGS = "leg,station,easting_m,northing_m,left_m,right_m\n"
SPLAYS = SVX + "*flags splay\n2 4 2 180 0\n"

CASES = {
    "degrees": Advice(
        "deg wide; --unit m reads a local grid",
        partial(geopackage, layers={"a": TEE}, systems=DEGREES),
        {"half_width_m": 2.0},
        (by(unit="m", half_width_m=2.0),),
    ),
    "no degrees": Advice(
        "--unit m reads a local grid",
        partial(geopackage, layers={"a": [FAR[:2]]}, systems=DEGREES),
        {"half_width_m": 2.0},
        (by(unit="m", half_width_m=2.0),),
    ),
    "volume of another file": Advice(
        "--volume reads the solids in a DXF file; other surveys are read without it",
        partial(geojson, shapes=[DRIFT], kind="Polygon"),
        {"volume": True, "unit": "m"},
        (by(unit="m"),),
    ),
    "open lines": Advice(
        "; --half-width M reads centrelines of drifts",
        partial(geojson, shapes=TEE),
        {"unit": "m"},
        (by(unit="m", half_width_m=2.0),),
    ),
    "a gap in another unit": Advice(
        "drifts {} m wide",
        partial(dxf, layers={"0": [[[0, 0], [120, 0], [120, 8], [0, 8], [0, 0.3]]]}),
        {},
        (by(unit="ft"), by(snap_m=0.5)),
    ),
    "lines in space": Advice(
        "and most of them bound no workings; --half-width M",
        partial(geopackage, layers={"a": GRID}, systems=UTM),
        {},
        (by(half_width_m=2.0),),
    ),
    "lines that cross themselves": Advice(
        "read its centreline by --half-width",
        partial(dxf, layers={"0": [[[0, 0, 0], [60, 0, 3], [60, 40, 6], [30, 40, 9], [30, -20, 12], [0, 0, 0]]]}),
        {},
        (by(half_width_m=2.0),),
    ),
    "a section": Advice("lie in one vertical plane", partial(dxf, layers={"0": SECTION}), {}, (by(half_width_m=2.0),)),
    "contours": Advice(
        "contours of an open pit or of the ground", partial(dxf, layers={"0": PIT}), {}, (by(layers=["0"]),)
    ),
    "a frame on one layer": Advice(
        "reads them all as walls", partial(dxf, layers={"0": FRAMED}, closed=True), {}, (by(layers=["0"]),)
    ),
    "a frame on a layer": Advice(
        "chooses from its layers",
        partial(dxf, layers={"FRAME": FRAMED[:1], "WALLS": FRAMED[1:]}, closed=True),
        {},
        (by(layers=["WALLS"]),),
    ),
    "a grid beside centrelines": Advice(
        "which no line of another layer meets; ",
        partial(dxf, layers={"CentreLine": CAVE, "Grid": RULED}),
        {"half_width_m": 1.0},
        (by(half_width_m=1.0, layers=["CentreLine"]), by(half_width_m=1.0, layers=["Grid"])),
    ),
    "a boundary": Advice(
        "chooses from its layers",
        partial(
            geopackage,
            layers={"a": [FRAMED[0]], "b": [FRAMED[1]]},
            systems=UTM,
        ),
        {},
        (by(layers=["b"]),),
    ),
    "a line far off": Advice(
        "or choose layers by --layer NAME",
        partial(dxf, layers={"WALLS": [DRIFT], "FAR": [[[9e6, 9e6], [9e6 + 10, 9e6]]]}, closed=True),
        {},
        (by(layers=["WALLS"]),),
    ),
    "two systems": Advice(
        "choose layers with one system by --layer",
        partial(geopackage, layers={"a": [NEAR], "b": [FAR]}, systems={"a": "EPSG:32632", "b": "EPSG:32633"}),
        {},
        (by(layers=["a"]),),
    ),
    "polygons as centrelines": Advice(
        "holds polygons; centrelines are lines (without --half-width, it is read as walls)",
        partial(geopackage, layers={"a": [NEAR]}, systems=UTM),
        {"half_width_m": 2.0},
        (by(),),
    ),
    "lines without heights": Advice(
        "--no-elevation 0 takes heights from the rest of the lines",
        partial(dxf, layers={"0": [[[0, 0, 5], [30, 0, float("nan")], [60, 0, 6]]]}),
        {"half_width_m": 2.0},
        (by(half_width_m=2.0, no_elevation=0),),
    ),
    "a stray height": Advice(
        "--no-elevation -9999 keeps 0",
        partial(dxf, layers={"0": [[[0, 0, 400], [30, 0, 0], [60, 0, 401], [90, 0, 402]]]}),
        {"half_width_m": 2.0},
        (by(half_width_m=2.0, no_elevation=0), by(half_width_m=2.0, no_elevation=-9999)),
    ),
    "layers that enclose nothing": Advice(
        "none of its {} layers encloses an area; --half-width M",
        partial(dxf, layers={"A": TEE[:1], "B": TEE[1:]}),
        {},
        (by(half_width_m=2.0), by(half_width_m=2.0, layers=["A"])),
    ),
    "layers of which one encloses": Advice(
        "reads {} m2",
        partial(dxf, layers={"A": [DRIFT[:4]], "B": [[[0, 100], [90, 130]]]}),
        {"snap_m": 0.5},
        (by(layers=["A"], snap_m=10.0),),
    ),
    "a place of a line": Advice(
        "state a place by --piece E,N,0",
        partial(dxf, layers={"0": TEE}),
        {"half_width_m": 2.0, "piece": "x"},
        (by(half_width_m=2.0, piece=[0.0, 0.0, 0.0]),),
    ),
    "no property": Advice(
        "no shape has this property",
        partial(geojson, shapes=[DRIFT, FAR], kind="Polygon", fields=[{"z": 0}, {"z": 20}]),
        {"unit": "m", "level_by": "level"},
        (by(unit="m", level_by="z"),),
    ),
    "names of levels": Advice(
        "state the floor of each level in metres",
        partial(geojson, shapes=[DRIFT, DRIFT], kind="Polygon", fields=[{"z": "upper"}, {"z": "lower"}]),
        {"unit": "m", "level_by": "z"},
        (by(unit="m", level_by="z", elevations_m={"upper": 20.0, "lower": 0.0}),),
    ),
    "layers by a property": Advice(
        "its lines have no properties, but layers; state --elevation LAYER=M",
        partial(dxf, layers={"A": [DRIFT], "B": [FAR]}, closed=True),
        {"level_by": "z"},
        (by(elevations_m={"A": 0.0, "B": 20.0}),),
    ),
    "points alone": Advice(
        "points are no walls: --heights FILE",
        partial(points, name="a.geojson"),
        {"unit": "m"},
        (WayOn({"unit": "m", "heights": "a.geojson"}, partial(geojson, shapes=[DRIFT], kind="Polygon")),),
    ),
    "far in its unit": Advice(
        "--unit states it", partial(dxf, layers={"0": [DRIFT]}, unit=6, scale=1000.0), {"unit": "m"}, (by(unit="mm"),)
    ),
    "axes from the Earth's centre": Advice(
        "in the program that made it",
        partial(geopackage, layers={"a": [DRIFT]}, systems={"a": "EPSG:4978"}),
        {},
        (WayOn({}, partial(geopackage, layers={"a": [NEAR]}, systems=UTM)),),
    ),
    "far in height": Advice(
        "--unit states the unit of the file",
        partial(dxf, layers={"0": [[[0, 0, 20_000], [9_000, 0, 20_900]]]}),
        {"half_width_m": 1.0},
        (by(half_width_m=1.0, unit="mm"),),
    ),
    "faces alone": Advice("--volume reads them as a solid of the workings", faces, {}, (by(volume=True),)),
    "a picture on a drawing": Advice(
        "a picture or a PDF on a drawing is not read: give that file to --from",
        placed,
        {},
        (WayOn({"px_per_m": 8.0}, picture),),
    ),
    "no sections": Advice("no cross-sections and no splays", partial(svx, text=SVX), {}, (by(half_width_m=2.0),)),
    "no walls": Advice(
        "no station has a distance to both walls",
        partial(csv, text=LEGS + "a,1,0,0,,\na,2,40,0,,\n"),
        {},
        (by(half_width_m=2.0),),
    ),
    "a list of points": Advice(
        "a list of points",
        partial(csv, text="Punkt;Hochwert;Rechtswert;Hoehe\n1;0;0;5\n2;0;40;5\n"),
        {},
        (
            WayOn(
                {"half_width_m": 2.0}, partial(csv, text="leg;Punkt;Hochwert;Rechtswert;Hoehe\na;1;0;0;5\na;2;0;40;5\n")
            ),
        ),
    ),
}
