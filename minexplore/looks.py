"""How a world looks: light, haze and sheen of its rock, by the name that `world.json` states under `look`.

The values were chosen by eye on rendered pictures (docs/how-to/look.md); none of them
is measured, and none changes what a robot can touch or what its LiDAR sees.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

EXTENT_M = 10.0  # of every world; MuJoCo states the haze in multiples of it
PLAIN = "plain"
NO_HAZE_M = (30.0, 100.0)  # MuJoCo's own values, which a plain world keeps
LAMP_CUTOFF_DEG = 45.0  # half of a headlamp's cone
CUT_MATERIAL, CUT_RGBA = "cut", (0.8, 0.72, 0.64, 1.0)  # rock's collision parts, seen from above in a cut-away view
# Colour and highlight of each kind of furniture; colour and reflectance of water. Clear planes darken ruts and hollows
# step by step: their colour, which MuJoCo lays on twice a plane, and their heights as shares of the water's. The first
# share is a power of two, so that the water's height follows from it without rounding.
FURNITURE_LOOKS = {
    "bolts": ((0.66, 0.63, 0.58, 1.0), 0.4),
    "cable": ((0.06, 0.06, 0.07, 1.0), 0.2),
    "duct": ((0.62, 0.47, 0.2, 1.0), 0.05),
    "pipe": ((0.36, 0.38, 0.4, 1.0), 0.3),
    "weldmesh": ((0.5, 0.48, 0.44, 1.0), 0.3),
}
WATER = ((0.05, 0.055, 0.05, 1.0), 0.35)
SHADE, SHADE_LEVELS = (0.0, 0.0, 0.0, 0.035), (0.5, 0.65, 0.8, 0.95, 1.1, 1.25)
_COVER_GAIN, _GREYED = 2.6, 0.6  # the texture, whose mean is 0.5, darkens the zone's colour; muck is mostly grey
_MUCK = (1.1, 1.0, 0.88)
TEXTURE_PER_M = 0.4  # repeats of the texture on the floor


@dataclass(frozen=True)
class Look:
    """Colours are RGB from 0 to 1.

    `ambient` and `diffuse` are the viewer's own light, `glint` its highlight on wet rock. Haze of colour `haze_rgb`
    begins and is complete at distances of `haze_m` (m). `specular` and `shininess` are those of the rock, `lamp_rgb` is
    the headlamp of a robot.
    """

    ambient: float
    diffuse: float
    glint: float = 0.0
    haze_m: tuple[float, float] = NO_HAZE_M
    haze_rgb: tuple[float, float, float] = (0.0, 0.0, 0.0)
    specular: float = 0.0
    shininess: float = 0.0
    lamp_rgb: tuple[float, float, float] | None = None

    @property
    def hazy(self) -> bool:
        """Return whether there is any haze."""
        return self.haze_m != NO_HAZE_M


LOOKS = {
    PLAIN: Look(ambient=0.3, diffuse=0.45),
    "dry": Look(0.2, 0.32, 0.1, (8.0, 90.0), (0.05, 0.046, 0.042), 0.1, 0.1, (0.95, 0.92, 0.85)),
    "wet": Look(0.18, 0.32, 0.6, (6.0, 70.0), (0.05, 0.054, 0.056), 0.6, 0.6, (0.95, 0.94, 0.9)),
    "dusty": Look(0.22, 0.28, 0.0, (1.0, 32.0), (0.27, 0.245, 0.21), 0.0, 0.0, (0.95, 0.9, 0.8)),
}


def look_of(record: Mapping[str, Any]) -> Look:
    """Return the look that a world's record states."""
    return LOOKS[record["look"]]


def floor_texture(places_m: np.ndarray) -> np.ndarray:
    """Return the texture coordinates (n, 2) of places (n, 3) m, mine frame, on a volume's floor."""
    found: np.ndarray = places_m[:, :2] * TEXTURE_PER_M
    return found


def cover_rgba(zone_rgba: Sequence[float]) -> list[float]:
    """Return the colour that the visible floor multiplies its texture with, by the colour of its floor zone."""
    grey = sum(zone_rgba[:3]) / 3
    mixed = [(1 - _GREYED) * own + _GREYED * grey * tone for own, tone in zip(zone_rgba, _MUCK, strict=False)]
    gain = min(_COVER_GAIN, 1 / max(*mixed, 1e-6))  # colours keep their hue
    return [round(gain * value, 4) for value in mixed] + [1.0]
