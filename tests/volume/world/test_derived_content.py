"""What a volume's bundle states beside mesh and parts is made again, and one changed value is named."""

import dataclasses
import shutil

import manifold3d
import numpy as np
import pytest
import trimesh

from minexplore.bundle import OCTREE
from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from pipeline.errors import ArtifactError
from pipeline.volume.world.content import closed_volume, labels_by_place, with_settled_labels
from pipeline.volume.world.parts import collect_labelled
from pipeline.volume.world.proof.again.labelled import _beyond_legs_m, require_labelled
from pipeline.volume.world.proof.alone import certify_alone, survey_alone
from pipeline.volume.world.proof.derived_content import require_remade
from pipeline.volume.world.proof.fronts import fronts_of
from tests.mines import put
from tests.volume_worlds import RAMP, VolumeWorld, proof

TEE = RAMP + "B,2,30,0,0,2,2,3,0\nB,4,30,12,0,2,2,3,0\n"
OF_SPANS = ("column", "row", "floor_m", "headroom_m", "clearance_m", "storey", "aside_m", "way_m")


@pytest.fixture(scope="module")
def tee(tmp_path_factory):
    return VolumeWorld(TEE, tmp_path_factory.mktemp("tee"))


@pytest.fixture(scope="module")
def opened(tee):
    return tee.opened()


@pytest.fixture(scope="module")
def solid(tmp_path_factory):
    shape = manifold3d.Manifold.cube([40, 4, 3]) + manifold3d.Manifold.cube([4, 24, 3]).translate([18, 0, 0])
    mesh = shape.to_mesh64()
    path = tmp_path_factory.mktemp("solid") / "drift.stl"
    trimesh.Trimesh(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts)).export(path)
    return VolumeWorld.from_solid(path)


def changed(world, name, **arrays):
    """Return a bundle of which some arrays have changed: each change takes a copy."""
    whole = getattr(world, name)
    new = {key: change(getattr(whole, key).copy()) for key, change in arrays.items()}
    return dataclasses.replace(world, **{name: dataclasses.replace(whole, **new)})


def add(amount):
    """Return a change by an amount."""
    return lambda array: array + amount


def legs_with(world, **fields):
    return dataclasses.replace(world, legs=dataclasses.replace(world.legs, **fields))


def first_leg(world, **fields):
    return legs_with(world, legs=[dataclasses.replace(world.legs.legs[0], **fields), *world.legs.legs[1:]])


def moved_start(world, *by):
    spawn = world.record.spawn
    anchor = tuple(a + b for a, b in zip(spawn.anchor_m, by, strict=True))
    return dataclasses.replace(
        world, record=dataclasses.replace(world.record, spawn=dataclasses.replace(spawn, anchor_m=anchor))
    )


def of_volume(world, **fields):
    volume = dataclasses.replace(world.record.volume, **fields)
    return dataclasses.replace(world, record=dataclasses.replace(world.record, volume=volume))


def test_what_the_builder_writes_is_made_again_with_its_survey_and_without(tee, opened):
    require_remade(tee.bundle, opened, proof(), tee.shape, tee.shape)
    stated = survey_alone(opened, proof())
    assert stated is not None
    require_remade(tee.bundle, opened, proof(), stated)


def test_a_solid_is_made_again_and_certified_without_its_file(solid):
    """Its legs follow its floors: they are no survey, and floors were held to them nevertheless."""
    world = solid.opened()
    assert world.mine.leg.any()
    assert survey_alone(world, proof()) is None
    require_remade(solid.bundle, world, proof(), None, solid.shape)
    found = certify_alone(world, proof())
    assert found.holds
    assert not [name for name in found.clauses if name.startswith("floor.")]


def test_legs_of_one_number_do_not_make_a_survey_a_solid(opened):
    one = changed(opened, "mine", leg=lambda leg: leg * 0)
    assert any(name.startswith("floor.") for name in certify_alone(one, proof()).clauses)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda w: changed(w, "cells", storey=put(40, -1)), r"cells\.npz: storey\[40\] = -1, want 0"),
        (lambda w: changed(w, "cells", floor_m=put(7, 0.5)), r"cells\.npz: floor_m\[7\] = 0\.5, want"),
        (lambda w: changed(w, "cells", headroom_m=add(-0.01)), r"cells\.npz: headroom_m\[0\]"),
        (lambda w: changed(w, "cells", clearance_m=add(0.5)), r"cells\.npz: clearance_m\[0\].* of \d+ differ"),
        (lambda w: changed(w, "cells", aside_m=put((7, 1), 0.2)), r"cells\.npz: aside_m\[7, 1\] = 0\.2"),
        (lambda w: changed(w, "cells", way_m=put((7, 0), 9.0)), r"cells\.npz: way_m\[7, 0\] = 9\.0"),
        (lambda w: changed(w, "cells", origin_m=add(0.25)), r"cells\.npz: origin_m\[0\]"),
        (
            lambda w: changed(w, "cells", **dict.fromkeys(OF_SPANS, lambda a: a[1:])),
            r"cells\.npz: \d+ spans, want",
        ),
        (lambda w: first_leg(w, end="4"), r"topology\.json: legs\[0\]\.end = 4, want 2"),
        (lambda w: first_leg(w, length_m=7.0), r"topology\.json: legs\[0\]\.length_m = 7\.0, want 30"),
        (lambda w: first_leg(w, grade=0.3), r"topology\.json: legs\[0\]\.grade = 0\.3, want 0"),
        (lambda w: legs_with(w, loops=3), r"topology\.json: loops = 3, want 0"),
        (lambda w: legs_with(w, junctions=[]), r"topology\.json: junctions has 0 entries, want 1"),
        (lambda w: changed(w, "mine", leg=lambda a: a * 0), r"volume\.npz: leg\[\d+\]"),
        (lambda w: changed(w, "mine", label=lambda a: a * 0), r"cells\.npz: clearance_m\[0\] = .* want 1000"),
        (lambda w: moved_start(w, 0, 0, 0.5), r"world\.json: spawn\.anchor_m"),
        (lambda w: moved_start(w, 0, 1.5, 0), r"world\.json: spawn\.anchor_m"),
        (lambda w: of_volume(w, closed_ends=[]), r"world\.json: closed_ends has 0 entries, want 3"),
        (lambda w: of_volume(w, built_m=20.0), r"world\.json: built_m = 20\.0, want"),
        (lambda w: of_volume(w, datum_m=5.0), r"world\.json: datum_m = 5\.0, want"),
    ],
)
def test_a_value_that_is_not_what_the_mesh_and_the_survey_give_is_named(tee, opened, change, message):
    with pytest.raises(ArtifactError, match=message):
        require_remade(tee.bundle, change(opened), proof(), tee.shape, tee.shape)


def test_an_octree_or_a_map_of_other_floors_is_named(tee, opened, tmp_path):
    for name in (OCTREE, "map_00.yaml"):
        folder = tmp_path / name
        shutil.copytree(tee.bundle, folder)
        data = bytearray((folder / name).read_bytes())
        data[-4] ^= 1
        (folder / name).write_bytes(bytes(data))
        with pytest.raises(ArtifactError, match=f"{name}: not the"):
            require_remade(folder, opened, proof(), tee.shape, tee.shape)
    fewer = {name: digest for name, digest in opened.record.files.items() if name != "map_00.png"}
    without = dataclasses.replace(opened, record=dataclasses.replace(opened.record, files=fewer))
    with pytest.raises(ArtifactError, match=r"map_00\.png: missing; cells\.npz has a storey 0"):
        require_remade(tee.bundle, without, proof(), tee.shape, tee.shape)


def test_a_long_facet_of_a_floor_that_legs_share_is_about_its_leg_at_a_corner(opened):
    leg = opened.legs.legs[0]
    start, end = (np.array(opened.legs.stations_m[name]) for name in (leg.start, leg.end))
    along = (end - start) / np.linalg.norm(end - start)
    corners = start + np.outer([0.0, -9.0, -9.0], along) + np.array([[0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]])
    one = VolumeFacets(corners, np.array([[0, 2, 1]], np.int32), np.zeros(1, np.int32), np.zeros(1, np.int32))
    assert _beyond_legs_m(dataclasses.replace(opened, mine=one))[0] < 0  # its middle is 6 m beyond
    away = dataclasses.replace(one, vertices=corners - 9 * along)
    assert _beyond_legs_m(dataclasses.replace(opened, mine=away))[0] > 2


def test_a_floor_facet_is_no_wall_whichever_leg_it_is_given_to(tee, opened):
    mine = opened.mine
    size = np.linalg.norm(mine.normals, axis=1)
    floor = int(np.where(mine.label == FacetLabel.FLOOR, size, 0).argmax())
    for leg in range(len(opened.legs.legs)):
        label, owner = mine.label.copy(), mine.leg.copy()
        label[floor], owner[floor] = FacetLabel.WALL, leg
        changed = dataclasses.replace(opened, mine=dataclasses.replace(mine, label=label, leg=owner))
        with pytest.raises(ArtifactError, match=rf"label\[{floor}\] = {FacetLabel.WALL:d}"):
            require_labelled(tee.bundle, changed, False, proof())


@pytest.mark.parametrize(
    ("size_m", "over_m", "up", "before", "after"),
    [
        (0.2, 0.05, -0.4, FacetLabel.WALL, FacetLabel.FLOOR),  # on the floor of a leg that passes over its own
        (0.1, 0.05, -0.4, FacetLabel.WALL, FacetLabel.WALL),  # a sliver
        (0.2, 0.05, -0.2, FacetLabel.WALL, FacetLabel.WALL),
        (0.2, 0.5, -0.4, FacetLabel.WALL, FacetLabel.WALL),  # a ledge
        (0.2, 0.05, -0.2, FacetLabel.FLOOR, FacetLabel.FLOOR),  # the side of a slab
        (0.2, 0.05, 0.1, FacetLabel.FLOOR, FacetLabel.WALL),  # rock that hangs is no floor
        (0.2, 2.0, 0.8, FacetLabel.WALL, FacetLabel.ROOF),
        (0.2, 2.0, 0.8, FacetLabel.FLOOR, FacetLabel.ROOF),
    ],
)
def test_labels_settle_by_slope_and_by_the_floors_of_all_legs(opened, size_m, over_m, up, before, after):
    legs = opened.legs
    there, own = legs.legs[-1], 0
    floors = np.array([legs.stations_m[name] for name in (there.start, there.end)])
    floors[:, 2] -= np.array(there.lrud_m)[:, 3]
    corners = size_m * np.array([[0.0, 0, 0], [1, 0, 0], [0, -up, np.sqrt(1 - up * up)]])
    corners += floors.mean(axis=0) + np.array([0, 0, over_m]) - corners.mean(axis=0)
    facet = VolumeFacets(
        corners, np.array([[0, 2, 1]], np.int32), np.array([before], np.int32), np.array([own], np.int32)
    )
    assert facet.normals[0, 2] / np.linalg.norm(facet.normals[0]) == pytest.approx(up)
    settled = with_settled_labels(facet, legs)
    label, is_sliver = labels_by_place(settled, legs)
    assert settled.label.tolist() == [after]
    assert is_sliver.all() or label.tolist() == [after]  # what has settled stays


def test_a_floor_part_in_two_zones_and_a_part_with_twin_corners_are_named(tee, opened):
    parts = [opened.parts[k] for k in range(len(opened.parts))]
    floor = int(np.flatnonzero(opened.parts.label == FacetLabel.FLOOR)[0])
    border = opened.record.zones[0].east_m
    across = np.array([[border + x, y, z] for x in (-1, 1) for y in (0, 1) for z in (-0.3, 0.0)])
    wide = collect_labelled(
        [across if k == floor else part for k, part in enumerate(parts)], opened.parts.label.tolist()
    )
    twins = opened.parts.corners.copy()
    twins[1] = twins[0] + 1e-8
    for changed_parts, message in (
        (wide, "is in two zones of the floor"),
        (dataclasses.replace(opened.parts, corners=twins), "part 0 has two corners within 1e-06 m"),
    ):
        with pytest.raises(ArtifactError, match=message):
            require_remade(tee.bundle, dataclasses.replace(opened, parts=changed_parts), proof(), tee.shape)


def test_parts_with_another_label_than_their_facets_are_counted(opened):
    volume = closed_volume(opened.mine)
    assert fronts_of(volume, opened.parts).mislabelled == 0
    label = opened.parts.label.copy()
    floor = np.flatnonzero(label == FacetLabel.FLOOR)[:3]
    label[floor] = FacetLabel.WALL
    assert fronts_of(volume, dataclasses.replace(opened.parts, label=label)).mislabelled == len(floor)
    walls = np.where(opened.parts.label == FacetLabel.ROOF, FacetLabel.WALL, opened.parts.label)
    roofs = int((opened.parts.label == FacetLabel.ROOF).sum())
    assert fronts_of(volume, dataclasses.replace(opened.parts, label=walls)).mislabelled == roofs
