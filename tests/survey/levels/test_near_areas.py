"""Areas that nearly meet: their floors are compared only where they touch."""

from pathlib import Path

import networkx as nx
import numpy as np
import shapely

from pipeline.survey.levels.areas import Area
from pipeline.survey.levels.joins import even_floors

ONE, OTHER = shapely.box(0, 0, 50, 20), shapely.box(50.2, 0, 100, 20)


def area(polygon, z):
    ring = np.array(polygon.exterior.coords)
    return Area(polygon, [np.column_stack([ring, np.full(len(ring), z)])])


AREAS, SHAPES, JOINS = [area(ONE, 0.0), area(OTHER, 0.3)], {"0": ONE, "1": OTHER}, nx.Graph([("0", "1")])


def test_floors_of_areas_with_a_gap_between_them_stay_as_they_are():
    assert even_floors(Path("goaf.gpkg"), AREAS, SHAPES, JOINS) == AREAS
