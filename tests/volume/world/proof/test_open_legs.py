"""A wall across a leg of a survey is found where another way leads round it."""

import dataclasses

import manifold3d
import numpy as np
import pytest

from minexplore.floors.volume_arrays import FacetLabel
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.parts import collect_labelled
from pipeline.volume.world.proof.surveyed.open_legs import open_shares
from pipeline.volume.world.topology import mine_network
from tests.volume_worlds import HEADER, VolumeWorld, proof, validated

LIMIT = proof().limits["survey.open_share"].min
# A square of drifts 30 m long, one of them with a bend, and a leaning shaft from one corner to a drift over the others.
RING = (
    HEADER
    + "A,1,0,0,0,2,2,3,0\nA,2,30,0,0,2,2,3,0\nA,3,33,15,0,2,2,3,0\nA,4,30,30,0,2,2,3,0\n"
    + "A,5,0,30,0,2,2,3,0\nA,1,0,0,0,2,2,3,0\nB,1,0,0,0,1,1,2.5,0\nB,6,-6,0,12,1,1,2.5,0\n"
    + "C,6,-6,0,12,2,2,2.5,0\nC,7,-30,0,12,2,2,2.5,0\nC,8,-30,30,6,2,2,2.5,0\nC,5,0,30,0,2,2,3,0\n"
)


@pytest.fixture(scope="module")
def ring(tmp_path_factory):
    return VolumeWorld(RING, tmp_path_factory.mktemp("ring"))


@pytest.fixture(scope="module")
def opened(ring):
    return ring.opened()


def network_of(ring):
    params = proof()
    return mine_network(ring.shape, params.height_m, params.volume)


def wall_across(network, offset, leg, share, wide_m=3.5, open_m=0.0):
    """Return the corners of walls of 8 cm through a leg, square to it, beside an opening at their middle."""
    sides = ((-wide_m, -open_m / 2), (open_m / 2, wide_m)) if open_m else ((-wide_m, wide_m),)
    return [half_wall(network, offset, leg, share, side) for side in sides]


def half_wall(network, offset, leg, share, side):
    """Return the corners of a wall of 8 cm through a leg, square to it, from one place to another to its left, m."""
    start, end = network.floors_m[leg] + offset
    ahead = (end - start) / np.linalg.norm(end - start)
    aside = np.append(network.across[leg, 0], 0)
    over = np.cross(ahead, aside)
    middle = start + share * (end - start)
    return np.array([middle + 0.04 * a * ahead + b * aside + c * over for a in (-1, 1) for b in side for c in (-4, 4)])


def walled(world, walls):
    """Return a bundle with walls in its free space: in its mesh, and as parts."""
    solid = closed_volume(world.mine).solid
    for corners in walls:
        solid -= manifold3d.Manifold.hull_points(corners)
    mesh = solid.to_mesh64()
    vertices, faces = np.array(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int32)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    up = np.cross(b - a, c - a)[:, 2] / np.linalg.norm(np.cross(b - a, c - a), axis=1)
    label = np.select([up < -0.8, up > 0.7], [FacetLabel.FLOOR, FacetLabel.ROOF], FacetLabel.WALL).astype(np.uint8)
    mine = dataclasses.replace(
        world.mine, vertices=vertices, faces=faces, label=label, leg=np.zeros(len(faces), world.mine.leg.dtype)
    )
    parts = [world.parts[k] for k in range(len(world.parts))] + walls
    labels = [*world.parts.label.tolist(), *[int(FacetLabel.WALL)] * len(walls)]
    return dataclasses.replace(world, mine=mine, parts=collect_labelled(parts, labels))


def test_each_leg_of_a_ring_of_drifts_and_a_shaft_is_open(ring, opened):
    assert open_shares(*network_of(ring), closed_volume(opened.mine)).tolist() == [1.0] * 9


@pytest.mark.parametrize("leg", range(9))
@pytest.mark.parametrize("share", [0.3, 0.5, 0.8])
def test_a_wall_of_8_cm_leaves_nothing_of_the_leg_that_it_stands_across(ring, opened, leg, share):
    network, offset = network_of(ring)
    found = open_shares(network, offset, closed_volume(walled(opened, wall_across(network, offset, leg, share)).mine))
    assert found[leg] == 0
    assert np.delete(found, leg).min() > LIMIT


def test_a_wall_on_a_station_bars_a_leg_at_it(ring, opened):
    network, offset = network_of(ring)
    station = network.names.index("3")
    leg = int(np.flatnonzero((network.shots == station).any(axis=1))[0])
    share = float(network.shots[leg, 1] == station)
    found = open_shares(network, offset, closed_volume(walled(opened, wall_across(network, offset, leg, share)).mine))
    assert found.min() == 0


def test_no_other_clause_of_the_geometry_finds_a_wall_across_a_leg_of_a_loop(ring, opened):
    network, offset = network_of(ring)
    mutant = walled(opened, wall_across(network, offset, 4, 0.4))
    found = validated(mutant, ring.shape)
    broken = {name for name, clause in found.certificate.clauses.items() if not clause.holds}
    assert broken - {"enclosure.unlike"} == {"survey.open_share"}  # mine.xml is not made again
    assert found.metrics["survey"]["open_share"] == 0
    assert found.metrics["survey"]["open_at"] == f"leg {network.leg_name(4)}"


def test_a_wall_that_only_the_parts_have_intrudes(ring, opened):
    walls = wall_across(*network_of(ring), 4, 0.4)
    mutant = dataclasses.replace(walled(opened, walls), mine=opened.mine)
    found = validated(mutant, ring.shape)
    assert not found.certificate.clauses["enclosure.intrusion_mm"].holds


def test_a_leg_with_an_opening_in_a_wall_across_it_is_open(ring, opened):
    network, offset = network_of(ring)
    walls = wall_across(network, offset, 4, 0.4, open_m=2.0)
    assert open_shares(network, offset, closed_volume(walled(opened, walls).mine))[4] >= LIMIT


def test_a_leg_that_no_straight_line_passes_is_open_where_a_way_leads_round_two_walls(ring, opened):
    network, offset = network_of(ring)
    zigzag = [half_wall(network, offset, 0, share, side) for share, side in ((0.2, (-3.5, 0.8)), (0.35, (-0.8, 3.5)))]
    shares = open_shares(network, offset, closed_volume(walled(opened, zigzag).mine))
    assert LIMIT < shares[0] <= 1
    closed = [*zigzag, *wall_across(network, offset, 0, 0.6)]
    assert open_shares(network, offset, closed_volume(walled(opened, closed).mine))[0] == 0
