"""From a mine survey to a validated MuJoCo world: the library behind the six stages."""

__version__ = "0.1.0"
