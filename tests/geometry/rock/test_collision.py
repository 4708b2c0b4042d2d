import numpy as np
import pytest
import shapely

from pipeline.geometry.rock.collision import decomposed_hulls, exact_prisms, tile_rock
from pipeline.geometry.rock.decompose import coacd_decomposer, vhacd_decomposer
from pipeline.geometry.rock.extrude import extrude_polygon
from pipeline.geometry.rock.partition import rock_around, world_box
from tests.mines import RING, TEE, footprint_errors

BOX = world_box(TEE, 2.0, TEE.bounds)
ROCK = rock_around(TEE, BOX)


def errors_of(parts):
    return footprint_errors([parts[i] for i in range(len(parts))], TEE, shapely.box(*BOX))


def test_prism_walls_enclose_exactly_the_polygon():
    intrusion, missing = errors_of(exact_prisms(ROCK, 3.5))
    assert intrusion == pytest.approx(0, abs=1e-9)
    assert missing == pytest.approx(0, abs=1e-9)


def test_intrusion_and_missing_rock_are_the_areas_of_an_added_and_a_removed_part():
    parts = exact_prisms(ROCK, 3.5)
    block = np.array([[10, 0, 0], [12, 0, 0], [12, 3, 0], [10, 3, 0]], dtype=float)
    intrusion, missing = footprint_errors([*(parts[i] for i in range(1, len(parts))), block], TEE, shapely.box(*BOX))
    removed = shapely.convex_hull(shapely.multipoints(parts[0][:, :2])).area
    assert (intrusion, missing) == pytest.approx((6.0, removed))


def test_tiles_cover_the_rock_once():
    tiles = tile_rock(ROCK, 12)
    assert sum(t.area for t in tiles) == pytest.approx(sum(r.area for r in ROCK))
    assert len(tiles) <= 12


@pytest.mark.parametrize(
    "decomposer",
    [vhacd_decomposer(3.5, 100_000, 16, 0.5), coacd_decomposer(3.5, 0.05, 0)],
    ids=["vhacd", "coacd"],
)
def test_approximate_decompositions_differ_from_the_rock(decomposer):
    parts = decomposed_hulls(ROCK, 6, decomposer)
    intrusion, missing = errors_of(parts)
    assert 0.01 < intrusion + missing < 0.2 * sum(r.area for r in ROCK)


def test_an_extruded_polygon_is_closed_and_has_its_volume():
    mesh = extrude_polygon(RING, 3.5)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(RING.area * 3.5)
