"""Centrelines of a coal mine."""

import json

import numpy as np
import pytest
import shapely

from benchmarks.worlds.coal_mine import HALF_M, coal_mine, extent_of, geojson, total_m


def test_a_coal_mine_has_the_length_and_the_extent_that_were_asked_for():
    lines = coal_mine(218_000.0)
    places = np.concatenate(lines)
    assert total_m(lines) == pytest.approx(218_000, rel=0.02)
    assert np.ptp(places, axis=0) == pytest.approx(extent_of(218_000.0), rel=0.01)
    assert extent_of(218_000.0) == (5600.0, 7700.0)


def test_its_roadways_are_one_connected_working():
    lines = coal_mine(20_000.0)
    shapes = [feature["geometry"] for feature in json.loads(geojson(lines))["features"]]
    workings = shapely.union_all([shapely.LineString(shape["coordinates"]).buffer(HALF_M) for shape in shapes])
    assert isinstance(workings, shapely.Polygon)
    assert len(workings.interiors) > 100


def test_a_mine_shorter_than_its_mains_is_refused():
    with pytest.raises(ValueError, match="the mains alone have"):
        coal_mine(3_000.0)
