"""The expected errors. Every message names the thing, the value and the limit."""

from __future__ import annotations

import numpy as np


class MineError(Exception):
    """Base of all expected errors; a command prints the message and exits with code 2."""


class InputError(MineError):
    """An input file (plan, scale bar, survey, poses) cannot be used."""


class DoubtError(InputError):
    """A plan's workings are not found beyond doubt; `picture` (rows, cols, 3) uint8 shows what was found."""

    def __init__(self, message: str, picture: np.ndarray) -> None:
        super().__init__(message)
        self.picture = picture


class UnexpectedError(InputError):
    """A library raised an exception while it read a file, and the reader does not name that exception."""


class ParamsError(MineError):
    """An override or a configuration value is unknown or out of range."""


class GeometryError(MineError):
    """A geometric precondition or invariant does not hold."""


class ArtifactError(MineError):
    """An artifact is missing, broken, or different from its manifest."""


class LimitError(MineError):
    """A measured value breaches its limit in `conf/validation`."""
