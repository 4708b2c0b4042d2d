"""The certificate of a volume world: it holds for what was built, and a fault of each kind breaks its own clause."""

import dataclasses
import re

import manifold3d
import numpy as np
import pytest

from minexplore.floors.volume_arrays import FacetLabel
from pipeline.errors import GeometryError
from pipeline.export.scene import box_corners
from pipeline.metrics.limits import breaches
from pipeline.params.validation import Limit
from pipeline.proof.certificate import certify
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.parts import collect_labelled
from pipeline.volume.world.proof.certificate import _standing
from pipeline.volume.world.proof.compiled import compare_model
from pipeline.volume.world.proof.physics import RobotsAtRest
from tests.volume_worlds import CONFIG, HEADER, RAMP, VolumeWorld, legs_of_table, proof, validated

# A drift, a winze of 8 m at its middle, and a small drift at the foot of that.
WINZE = RAMP + "B,2,30,0,0,1,1,3,0\nB,4,30,0,-12,1,1,2,0\nC,4,30,0,-12,2,2,2.5,0\nC,5,30,9,-12,2,2,2.5,0\n"


# A chamber, and a drift of 0.78 m, 8 cm wider than a robot.
NARROW = (
    HEADER
    + "A,1,0,0.125,0,2,2,3,0\nA,2,5,0.125,0,2,2,3,0\nA,3,5.5,0.125,0,0.39,0.39,3,0\nA,4,30,0.125,0,0.39,0.39,3,0\n"
)


@pytest.fixture(scope="module")
def ramp(tmp_path_factory):
    return VolumeWorld(RAMP, tmp_path_factory.mktemp("ramp"))


@pytest.fixture(scope="module")
def opened(ramp):
    return ramp.opened()


def broken(found):
    """Return the names of the clauses that do not hold."""
    return {name for name, clause in found.certificate.clauses.items() if not clause.holds}


def with_parts(world, change):
    """Return a bundle with other corners of its parts; `change` returns those of a part, or None to leave it out."""
    kept = [(change(k, world.parts[k]), int(world.parts.label[k])) for k in range(len(world.parts))]
    kept = [(corners, label) for corners, label in kept if corners is not None]
    return dataclasses.replace(world, parts=collect_labelled([c for c, _ in kept], [label for _, label in kept]))


def test_the_certificate_of_what_was_built_holds_with_a_clause_for_every_limit_in_conf(ramp, opened):
    found = validated(opened, ramp.shape, robot_contacts=300, ball_contacts=300)
    assert broken(found) == set()
    of_legs = {name for name in CONFIG.validation.volume.limits if not name.startswith(("solid.", "drawn."))}
    assert set(found.certificate.clauses) == of_legs
    assert found.metrics["survey"]["length_m"] == pytest.approx(30 + np.hypot(30, 6), abs=1e-3)
    assert found.metrics["volume"]["free_m3"] == pytest.approx((4 * 1.8 + 3 * 1.2) * 60, rel=1e-6)
    assert found.certificate.contacts >= 300


def test_robots_drive_through_a_drift_that_is_little_wider_than_they_are(tmp_path):
    narrow = VolumeWorld(NARROW, tmp_path)
    figures = validated(narrow.opened(), narrow.shape, robot_contacts=300).metrics
    assert figures["reach"]["share"] > 0.3
    assert figures["drives"] == {"ways": 24, "share": 1.0}


def test_limits_apply_to_the_groups_that_are_measured_and_a_figure_that_a_group_lacks_does_not_hold(ramp, opened):
    limits = proof().applying(["survey", "enclosure"])
    assert {name.partition(".")[0] for name in limits} == {"survey", "enclosure"}
    quiet = validated(opened, ramp.shape)
    assert not {"robots.escapes", "robots.deepest_m", "balls.escapes", "standing.rest_mm"} & set(
        quiet.certificate.clauses
    )
    assert not certify("", {}, limits).holds


def test_a_certificate_for_which_no_ball_was_pushed_does_not_hold():
    limits = proof().applying(["balls.throws"])
    held = [certify("", {"balls.throws": throws, "balls.escapes": 0}, limits).holds for throws in (0, 1)]
    assert held == [False, True]


def test_a_part_that_is_left_out_leaves_its_surface_bare(ramp, opened):
    mutant = with_parts(opened, lambda k, corners: None if k == 0 else corners)
    found = validated(mutant, ramp.shape)
    assert broken(found) >= {"enclosure.gap_mm", "enclosure.thin_mm", "enclosure.unlike"}


def test_a_part_that_is_moved_into_the_free_space_intrudes(ramp, opened):
    floor = int(np.flatnonzero(opened.parts.label == FacetLabel.FLOOR)[0])
    mutant = with_parts(opened, lambda k, corners: corners + np.array([0, 0, 0.02]) if k == floor else corners)
    assert broken(validated(mutant, ramp.shape)) >= {"enclosure.intrusion_mm", "enclosure.unlike"}


def with_box(world, low, high):
    """Return a bundle with one more part, a box of rock from `low` to `high` (3,) m."""
    parts = [world.parts[k] for k in range(len(world.parts))]
    low_m, high_m = np.array(low, float), np.array(high, float)
    box = (low_m + high_m) / 2 + box_corners((high_m - low_m) / 2)
    more = collect_labelled([*parts, box], [*world.parts.label.tolist(), FacetLabel.WALL])
    return dataclasses.replace(world, parts=more)


@pytest.mark.parametrize(
    ("low", "high", "deepest_mm"),
    [
        ((10, -0.005, 6), (10.01, 0.005, 6.01), 10),  # a cubic centimetre on the floor
        ((10, -0.05, 6), (10.1, 0.05, 6.1), 100),
        ((10, -2, 6), (10.0003, 2, 9), 1500),  # a wall of 0.3 mm across the drift
        ((10, -0.005, 7.5), (10.01, 0.005, 7.51), 1500),  # in the air, where no facet is near
    ],
)
def test_a_small_part_anywhere_in_the_free_space_is_found_with_its_place(ramp, opened, low, high, deepest_mm):
    mutant = with_box(opened, low, high)
    found = validated(mutant, ramp.shape)
    assert broken(found) >= {"enclosure.intrusion_mm", "enclosure.unbacked"}
    figures = found.metrics["enclosure"]
    assert figures["intrusion_mm"] == pytest.approx(deepest_mm, rel=0.02)
    x, y, z = (float(word) for word in re.findall(r"-?[0-9.]+", figures["intrusion_at"]))
    assert (np.array([x, y, z]) > np.array(low) - 0.01).all()
    assert (np.array([x, y, z]) < np.array(high) + 0.01).all()


def test_a_part_deep_in_the_rock_lies_behind_no_facet(ramp, opened):
    found = validated(with_box(opened, (10, 30, 6), (11, 31, 7)), ramp.shape)
    assert {"enclosure.unbacked"} <= broken(found) <= {"enclosure.unbacked", "enclosure.unlike"}


@pytest.mark.parametrize("size_m", [0.02, 0.05, 0.14])
def test_a_hole_of_some_centimetres_in_one_part_is_found(ramp, opened, size_m):
    floor = int(np.flatnonzero(opened.parts.label == FacetLabel.FLOOR)[0])
    corners = opened.parts[floor]
    low, high = corners.min(axis=0), corners.max(axis=0)
    (x, y), half = (low[:2] + high[:2]) / 2, size_m / 2
    solid = manifold3d.Manifold.hull_points(corners)
    pieces = []
    for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):  # what is left about a square hole, as four convex parts
        way = np.zeros(3)
        way[axis] = sign
        rest = solid.trim_by_plane(way.tolist(), sign * (x, y)[axis] + half)
        for other in (1, -1) if axis == 1 else ():
            rest = rest.trim_by_plane([float(other), 0, 0], other * x - half)
        pieces.append(np.asarray(rest.to_mesh64().vert_properties)[:, :3])
    kept = [k for k in range(len(opened.parts)) if k != floor]
    parts = collect_labelled(
        [*(opened.parts[k] for k in kept), *pieces], [*opened.parts.label[kept].tolist(), 0, 0, 0, 0]
    )
    found = validated(dataclasses.replace(opened, parts=parts), ramp.shape)
    assert "enclosure.gap_mm" in broken(found)
    assert 1e3 * size_m - 0.2 <= found.metrics["enclosure"]["gap_mm"] <= 2e3 * size_m


def test_a_part_that_is_thinned_is_thinner_than_a_body_sinks_in(ramp, opened):
    roofs = np.flatnonzero(opened.parts.label == FacetLabel.ROOF)  # floors of the drift and the ramp are one part
    level = next(k for k in roofs.tolist() if np.ptp(opened.parts[k][:, 2]) == pytest.approx(0.3, abs=0.01))

    def thinned(k, corners):
        under = corners[:, 2].min()
        return np.column_stack([corners[:, :2], under + 0.05 * (corners[:, 2] - under)]) if k == level else corners

    assert broken(validated(with_parts(opened, thinned), ramp.shape)) >= {"enclosure.thin_mm"}


def test_a_facet_that_is_turned_over_encloses_no_space(ramp, opened):
    faces = opened.mine.faces.copy()
    faces[0] = faces[0][::-1]
    mutant = dataclasses.replace(opened, mine=dataclasses.replace(opened.mine, faces=faces))
    with pytest.raises(GeometryError, match="its mesh encloses no space"):
        validated(mutant, ramp.shape)


def test_a_leg_that_is_left_out_lowers_the_share_that_is_built(tmp_path, opened):
    longer = legs_of_table(RAMP + "A,4,90,0,-6,2,2,3,0\n", tmp_path)
    found = validated(opened, longer)
    assert "survey.share_built" in broken(found)
    assert found.metrics["survey"]["share_built"] == pytest.approx(60.594 / 90.594, abs=2e-3)


def test_a_floor_that_lies_over_the_survey_is_off_by_as_much(ramp, opened):
    volume = closed_volume(opened.mine)
    floor = np.unique(volume.faces[volume.label == FacetLabel.FLOOR])
    vertices = opened.mine.vertices.copy()
    vertices[floor, 2] += 0.03
    mutant = dataclasses.replace(opened, mine=dataclasses.replace(opened.mine, vertices=vertices))
    found = validated(mutant, ramp.shape)
    assert found.metrics["floor"]["error_mm"] == pytest.approx(30, abs=0.1)
    assert "floor.error_mm" in broken(found)
    leg, place = found.metrics["floor"]["error_at"].split(" at ")
    assert leg in {f"{leg.start} to {leg.end}" for leg in opened.legs.legs}
    x, y, z = map(float, re.findall(r"-?\d+\.\d\d", place))
    beside = np.hypot(*(vertices[floor, :2] - [x, y]).T) < 6
    assert np.abs(vertices[floor, 2] - z)[beside].min() < 1  # in the mine frame, as the mesh is


def test_a_model_whose_corners_are_rounded_is_unlike_its_parts(ramp, opened):
    rounded = re.sub(rb"(-?\d+\.\d)\d+", rb"\1", opened.model)
    found = validated(dataclasses.replace(opened, model=rounded), ramp.shape)
    assert broken(found) >= {"enclosure.compiled_mm", "enclosure.unlike"}


def test_a_model_without_a_part_or_with_a_geom_of_its_own_is_unlike_its_parts(ramp, opened):
    more = opened.model.replace(b"</body>", b'<geom name="more" type="box" size="1 1 1"/></body>', 1)
    assert validated(dataclasses.replace(opened, model=more), ramp.shape).metrics["enclosure"]["unlike"] > 0


def test_each_part_that_a_model_lacks_or_has_elsewhere_counts_once(ramp, opened):
    names = re.findall(rb'<geom name="(rock_\d+)"', opened.model)
    without_mesh = re.sub(rb'<mesh name="%b"[^>]*>' % names[0], b"", opened.model)
    without_geom = re.sub(rb'<geom name="%b"[^>]*>' % names[1], b"", opened.model)
    swapped = re.sub(rb'(<geom name="%b"[^>]*pos=")[^"]*' % names[2], rb"\g<1>1 2 3", opened.model)
    assert opened.model not in (without_mesh, without_geom, swapped)
    for model in (without_mesh, without_geom, swapped):
        found = compare_model(model, opened.parts, opened.record.zones, 20, np.random.default_rng(0))
        assert found.unlike == 1
    assert compare_model(opened.model, opened.parts, opened.record.zones, 20, np.random.default_rng(0)).unlike == 0


def test_a_robot_that_starts_in_a_pit_reaches_little_of_the_largest_floor(tmp_path):
    world = VolumeWorld(WINZE, tmp_path)
    opened = world.opened()
    whole = validated(opened, world.shape).metrics["reach"]["share"]
    foot = dataclasses.replace(opened.record.spawn, anchor_m=(30.0, 5.0, opened.record.volume.low_m))
    pit = validated(dataclasses.replace(opened, record=dataclasses.replace(opened.record, spawn=foot)), world.shape)
    assert whole > 0.5 > pit.metrics["reach"]["share"]
    found = validated(opened, world.shape).metrics["reach"]["of_largest"], pit.metrics["reach"]["of_largest"]
    assert found[0] == 1 > found[1] > 0


def test_robots_do_not_come_to_the_ends_of_ways_that_rock_stands_across(ramp, opened):
    assert validated(opened, ramp.shape, robot_contacts=1).metrics["drives"] == {"ways": 24, "share": 1.0}
    ridges = [np.array([x, 0, -2.0]) + box_corners(np.array([0.05, 2.0, 6.0])) for x in np.arange(0.6, 60, 0.8)]
    parts = [opened.parts[k] for k in range(len(opened.parts))] + ridges
    label = [*opened.parts.label.tolist(), *[int(FacetLabel.WALL)] * len(ridges)]
    mutant = dataclasses.replace(opened, parts=collect_labelled(parts, label))
    found = validated(mutant, ramp.shape, robot_contacts=1)
    assert "drives.share" in broken(found)
    assert found.metrics["drives"]["share"] < 0.8  # ways across the drift are free


def test_robots_and_balls_escape_where_the_largest_wall_is_left_out(ramp, opened):
    walls = np.flatnonzero(opened.parts.label == FacetLabel.WALL)
    largest = max(walls.tolist(), key=lambda k: float(np.prod(np.sort(np.ptp(opened.parts[k], axis=0))[1:])))
    mutant = with_parts(opened, lambda k, corners: None if k == largest else corners)
    found = validated(mutant, ramp.shape, robot_contacts=6000, ball_contacts=3000)
    assert broken(found) >= {"robots.escapes", "balls.escapes"}


def test_the_message_of_robots_that_do_not_rest_names_the_robot_and_its_place():
    figures = {"standing": _standing(RobotsAtRest(0.0123, 1.0, 0.0, (4, (68.45, 12.117, 0.035))))}
    assert breaches(figures, {"standing.rest_mm": Limit(max=10)}) == [
        "standing.rest_mm = 12.3: limit <= 10, robot 5 of 12 at (68.45, 12.12, 0.04) m"
    ]
