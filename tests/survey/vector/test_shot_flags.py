"""Shots of Therion's shots3d.shp that are flagged are read as flagged. pyogrio (GDAL) writes its fields.

References
----------
Therion 6.1, thexpshp.cxx: the fields _SURVEY, _DUPLICATE, _SURFACE, _SPLAY and _APPROX of shots3d.
"""

import numpy as np
import pyogrio
import pytest
from shapely import LineString, to_wkb

from minesurveys.reading import read_shapes
from minesurveys.remarks import collect_remarks
from minesurveys.solved.model import LegFlag
from minesurveys.vector.geodata import read_geodata
from pipeline.errors import InputError
from pipeline.params.survey import CentrelineSurveyParams
from pipeline.survey.vector.centrelines import read_centrelines
from pipeline.survey.vector_survey import read_vector_survey

DRIFT = [[(0, 0, 0), (40, 0, 2)], [(40, 0, 2), (80, 0, 4)]]
SPLAYS = [[(40, 0, 2), (40, 3, 2)], [(40, 0, 2), (40, -3, 2)]]
SURFACE = [[(0, 0, 0), (0, 500, 30)]]
TWICE = [[(80, 0, 4), (120, 0, 6)]]


def write(path, lines, **flags):
    """Write shots with the fields that Therion writes, 0 or 1 by row."""
    columns = {"_ID": np.arange(len(lines), dtype=np.int32)}
    columns |= {f"_{name.upper()}": np.array(rows, np.int32) for name, rows in flags.items()}
    wkb = np.array([to_wkb(LineString(line), output_dimension=3) for line in lines], object)
    names = list(columns)
    pyogrio.raw.write(
        path, wkb, list(columns.values()), names, geometry_type="LineString Z", crs="EPSG:32633", layer="a"
    )
    return path


@pytest.fixture(params=[".shp", ".gpkg"])
def shots(tmp_path, request):
    lines = DRIFT + SPLAYS + SURFACE + TWICE
    splay, surface, duplicate = ([int(k in rows) for k in range(6)] for rows in ((2, 3), (4,), (5,)))
    path = tmp_path / f"shots3d{request.param}"
    return write(path, lines, duplicate=duplicate, surface=surface, splay=splay)


def test_splays_and_legs_on_the_surface_are_no_drifts_and_are_counted(shots):
    with collect_remarks() as remarks:
        content = read_shapes(shots, None)
    assert [line.length for line in content.shapes] == pytest.approx([40, 40, 40])
    lines = [remark.line() for remark in remarks]
    assert any(
        "2 splays (_SPLAY) and 1 legs on the surface (_SURFACE) of 6 shots are no drifts" in line for line in lines
    )
    assert any("1 shots flagged _DUPLICATE were measured before" in line for line in lines)


def test_duplicates_keep_their_flag_as_legs_of_a_survey(shots):
    survey, _ = read_centrelines(shots, read_shapes(shots, None), None, None, 0.1)
    assert survey.leg_flags.tolist() == [0, 0, LegFlag.DUPLICATE]


def test_the_drifts_of_flagged_shots_are_80_m_long_and_not_612(shots):
    params = CentrelineSurveyParams(kind="centrelines", name="a", file="data/x", half_width_m=2.0, heights=None)
    found = read_vector_survey(params.model_copy(update={"file": shots.as_posix()}))
    west, south, east, north = found.workings.bounds
    assert north - south == pytest.approx(4.0, abs=0.1)
    assert east - west <= 124.1
    assert found.shape.lrud_m[:, :2].max() == pytest.approx(2.0)


def test_a_file_of_splays_alone_is_refused_with_that_reason(tmp_path):
    path = write(tmp_path / "shots3d.shp", SPLAYS, splay=[1, 1])
    with pytest.raises(InputError, match=r"shots3d\.shp: holds no drifts: 2 splays \(_SPLAY\)"):
        read_geodata(path, None)


def test_fields_that_are_not_set_change_nothing(tmp_path):
    path = write(tmp_path / "shots3d.shp", DRIFT, splay=[0, 0], surface=[0, 0], duplicate=[0, 0])
    with collect_remarks() as remarks:
        content = read_geodata(path, None, "_ID")
    assert content.layer_of == ["0", "1"]
    assert not content.is_duplicate
    assert not remarks
