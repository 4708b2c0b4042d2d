"""Input of the fuzzer: for every reader a valid file and the known hostile files."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from benchmarks.fuzzing.builders import Files, saved
from benchmarks.fuzzing.clouds import CLOUDS, SCANS
from benchmarks.fuzzing.solids import SOLIDS
from benchmarks.fuzzing.surveys import SAMPLES_3D
from minexplore.bundle import FORMAT

_RING = [(0.0, 0.0), (60.0, 0.0), (60.0, 40.0), (0.0, 40.0), (0.0, 0.0)]
_HOLE = [(6.0, 6.0), (54.0, 6.0), (54.0, 34.0), (6.0, 34.0), (6.0, 6.0)]
_RAMP = [(60, 0, 9), (95, 0, 5), (95, 20, 4), (60, 20, 0), (60, 15, 0), (90, 15, 4), (90, 5, 5), (60, 5, 9), (60, 0, 9)]
_LOWER = [(0, 0, 0), (60, 0, 0), (60, 20, 0), (55, 20, 0), (55, 5, 0), (0, 5, 0), (0, 0, 0)]


def _plan(suffix: str) -> bytes:
    picture = np.full((120, 200, 3), 255, np.uint8)
    picture[40:80, 20:180] = 40
    picture[100:104, 20:100] = 0
    return cv2.imencode(suffix, picture[..., 0] if suffix == ".pgm" else picture)[1].tobytes()


def _picture(suffix: str) -> Callable[[], Files]:
    return lambda: {f"plan{suffix}": _plan(suffix)}


def _pdf() -> Files:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3, 2))
    figure.add_axes((0, 0, 1, 1)).fill([0, 1, 1, 0], [0, 0, 0.3, 0.3], color="black")
    stream = io.BytesIO()
    figure.savefig(stream, format="pdf")
    return {"plan.pdf": stream.getvalue()}


def _geotiff() -> Files:
    import rasterio
    from rasterio.transform import from_origin

    def write(path: Path) -> None:
        grey = cv2.imdecode(np.frombuffer(_plan(".png"), np.uint8), cv2.IMREAD_GRAYSCALE)
        place = from_origin(381_000, 6_290_500, 0.125, 0.125)
        with rasterio.open(
            path, "w", driver="GTiff", width=200, height=120, count=1, dtype="uint8", crs="EPSG:32719", transform=place
        ) as out:
            out.write(grey, 1)

    return saved("plan.tif", write)


def _dxf() -> Files:
    import ezdxf.filemanagement

    def write(path: Path) -> None:
        drawing = ezdxf.filemanagement.new()
        drawing.header["$INSUNITS"] = 6
        drawing.modelspace().add_lwpolyline(_RING[:-1], close=True)
        drawing.modelspace().add_lwpolyline(_HOLE[:-1], close=True)
        drawing.modelspace().add_line((0, 0), (5, 5))
        drawing.saveas(path)

    return saved("mine.dxf", write)


def _geodata(name: str) -> Callable[[], Files]:
    def make() -> Files:
        import pyogrio.raw
        import shapely

        ring = shapely.Polygon(_RING, [_HOLE])
        wkb = np.array([ring.wkb], dtype=object)
        return saved(name, lambda path: pyogrio.raw.write(path, wkb, [], [], geometry_type="Polygon", crs="EPSG:32719"))

    return make


def _geojson() -> Files:
    geometry = {"type": "Polygon", "coordinates": [_RING, _HOLE]}
    content = {"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {}, "geometry": geometry}]}
    return {"mine.geojson": json.dumps({**content, "note": "metres"}).encode()}


def _levels() -> Files:
    """Return two levels, a ramp between them, and a shaft."""
    upper = [(0, 0, 9), (60, 0, 9), (60, 5, 9), (0, 5, 9), (0, 0, 9)]
    layers = {"upper": upper, "lower": _LOWER, "ramp": _RAMP, "shafts": [(20, 2.5, 9), (20, 2.5, 0)]}
    features = [
        {"type": "Feature", "properties": {"layer": name}, "geometry": {"type": "LineString", "coordinates": line}}
        for name, line in layers.items()
    ]
    content = {"type": "FeatureCollection", "features": features, "note": "metres"}
    return {"mine.geojson": json.dumps(content).encode()}


def _centrelines() -> Files:
    lines = [[[0, 0, 100], [40, 0, 100], [80, 0, 105]], [[40.1, 0, 100], [40, 30, 98], [70, 30, 90]]]
    features = [
        {"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": line}} for line in lines
    ]
    content = {"type": "FeatureCollection", "features": features, "note": "metres"}
    return {"mine.geojson": json.dumps(content).encode()}


def _beside_plan(files: Files) -> Files:
    return {**files, "plan.geojson": _geojson()["mine.geojson"]}


def _height_raster() -> Files:
    import rasterio
    from rasterio.transform import from_origin

    def write(path: Path) -> None:
        shape = {"width": 62, "height": 42, "count": 1, "dtype": "float32"}
        with rasterio.open(path, "w", driver="GTiff", transform=from_origin(-1, 41, 1, 1), **shape) as out:
            out.write(np.add.outer(np.arange(42), np.arange(62)).astype(np.float32) / 20, 1)

    return _beside_plan(saved("heights.tif", write))


def _height_grid() -> Files:
    head = b"ncols 62\nnrows 42\nxllcorner -1\nyllcorner -1\ncellsize 1\nNODATA_value -9999\n"
    rows = [b" ".join(b"%.2f" % ((i + j) / 20) for i in range(62)) for j in range(42)]
    return _beside_plan({"heights.asc": head + b"\n".join(rows) + b"\n"})


def _contour_lines() -> Files:
    import pyogrio.raw
    import shapely

    lines = [shapely.LineString([(5 * k, -2, k / 4), (5 * k, 44, k / 4)]) for k in range(14)]
    wkb = np.array([shapely.to_wkb(line, output_dimension=3) for line in lines], dtype=object)
    return _beside_plan(
        saved("heights.gpkg", lambda path: pyogrio.raw.write(path, wkb, [], [], geometry_type="LineString Z", crs=None))
    )


def _height_labels() -> Files:
    import ezdxf.filemanagement

    def write(path: Path) -> None:
        drawing = ezdxf.filemanagement.new()
        drawing.header["$INSUNITS"] = 6
        drawing.modelspace().add_line((0, 0), (5, 5))
        for x in range(1, 60, 6):
            drawing.modelspace().add_text(f"{x / 20:.2f}", dxfattribs={"insert": (x, 3)})
        drawing.modelspace().add_point((3, 20, 1.0))
        drawing.saveas(path)

    return _beside_plan(saved("heights.dxf", write))


def _map() -> Files:
    fields = {
        "image": "map.pgm",
        "resolution": 0.1,
        "origin": [0.0, 0.0, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.25,
        "mode": "trinary",
    }
    return {"map.yaml": yaml.safe_dump(fields).encode(), "map.pgm": _plan(".pgm")}


def _bundle() -> Files:
    files = {"mine.xml": b"<mujoco/>", "meshes/a.msh": b"\x00" * 16, "map.yaml": b"image: map.png\n"}
    listed = {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
    record: dict[str, Any] = {"format": FORMAT, "name": "m", "files": listed}
    from minexplore.bundle import world_sha256

    record["world_sha256"] = world_sha256(record)
    return {"world.json": json.dumps(record).encode(), **files}


_CSV = b"""leg,station,easting_m,northing_m,left_m,right_m
A,a,0,0,2,3
A,b,10,0,2,3
A,c,30,5,2,3
B,b,10,0,2,2
B,d,12,20,2,2
"""
_SVX = b"""*begin cave
*fix 0 100 200 0
*calibrate tape 0.1
*units tape metres
*data normal from to tape compass clino
0 1 10.1 90 0
1 2 12.1 80 +1
2 3 9 10 -
*equate 3 4
*data passage station left right up down
0 2 2.5 2 .5
1 2 2 2 .5
2 - 2 2 .5
*include "more"
*end cave
"""
_STR = b"""850 level,21-Nov-26,,ssi_styles:styles.ssi
0, 0.000, 0.000, 0.000, 0.000, 0.000, 0.000
1, 0.000, 0.000, 850.000, toe
1, 0.000, 60.000, 850.000,
1, 5.000, 60.000, 850.000,
1, 5.000, 0.000, 850.000,
1, 0.000, 0.000, 850.000,
0, 0.000, 0.000, 0.000,
7, 2.500, 10.000, 850.000, peg 7
0, 0.000, 0.000, 0.000, END
"""
_PLT = b"""Z -1 1 -1 1 -1 1
M 1115.49 393.70 0 Sa P 6.56 6.56 1.64 8.20
D 1115.49 426.51 0 Sb P -9.99 6.56 1.64 999.9
D 1122.00 465.00 0 Sc P 6.56 6.56 1.64 6.56
M 1115.49 426.51 0 Sb P 4.92 6.56 1.64 4.92
D 1089.00 426.51 0 Sd P 4.92 6.56 1.64 4.92
"""

_SWEEP = b"theta_mu,range_mu,range_var\n" + b"".join(b"%.3f,%.3f,0.001\n" % (i / 20, 2 + i % 7) for i in range(120))


def _section() -> bytes:
    """Return a survey section that stands alone: without the line that includes others."""
    lines = Path("conf/survey/plan.yaml").read_bytes().splitlines(keepends=True)
    return b"".join(line for line in lines if not line.startswith(b"defaults:"))


_DEGREES = " ".join(f"{-70 + x / 1e5:.6f},{-33 + y / 1e5:.6f}" for x, y in _RING)
_KML = (
    '<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><Polygon><outerBoundaryIs>'
    f"<LinearRing><coordinates>{_DEGREES}</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark></Document>"
    "</kml>"
).encode()
_GPX = (
    b'<?xml version="1.0"?><gpx version="1.1" creator="sample" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>'
    b'<trkpt lat="-33.1" lon="-70.1"><ele>4</ele></trkpt><trkpt lat="-33.1" lon="-70.0995"><ele>5</ele></trkpt>'
    b"</trkseg></trk></gpx>"
)


SAMPLES: dict[str, Callable[[], Files]] = {
    "png": _picture(".png"),
    "jpeg": _picture(".jpg"),
    "tiff": _picture(".tif"),
    "pdf": _pdf,
    "geotiff": _geotiff,
    "world file": lambda: {"plan.png": _plan(".png"), "plan.pgw": b"0.125\n0\n0\n-0.125\n5000\n7000\n"},
    "map.yaml": _map,
    "dxf": _dxf,
    "surpac": lambda: {"mine.str": _STR},
    "geojson": _geojson,
    "geopackage": _geodata("mine.gpkg"),
    "shapefile": _geodata("mine.shp"),
    "kml": lambda: {"mine.kml": _KML},
    "gpx": lambda: {"mine.gpx": _GPX},
    "stations": lambda: {"s.csv": _CSV},
    "survex": lambda: {"cave.svx": _SVX, "more.svx": b"*data normal from to tape compass clino\n2 9 4 4 4\n"},
    "compass": lambda: {"cave.plt": _PLT},
    **{name: partial(dict, files) for name, files in SAMPLES_3D.items()},
    "levels": _levels,
    "centrelines": _centrelines,
    "height raster": _height_raster,
    "height grid": _height_grid,
    "contour lines": _contour_lines,
    "height labels": _height_labels,
    **CLOUDS,
    **SOLIDS,
    **SCANS,
    "sweep": lambda: {"sweep.csv": _SWEEP},
    "bundle": _bundle,
    "survey section": lambda: {"conf.yaml": _section()},
}
