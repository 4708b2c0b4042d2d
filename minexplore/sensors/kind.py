"""What a sensor is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, ClassVar
from zlib import crc32

import gymnasium
import numpy as np

from minexplore.sensing.mount import Mount, Pose3D

if TYPE_CHECKING:
    from minexplore.sensors.ros import RosMessage
    from minexplore.sensors.sensed_robot import SensedRobot

KINDS: list[type[SensorKind]] = []  # all that were defined; `minexplore.sensors.table` imports those of the package


class SensorKind(ABC):
    """A sensor on one robot, or several that share their parts, as the images of one camera do.

    A subclass in a module of `minexplore.sensors.kinds` is a sensor of every environment: its `names()` are choices of
    `sensors=` and `capture`, recordings hold its `messages`, and the environment's page has its row.
    """

    # Attributes that `begin` and `read` set; copies of an environment copy them.
    CHANGES: ClassVar[tuple[str, ...]] = ()

    @classmethod
    @abstractmethod
    def names(cls) -> tuple[str, ...]:
        """Return the names of its readings, as `sensors=` takes them."""

    @classmethod
    @abstractmethod
    def space(cls, name: str) -> gymnasium.spaces.Box:
        """Return the space of a reading in an observation."""

    @classmethod
    @abstractmethod
    def gives(cls, name: str) -> str:
        """Return what `capture` gives, for the environment's page."""

    def __init_subclass__(cls) -> None:
        """Add the sensor to the table."""
        KINDS.append(cls)

    def __init__(self, robot: SensedRobot) -> None:
        """Take the robot that carries it; what is costly is made when a reading is first asked for."""
        self.robot = robot

    def begin(self, rng: np.random.Generator) -> None:  # noqa: B027  most draw nothing
        """Begin an episode. What draws, here or in `read`, draws from `own_rng(rng)`: other sensors' numbers stay.

        The sensors of this package draw from `rng` itself: published results have their numbers.
        """

    def own_rng(self, rng: np.random.Generator) -> np.random.Generator:
        """Return a generator for this kind of sensor in this episode; `rng` is that of `begin`, and stays as it is."""
        name = f"{type(self).__module__}.{type(self).__qualname__}".encode()
        return np.random.default_rng([rng.bit_generator.state["state"]["state"], crc32(name)])

    @abstractmethod
    def read(self, name: str, rng: np.random.Generator) -> Any:
        """Return what the sensor reads now; `rng` is that of all sensors of the robot."""

    def observed(self, name: str, reading: Any) -> np.ndarray:
        """Return a reading as an array of its space, clipped: a beam that hits nothing must be 0 here, not infinite."""
        space = self.space(name)
        found: np.ndarray = np.clip(reading, space.low, space.high).astype(space.dtype)
        return found

    def mount(self, name: str) -> Mount:
        """Return where the sensor is on the robot."""
        return Mount(height_m=0.0)

    def frames(self, name: str) -> dict[str, Pose3D]:
        """Return the frames of its messages, with their poses in that of the robot's origin, `base_link`."""
        return {}

    def messages(self, name: str, time_ns: int, reading: Any) -> Iterable[RosMessage]:
        """Return the ROS 2 messages of a reading; none by default."""
        return ()

    def close(self) -> None:  # noqa: B027  most hold nothing
        """Free what the sensor holds."""
