"""Worlds whose mine frame counts from kilometres away."""

import numpy as np
import pytest
import shapely
from shapely.affinity import rotate, translate

from minexplore.bundle import GeomGroup
from pipeline.compose import compose
from pipeline.errors import ArtifactError
from pipeline.mjcf import digits
from pipeline.mjcf.bundle import open_bundle, part_vertices
from pipeline.mjcf.digits import digits_for
from pipeline.proof.consistency import measure_consistency
from tests.mines import BuiltMine


def test_a_mine_kilometres_from_its_origin_keeps_its_millimetres(tmp_path):
    far = translate(rotate(shapely.box(0, 0, 40, 6), 21.0), 5123.4567, 7654.3219)
    coarse = compose(["surface.rough.spacing_m=0.5", "surface.rough.roof_spacing_m=0.5"])
    mine = BuiltMine(far, coarse, tmp_path / "world")
    world = open_bundle(mine.bundle)
    assert measure_consistency(mine.bundle, world, mine.free_space)["frame_error_m"] < 0.001
    built = np.concatenate(part_vertices(world.model, GeomGroup.COLLISION))
    asked = np.concatenate(list(mine.compiled["collision"]))
    assert np.abs(np.sort(built, axis=0) - np.sort(asked, axis=0)).max() < 0.00015


def test_a_mujoco_that_writes_six_digits_alone_is_said(monkeypatch):
    monkeypatch.setattr(digits.ctypes, "CDLL", lambda path: object())
    with digits_for(999.0):
        pass
    with (
        pytest.raises(ArtifactError, match=r"six digits, too few for workings that reach 1200 m.*survey\.origin"),
        digits_for(1200.0),
    ):
        pass
