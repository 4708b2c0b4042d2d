"""The rock of a volume over a level floor: texture and relief as of a level mine, whatever its drifts' heights are."""

import dataclasses

import numpy as np
import pytest

from minexplore.bundle import ROOF, WALLS
from minexplore.floors.volume_arrays import FacetLabel
from pipeline.metrics.limits import breaches, flatten
from pipeline.metrics.rock.relief import angles_to_deg
from pipeline.proof.groups import applying_limits, why_rock_is_not_judged
from pipeline.proof.texture import measure_flat_texture, part_of
from pipeline.types import Mesh
from pipeline.volume.world.proof.certificate import open_volume
from pipeline.volume.world.proof.levelled import level_rock_of, measure_volume_texture
from tests.volume_worlds import HEADER, WITH_ROCK, VolumeWorld, with_rock
from tests.volumes import BOX

PARAMS = WITH_ROCK.validation
SMALL = part_of(PARAMS.texture, 4)  # of a small world
# Two drifts 4 m wide over each other; a ramp of 17 % joins their ends.
STOREYS = HEADER + (
    "A,1,0,0,0,2,2,3,0\nA,2,40,0,0,2,2,3,0\nA,3,40,40,-7,2,2,3,0\nA,4,0,40,-14,2,2,3,0\nA,5,0,-10,-14,2,2,3,0\n"
)
RISE = np.array([0.12, 0.0])  # a metre east, along the drift, and north: floors of drifts are level across


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    """A drift of 20 m, 4 m wide, with visible rock."""
    return open_volume(with_rock(BOX, tmp_path_factory.mktemp("box")) / "rocky")


def figures_of(world):
    found = measure_volume_texture(world, SMALL)
    return found, flatten(found.metrics)


def lifted(points):
    """Return points (n, 3) m on a plane that rises."""
    return points + np.column_stack([np.zeros((len(points), 2)), points[:, :2] @ RISE])


def on_a_slope(world):
    """Return a world whose floor rises and whose walls stay plumb."""
    legs, cells, mine = world.legs, world.cells, world.mine
    places = {name: tuple(lifted(np.array([place]))[0].tolist()) for name, place in legs.stations_m.items()}
    floor_m = lifted(cells.places_m)[:, 2]
    return dataclasses.replace(
        world,
        rock={name: dataclasses.replace(mesh, vertices=lifted(mesh.vertices)) for name, mesh in world.rock.items()},
        legs=dataclasses.replace(legs, stations_m=places),
        cells=dataclasses.replace(cells, floor_m=floor_m),
        mine=dataclasses.replace(mine, vertices=lifted(mine.vertices)),
    )


def smoothed(world):
    """Return a world whose visible rock is the volume's own facets."""
    rock = {}
    for name, label in ((WALLS, FacetLabel.WALL), (ROOF, FacetLabel.ROOF)):
        faces = world.mine.faces[world.mine.label == label][:, ::-1]
        rock[f"{name}_00_00"] = Mesh(world.mine.vertices, faces, np.zeros((len(world.mine.vertices), 2)))
    return dataclasses.replace(world, rock=rock)


def test_rock_keeps_the_limits_of_a_level_mine_and_smooth_rock_breaks_them(box):
    _, figures = figures_of(box)
    limits = {name: limit for name, limit in PARAMS.limits.items() if name.startswith(("texture.", "relief.steep"))}
    assert len(limits) > 15  # slopes of spectra need longer walls
    assert breaches(figures, limits) == []
    assert figures["texture.strict.overall"] > 0.5
    smooth, of_smooth = figures_of(smoothed(box))
    assert smooth.texture.strict.overall < 0.2
    broken = {line.split()[0] for line in breaches(of_smooth, limits)}
    assert {"texture.bump_ratio", "texture.published.wall_jaggedness_deg", "texture.rq_ratio.at_20_cm"} <= broken


def test_facets_that_are_seen_score_as_the_smooth_surface(box):
    rock = level_rock_of(smoothed(box))
    seen = measure_flat_texture(dataclasses.replace(rock, smooth=rock.rough), SMALL).as_is
    for axis, value in measure_flat_texture(rock, SMALL).as_is.items():
        assert seen[axis] == pytest.approx(value, rel=0.1, abs=1e-3), axis


def test_a_floor_that_rises_changes_no_figure(box):
    _, level = figures_of(box)
    _, risen = figures_of(on_a_slope(box))
    same = ("texture.measured_strict.", "texture.rq_ratio.at_", "relief.steep", "relief.cut.at_100_cm.length")
    compared = {name: value for name, value in level.items() if name.startswith(same) and "wavelength" not in name}
    assert len(compared) > 15  # a wavelength is one of few that a drift of 20 m has, whatever its slope
    for name, value in compared.items():
        assert risen[name] == pytest.approx(value, rel=0.01 if name.startswith("relief") else 0.1), (
            name
        )  # other random points


def test_storeys_stand_side_by_side_over_one_floor(tmp_path):
    built = VolumeWorld(STOREYS, tmp_path)
    world = built.opened()
    smooth = level_rock_of(smoothed(world))
    assert world.record.volume.storeys > 1
    floors = smooth.drifts.free
    areas = world.mine.normals[world.mine.label == FacetLabel.FLOOR][:, 2]
    assert floors.area == pytest.approx(-areas.sum() / 2, rel=0.03)  # nothing lies over another floor
    walls, roof = smooth.rough(WALLS), smooth.rough(ROOF)
    assert walls[:, :, 2].min() > -0.3
    assert np.median(roof[:, :, 2]) == pytest.approx(3.5, abs=0.05)
    assert smooth.drifts.length_m == pytest.approx(world.legs.total_length_m, abs=0.1)
    plumb, normals = smooth.plumb()
    assert 0 < len(plumb) < len(walls)  # over 0.6 of the height walls lean in
    angle, _ = angles_to_deg(plumb, normals)
    assert angle.max() < 10


def test_without_a_floor_that_robots_drive_on_nothing_is_measured(box):
    nowhere = dataclasses.replace(box.cells, storey=np.full_like(box.cells.storey, -1))
    assert measure_volume_texture(dataclasses.replace(box, cells=nowhere), PARAMS.texture) is None
    assert measure_volume_texture(dataclasses.replace(box, rock={}), PARAMS.texture) is None


@pytest.mark.parametrize(
    ("figures", "judged", "why"),
    [
        ({"topology.drift_m": 96.0, "texture.draws": 1}, True, None),
        ({"topology.drift_m": 95.0, "texture.draws": 1}, False, "95 m of drift, 2.5 m high or more, are too few"),
        ({"topology.drift_m": 300.0, "texture.draws": 2, "solid.iou": 1.0}, False, "the solid has its own relief"),
        ({"topology.drift_m": 300.0, "texture.draws": 2, "solid.iou": 1.0, "drawn.floor_mm": 0.0}, True, None),
        ({"topology.drift_m": 300.0, "texture.draws": 2, "relief.spacing_m": 0.15}, True, None),
        ({"topology.drift_m": 300.0, "texture.draws": 2, "relief.spacing_m": 0.18}, False, "0.18 m apart, too far to"),
        ({}, False, None),
    ],
)
def test_rock_is_judged_in_long_mines_that_were_surveyed_or_drawn(figures, judged, why):
    figures = {"volume.free_m3": 100.0, "rock.shown": 1, **figures}
    limits = applying_limits(PARAMS, figures)
    assert any(name.startswith(("texture.", "relief.")) for name in limits) == judged
    assert "rock.shown" in limits
    assert not any(name.startswith(("walls.", "topology.", "per_m2.")) for name in limits)
    assert not any(name.endswith(".length_ratio") for name in limits)
    assert any(name.endswith(".length_ratio") for name in applying_limits(PARAMS, {"topology.drift_m": 300.0}))
    assert not any(".slope." in name for name in limits)  # of a spectrum that a short mine has too few windows for
    if judged:
        assert any(".slope." in name for name in applying_limits(PARAMS, {**figures, "topology.drift_m": 480.0}))
    level = {"topology.drift_m": 96.0}
    assert any(".slope." in name for name in applying_limits(PARAMS, level))
    assert not any(".slope." in name for name in applying_limits(PARAMS, {**level, "relief.spacing_m": 0.18}))
    found = why_rock_is_not_judged(PARAMS, figures)
    assert (found is None) == (why is None)
    assert why is None or why in found
