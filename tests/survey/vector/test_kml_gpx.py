"""KML, KMZ and GPX: degrees, and elevations where the file says that they are some."""

import zipfile

import numpy as np
import pyogrio
import pytest
import shapely

from minesurveys.limits import reader_limits
from minesurveys.remarks import collect_remarks
from minesurveys.vector.earth import kml
from minesurveys.vector.earth.gpx import read_gpx
from minesurveys.vector.earth.kml import read_kml
from pipeline.errors import InputError
from pipeline.params.stated import StatedOptions
from pipeline.survey.detect import detect_survey
from tests.survey.shape_files import write_shapes

LINE = shapely.LineString([(-70.1, -33.1, 2400.0), (-70.099, -33.1, 2401.0)])
SQUARE = shapely.box(-70.1, -33.1, -70.0999, -33.0999)
KML = '<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>{}</Document></kml>'
MARK = (
    "<Placemark>{}<LineString>{}<coordinates>-70.1,-33.1,2400 -70.099,-33.1,2401</coordinates></LineString></Placemark>"
)
ABSOLUTE = "<altitudeMode>absolute</altitudeMode>"
GPX = '<?xml version="1.0"?><gpx version="1.1" creator="t" xmlns="http://www.topografix.com/GPX/1/1">{}</gpx>'
POINT = '<{0} lat="-33.1" lon="{1}">{2}</{0}>'


def by_gdal(path, shapes, driver):
    wkb = np.array(shapely.to_wkb(shapes, flavor="iso"), object)
    kind = "LineString Z" if shapes[0].has_z else shapes[0].geom_type
    options = {"layer": "tracks"} if driver == "GPX" else {"layer": "drifts"}
    pyogrio.raw.write(path, wkb, [], [], geometry_type=kind, crs="EPSG:4326", driver=driver, **options)
    return path


def read(path, text=None, layers=None):
    if text is not None:
        path.write_text(text)
    with collect_remarks() as remarks:
        content = (read_gpx if path.suffix == ".gpx" else read_kml)(path, layers)
    return content, " ".join(remark.line() for remark in remarks)


@pytest.mark.parametrize(("name", "driver"), [("a.kml", "KML"), ("b.kml", "LIBKML"), ("a.kmz", "LIBKML")])
def test_shapes_that_gdal_writes_are_read_where_they_are(tmp_path, name, driver):
    content, _ = read(by_gdal(tmp_path / name, [SQUARE], driver))
    assert len(content.shapes) == 1
    assert content.shapes[0].equals_exact(SQUARE, 1e-9, normalize=True)
    assert content.crs == "EPSG:4326"
    found = detect_survey(tmp_path / name, StatedOptions())
    assert found.width_m == pytest.approx(5.07, abs=0.02)  # 9.33 x 11.09 m: twice the area by the outline


@pytest.mark.parametrize(
    ("mode", "has_z"),
    [
        (ABSOLUTE, True),
        ("", False),
        ("<altitudeMode>clampToGround</altitudeMode>", False),
        ("<altitudeMode>relativeToGround</altitudeMode>", False),
    ],
)
def test_elevations_of_kml_count_only_where_its_altitude_mode_is_absolute(tmp_path, mode, has_z):
    content, remarks = read(tmp_path / "a.kml", KML.format(MARK.format("", mode)))
    assert content.shapes[0].has_z is has_z
    assert ("1 shapes have heights that are no elevations" in remarks) is not has_z


def test_a_shape_of_kml_that_is_not_visible_is_read_if_its_layer_is_named(tmp_path):
    folder = "<Folder><name>drifts</name>{}</Folder>"
    text = KML.format(folder.format(MARK.format("<visibility>0</visibility>", "") + MARK.format("", "")))
    content, _ = read(tmp_path / "a.kml", text)
    assert len(content.shapes) == 1
    assert content.others == {"shapes that are not visible (--layer NAME reads them)": 1}
    assert len(read(tmp_path / "a.kml", layers=["drifts"])[0].shapes) == 2


def test_what_a_kml_file_has_elsewhere_is_counted(tmp_path):
    text = KML.format(MARK.format("", "") + "<NetworkLink><Link><href>b.kml</href></Link></NetworkLink>")
    assert read(tmp_path / "a.kml", text)[0].others["NetworkLink"] == 1


def test_all_kml_files_in_a_kmz_file_are_read_within_a_limit(tmp_path, monkeypatch):
    with zipfile.ZipFile(tmp_path / "a.kmz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("doc.kml", KML.format("<NetworkLink><Link><href>files/b.kml</href></Link></NetworkLink>"))
        archive.writestr("files/b.kml", KML.format(MARK.format("", ABSOLUTE)) + " " * 20_000)
    content, _ = read(tmp_path / "a.kmz")
    assert content.shapes == [LINE]
    assert content.others == {}
    limits = reader_limits().model_copy(update={"text_bytes": 10_000})
    monkeypatch.setattr(kml, "reader_limits", lambda: limits)
    with pytest.raises(InputError, match=r"its KML is larger than 10,000 bytes, the limit"):
        read(tmp_path / "a.kmz")


def test_tracks_of_gpx_that_gdal_writes_keep_their_elevations(tmp_path):
    lines = [shapely.MultiLineString([LINE])]
    write_shapes(tmp_path / "a.gpx", lines, "EPSG:4326", driver="GPX", layer="tracks")
    content, remarks = read(tmp_path / "a.gpx")
    assert content.shapes == lines
    assert (content.layer_of, remarks) == (["tracks"], "")


def test_a_line_of_gpx_with_a_point_that_has_no_elevation_is_read_without_any(tmp_path):
    points = [POINT.format("rtept", -70.1, "<ele>2400</ele>"), POINT.format("rtept", -70.099, "")]
    whole = [POINT.format("trkpt", place, "<ele>2400</ele>") for place in (-70.1, -70.099)]
    text = f"<rte>{''.join(points)}</rte><trk><trkseg>{''.join(whole)}</trkseg></trk>"
    content, remarks = read(tmp_path / "a.gpx", GPX.format(POINT.format("wpt", -70, "") + text))
    assert [shape.has_z for shape in content.shapes] == [False, True]
    assert content.others == {"waypoints": 1}
    assert "1 of 2 lines have points without an elevation" in remarks


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.kml", "<!DOCTYPE kml []>" + KML.format("")[21:], r"has a document type"),
        ("a.kml", GPX.format(""), r"an XML file of 'gpx', no KML"),
        ("a.gpx", GPX.format("")[:-3], r"a\.gpx:1: not well-formed XML"),
        ("a.kmz", "no archive", r"cannot be read as KMZ"),
    ],
)
def test_a_file_that_is_none_is_refused_by_what_it_is(tmp_path, name, text, message):
    with pytest.raises(InputError, match=message):
        read(tmp_path / name, text)


def test_a_layer_that_is_not_there_is_refused_with_those_that_are(tmp_path):
    with pytest.raises(InputError, match=r"no layer walls; there are drifts"):
        read(by_gdal(tmp_path / "a.kml", [SQUARE], "KML"), layers=["walls"])
