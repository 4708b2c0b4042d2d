"""Sheets of surveys whose widths differ from station to station: whole walls, and nothing in the drifts."""

from __future__ import annotations

import itertools

import numpy as np
import shapely

from minexplore.floors.floor import Floor
from pipeline.survey.levels.sheet_layout import lay_apart


def test_many_wide_sheets_lie_in_rows_apart_from_each_other_and_are_found_again():
    east = [3.0, -40.0, 500.0, 3.0, -900.0, 3.0, 3.0]
    polygons = [shapely.box(x, -7.0 * k, x + 1500, -7.0 * k + 90) for k, x in enumerate(east)]
    offsets = lay_apart(polygons)
    moved = [shapely.transform(polygon, lambda xy, d=d: xy + d) for polygon, d in zip(polygons, offsets, strict=True)]
    apart = [one.distance(two) for one, two in itertools.combinations(moved, 2)]
    assert min(apart) >= 12.0
    assert np.ptp(shapely.bounds(moved)[:, ::2]) < 4000  # one row would be 10 km long
    assert (offsets % 10 == 0).all()
    assert not offsets[0].any()
    corners = np.concatenate([np.asarray(polygon.exterior.coords)[:3] for polygon in moved])
    number = np.arange(len(moved))
    floor = Floor(np.pad(corners, [(0, 0), (0, 1)]), np.arange(len(corners)).reshape(-1, 3), number, offsets)
    assert len(floor.rows) > 1
    places = np.concatenate([np.asarray(polygon.buffer(5).exterior.coords) for polygon in moved])
    counts = [len(polygon.buffer(5).exterior.coords) for polygon in moved]
    np.testing.assert_array_equal(floor.sheets_at(places), np.repeat(number, counts))


def test_few_sheets_lie_in_one_row():
    offsets = lay_apart([shapely.box(0, 0, 60, 50), shapely.box(10, 200, 90, 260), shapely.box(-5, -90, 20, 0)])
    assert not offsets[:, 1].any()
    assert (np.diff(offsets[:, 0]) > 0).all()
