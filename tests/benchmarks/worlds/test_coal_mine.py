"""Centrelines of a coal mine."""

import json

import numpy as np
import pytest
import shapely

from benchmarks.worlds.coal_mine import EXTENT_M, HALF_M, coal_mine, geojson, total_m


def test_a_coal_mine_has_the_length_and_the_extent_that_were_asked_for():
    lines = coal_mine(218_000.0)
    places = np.concatenate(lines)
    assert total_m(lines) == pytest.approx(218_000, rel=0.02)
    assert np.ptp(places, axis=0) == pytest.approx(EXTENT_M, rel=0.01)


def test_its_roadways_are_one_connected_working():
    lines = coal_mine(20_000.0, (1700.0, 2300.0))
    shapes = [feature["geometry"] for feature in json.loads(geojson(lines))["features"]]
    workings = shapely.union_all([shapely.LineString(shape["coordinates"]).buffer(HALF_M) for shape in shapes])
    assert isinstance(workings, shapely.Polygon)
    assert len(workings.interiors) > 100


def test_a_mine_longer_than_its_extent_holds_or_shorter_than_its_mains_is_refused():
    for length_m in (20_000.0, 2_000_000.0):
        with pytest.raises(ValueError, match=r"do not fit 5600 x 7700 m"):
            coal_mine(length_m)
