"""Rock cut into tiles: nothing is lost, and the corners of parts keep their digits in a mine of kilometres."""

import numpy as np
import pytest
import shapely
from shapely import LineString, Polygon
from shapely.affinity import rotate

from pipeline.errors import ArtifactError
from pipeline.geometry.rock.collision import exact_prisms
from pipeline.geometry.rock.partition import convex_partition, cut_lines, rock_around, tiled_rock, world_box
from pipeline.proof.rebuilt.whole_bundle import require_built
from pipeline.proof.validator import Validator
from tests.composed import compose
from tests.mines import TEE, BuiltMine, footprint_errors, random_mine

LONG = rotate(LineString([(0, 0), (1500, 0)]).buffer(1.6, cap_style="flat"), 31, origin=(0, 0))


@pytest.mark.parametrize("seed", range(4))
def test_tiles_cover_the_rock_exactly_and_no_part_is_longer_than_a_tile(seed):
    mine = random_mine(np.random.default_rng(seed), 8).simplify(0.2)
    box = world_box(mine, 2.0, mine.bounds)
    rock = rock_around(mine, box)
    parts = [Polygon(part) for tile in tiled_rock(rock, box, 20.0) for part in convex_partition(tile)]
    assert sum(part.area for part in parts) == pytest.approx(sum(piece.area for piece in rock), abs=1e-6)
    assert shapely.union_all(parts).intersection(mine).area == pytest.approx(0, abs=1e-6)
    sizes = np.array([part.bounds for part in parts])
    assert (sizes[:, 2:] - sizes[:, :2]).max() <= 20.001


def test_a_box_is_cut_into_equal_tiles_and_a_small_one_is_not_cut():
    eastings, northings = cut_lines((-10.0, 0.0, 990.0, 400.0), 400.0)
    assert eastings == pytest.approx([-10, 323.333, 656.667, 990])
    assert northings == pytest.approx([0, 400])
    rock = [shapely.box(0, 0, 5, 5)]
    assert tiled_rock(rock, (0.0, 0.0, 400.0, 300.0), 400.0) is rock
    assert tiled_rock(rock, (0.0, 0.0, 9e3, 9e3), None) is rock


def intrusion_um(tile_m):
    """Return the rock in a drift of 1.5 km, m2 per m of wall, in corners of 32 bits about the middles of parts."""
    box = world_box(LONG, 2.0, LONG.bounds)
    parts = exact_prisms(tiled_rock(rock_around(LONG, box), box, tile_m), 3.5)
    stored = []
    for k in range(len(parts)):
        centre = (parts[k].min(axis=0) + parts[k].max(axis=0)) / 2
        stored.append((parts[k] - centre).astype(np.float32).astype(float) + centre)
    return 1e6 * max(footprint_errors(stored, LONG, shapely.box(*box))) / LONG.length


def test_corners_in_tiles_are_within_the_certificate_where_those_of_one_frame_are_not():
    assert intrusion_um(400.0) < 3.8 < intrusion_um(None)


@pytest.fixture(scope="module")
def tiled(tmp_path_factory):
    config = compose(["preset=light", "compile3d.tile_m=50"])
    return config, BuiltMine(TEE, config, tmp_path_factory.mktemp("tiled") / "world")


def test_a_world_in_tiles_is_what_the_builder_writes_and_has_its_certificate(tiled):
    config, mine = tiled
    params = config.validation.model_copy(update={"extent": "full"})
    found = Validator(params, mine.bundle, mine.cleaned, mine.raw, mine.survey)
    assert found.certificate.holds
    middle = np.mean(found.world.record.world_m[::2])
    parts = mine.compiled["collision.npz"]
    assert any(abs(parts[k][:, 0].max() - middle) < 1e-3 for k in range(len(parts)))


def test_corners_on_borders_of_tiles_are_refused_where_there_are_no_tiles(tiled):
    config, mine = tiled
    params = config.validation.model_copy(update={"extent": "full", "collision_tile_m": None})
    record = Validator(config.validation, mine.bundle, mine.cleaned, mine.raw, mine.survey).world.record
    with pytest.raises(ArtifactError, match=r"mine\.xml: geom .*: a corner at \("):
        require_built(mine.bundle, record, params)
