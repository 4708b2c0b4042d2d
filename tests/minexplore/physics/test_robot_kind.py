"""What every kind of robot has to state."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from minexplore.physics.robot_kind import DrivenRobot


@dataclass(frozen=True)
class Sledge(DrivenRobot):
    """A kind that states neither its lamp, nor its controls, nor how it is attached."""

    radius_m: float = 0.3


def test_a_kind_of_robot_that_leaves_out_what_each_needs_is_refused_when_it_is_made():
    with pytest.raises(TypeError, match=r"attach.*controls.*lamp_height_m"):
        Sledge()
