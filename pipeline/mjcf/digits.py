"""How many digits MuJoCo writes: six hold a millimetre to 1 km from the origin, and workings may reach farther."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import mujoco

from pipeline.errors import ArtifactError

_DIGITS, _HOLD_M = 6, 1000.0


@contextmanager
def digits_for(reach_m: float) -> Iterator[None]:
    """Let `MjSpec.to_xml` write a millimetre of coordinates up to `reach_m`; below 1 km nothing changes.

    MuJoCo has no public setting for it; its library exports the one that its own tests use.

    Raises
    ------
    ArtifactError
        If more than six digits are needed and this MuJoCo has no such setting.
    """
    if reach_m < _HOLD_M:
        yield
        return
    try:
        setting = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco.*"))))
        write = setting._mjPRIVATE__set_xml_precision
    except (AttributeError, OSError, StopIteration) as error:
        raise ArtifactError(
            f"mine.xml: MuJoCo {mujoco.__version__} writes six digits, too few for workings that reach {reach_m:.0f} m "
            f"from the mine's origin; state a nearer one (survey.origin)"
        ) from error
    write(_DIGITS + math.floor(math.log10(reach_m / _HOLD_M)) + 2)  # tenths of it, as nearer by
    try:
        yield
    finally:
        write(_DIGITS)
