"""What of a volume is about some facets, and the volume that convex parts share with it."""

import tracemalloc

import manifold3d
import numpy as np
import pytest

from benchmarks.comparisons.volume.cases import CASES
from pipeline.errors import GeometryError
from pipeline.geometry.facets.separation import Facets
from pipeline.volume.floors import solve_floors
from pipeline.volume.labelled_solid import Neighbourhood, boxes_apart, of_facets
from pipeline.volume.rock.intruding_volume import shared_m3
from pipeline.volume.slivers import without_slivers


@pytest.fixture(scope="module")
def tee(tmp_path_factory):
    return solve_floors(CASES["tee"].network(tmp_path_factory.mktemp("tee")))


def corners_of(volume):
    """Return the corners of facets with their label and leg, in an order of their own."""
    rows = zip(volume.vertices[volume.faces].tolist(), volume.label.tolist(), volume.source.tolist(), strict=True)
    turned = ((corners[(k := corners.index(min(corners))) :] + corners[:k], *more) for corners, *more in rows)
    return sorted(turned)


def joined_one_by_one(low, high):
    """Return boxes, one about all that meet each other, each where the first of them was."""
    boxes = list(zip(low, high, strict=True))
    while pair := next(
        (
            (i, j)
            for i, (a, b) in enumerate(boxes)
            for j, (c, d) in enumerate(boxes[:i])
            if (a <= d).all() and (c <= b).all()
        ),
        None,
    ):
        (a, b), (c, d) = boxes.pop(pair[0]), boxes[pair[1]]
        boxes[pair[1]] = (np.minimum(a, c), np.maximum(b, d))
    return tuple(map(np.array, zip(*boxes, strict=True)))


@pytest.mark.parametrize("together", [10, 1000])
def test_boxes_that_meet_become_one_whether_or_not_they_are_taken_by_halves(together, monkeypatch):
    monkeypatch.setattr("pipeline.volume.labelled_solid._TOGETHER", together)
    rng = np.random.default_rng(0)
    low = rng.uniform(0, 10, (300, 3))
    high = low + rng.uniform(0, 0.9, (300, 3))
    found, wanted = boxes_apart(low, high), joined_one_by_one(low, high)
    assert 1 < len(wanted[0]) < 280
    for ours, theirs in zip(found, wanted, strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_boxes_of_which_all_meet_take_no_memory_for_each_pair():
    low = np.random.default_rng(0).random((8000, 3))
    tracemalloc.start()
    found = boxes_apart(low, low + 1)
    assert tracemalloc.get_traced_memory()[1] < 200_000_000  # 64 million pairs of numbers would take 1 GB
    tracemalloc.stop()
    np.testing.assert_array_equal(found, [[low.min(axis=0)], [low.max(axis=0) + 1]])


@pytest.mark.parametrize("facet", [0, 40, 99])
def test_a_neighbourhood_that_is_put_back_as_it_is_gives_the_same_volume(tee, facet):
    about = Neighbourhood(tee, tee.vertices[tee.faces[[facet]]], 0.1)
    assert 0 < (~about.at_border(about.volume)).sum() < len(tee.faces)
    back = about.put_back(about.volume)
    assert corners_of(back) == corners_of(tee)
    assert back.solid.volume() == pytest.approx(tee.solid.volume(), rel=1e-12)


def test_a_neighbourhood_has_the_facets_about_a_place_and_no_free_space_far_from_it(tee):
    some = np.array([0, 3])
    about = Neighbourhood(tee, tee.vertices[tee.faces[some]], 0.1)
    ours = about.volume.vertices[about.volume.faces[about.numbers(some)]]
    assert (np.sort(ours, axis=1) == np.sort(tee.vertices[tee.faces[some]], axis=1)).all()
    assert (about.volume.solid - tee.solid).volume() < 1e-9
    assert about.volume.solid.volume() < 0.9 * tee.solid.volume()


def test_a_border_that_has_changed_is_refused(tee):
    about = Neighbourhood(tee, tee.vertices[tee.faces[[0]]], 0.1)
    with pytest.raises(GeometryError, match="does not fit"):
        about.put_back(Neighbourhood(tee, tee.vertices[tee.faces[[len(tee.faces) - 1]]], 0.1).volume)


def test_a_neighbourhood_that_lacks_a_facet_is_refused_though_its_border_is_whole(tee):
    about = Neighbourhood(tee, tee.vertices[tee.faces[[0]]], 0.1)
    inner = np.flatnonzero(~about.at_border(about.volume))
    one = of_facets(about.volume, np.delete(np.arange(len(about.volume.faces)), inner[0]))
    assert set(map(tuple, about.volume.vertices.tolist())) == set(map(tuple, one.vertices.tolist()))
    with pytest.raises(GeometryError, match="does not fit"):
        about.put_back(one)


def test_slivers_of_facets_that_are_kept_stay(tee):
    kept = np.ones(len(tee.faces), bool)
    assert corners_of(without_slivers(tee, 0.5, kept=kept)) == corners_of(tee)
    assert len(without_slivers(tee, 0.5).faces) < len(tee.faces)


def test_what_parts_share_with_the_free_space_is_as_booleans_say(tee):
    rng = np.random.default_rng(0)
    facets = tee.vertices[tee.faces[rng.integers(0, len(tee.faces), 300)]]
    parts = [corners.mean(axis=0) + rng.normal(0, 0.3, (8, 3)) for corners in facets]
    found = shared_m3(Facets(tee.vertices, tee.faces), parts, tee.inside.are_free)
    wanted = [(manifold3d.Manifold.hull_points(part) ^ tee.solid).volume() for part in parts]
    assert found == pytest.approx(np.array(wanted), abs=1e-12)
    assert (found > 0.01).sum() > 100


def test_a_part_that_no_facet_reaches_into_is_free_as_a_whole_or_not_at_all(tee):
    low = int(tee.vertices[:, 2].argmin())
    cube = 0.05 * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    under = tee.vertices[low] - [0, 0, 1.0] + cube
    middle = tee.vertices[tee.faces[tee.label == 0]].mean(axis=(0, 1)) + (cube + np.array([0, 0, 1.0]))
    places = [under, middle]
    found = shared_m3(Facets(tee.vertices, tee.faces), places, tee.inside.are_free)
    wanted = [(manifold3d.Manifold.hull_points(part) ^ tee.solid).volume() for part in places]
    assert found == pytest.approx(np.array(wanted), abs=1e-12)
    assert wanted == pytest.approx([0, 1e-3])
