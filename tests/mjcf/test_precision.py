"""Places in `mine.xml` hold every digit: the mine frame of the model is that of `world.json`."""

import mujoco
import numpy as np
import pytest
import shapely
from shapely.affinity import rotate, translate

from minexplore.bundle import GeomGroup
from pipeline.mjcf.bundle import OpenedBundle, mine_from_body, open_bundle, part_vertices, placed_parts
from tests.composed import compose
from tests.mines import BuiltMine


def frame_error_m(world: OpenedBundle) -> float:
    """Return the largest distance, m, between the mine's corners in the model and in the record's frame."""
    west, south, east, north = world.record.world_m
    corners = np.array([[x, y, 0.0] for x in (west, east) for y in (south, north)])
    T = mine_from_body(world.model, np.array(world.record.T_world_mine))
    return float(np.abs(corners @ T[:3, :3].T + T[:3, 3] - corners).max())


def test_the_models_mine_frame_is_that_of_the_record_to_a_nanometre(tee):
    world = open_bundle(tee.bundle)
    assert frame_error_m(world) < 1e-9


def test_parts_are_placed_by_the_stated_frame_and_not_by_the_models():
    xml = """<mujoco><worldbody><body name="mine" pos="1 2 3" quat="0 0 0 1">
    <geom type="box" size="1 2 3" pos="10 0 0" group="3"/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    (own,) = part_vertices(model, 3)
    (placed,) = placed_parts(model, 3, np.eye(4))
    assert own.min(axis=0) == pytest.approx([9, -2, -3])
    assert placed.min(axis=0) == pytest.approx([1 - 11, 2 - 2, 3 - 3])  # half a turn about z, then to (1, 2, 3)
    assert placed.max(axis=0) == pytest.approx([1 - 9, 2 + 2, 3 + 3])


def test_a_mine_kilometres_from_its_origin_keeps_its_hundredths_of_a_millimetre(tmp_path):
    far = translate(rotate(shapely.box(0, 0, 40, 6), 21.0), 5123.4567, 7654.3219)
    coarse = [f"surface.rough.{name}=0.5" for name in ("spacing_m", "roof_spacing_m")]
    config = compose([*coarse, "surface.texture.size_px=64", "realism.preview_width_px=64"])
    mine = BuiltMine(far, config, tmp_path / "world")
    world = open_bundle(mine.bundle)
    assert frame_error_m(world) < 1e-9
    built = np.concatenate(part_vertices(world.model, GeomGroup.COLLISION))
    asked = np.concatenate(list(mine.compiled["collision.npz"]))
    assert np.abs(np.sort(built, axis=0) - np.sort(asked, axis=0)).max() < 1e-5
