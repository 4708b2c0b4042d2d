"""How far sensors are from ideal: noise, dust and water, with presets whose numbers state their sources."""

from __future__ import annotations

import dataclasses
import functools
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from minexplore.limits import Span, check_numbers
from minexplore.task import coerce_params

_PRESETS = Path(__file__).parent / "presets.json"
_SHARE = Span(0.0, 1.0)
_SPANS = {
    "noise": Span(0.0, 100.0),
    "power_spread_db": Span(0.0, 30.0),
    "reflectivity": Span(0.001, 1.0),
    "dust_per_m": Span(0.0, 10.0),
    "dust_transmittance": Span(0.0, 0.999),
    "wet_factor": _SHARE,
    "wet_walls": _SHARE,
    "film_share": _SHARE,
    "depth_noise_px": Span(0.0, 10.0),
    "image_noise": _SHARE,
    "gyro_noise_radps_rthz": Span(0.0, 10.0),
    "gyro_bias_radps": Span(0.0, 10.0),
    "accel_noise_mps2_rthz": Span(0.0, 100.0),
    "accel_bias_mps2": Span(0.0, 100.0),
}


@dataclass(frozen=True)
class SensorParams:
    """How sensors degrade; the defaults are ideal.

    LiDAR: `noise` multiplies the data sheet's standard deviation of a range, `power_spread_db` is that of a
    return's power, `reflectivity` that of dry rock. Dust: `dust_per_m` is the extinction coefficient of Beer and
    Lambert, and `dust_transmittance` what dust lets pass where half of a LiDAR's rays return from particles (0:
    none do). Water: wet surfaces reflect `wet_factor` as much, `film_share` is the share of a wet floor under
    standing water, `wet_walls` that of wet rock. Cameras: `depth_noise_px` in pixels of disparity, `image_noise` as
    a share of white. IMU: noise a root hertz and standard deviation of the constant bias.
    """

    noise: float = 0.0
    power_spread_db: float = 0.0
    reflectivity: float = 0.3
    dust_per_m: float = 0.0
    dust_transmittance: float = 0.0
    wet_factor: float = 1.0
    wet_walls: float = 0.0
    film_share: float = 0.0
    depth_noise_px: float = 0.0
    image_noise: float = 0.0
    gyro_noise_radps_rthz: float = 0.0
    gyro_bias_radps: float = 0.0
    accel_noise_mps2_rthz: float = 0.0
    accel_bias_mps2: float = 0.0

    def __post_init__(self) -> None:
        """Refuse numbers that no sensor has."""
        check_numbers("sensor", self, _SPANS)

    @property
    def is_ideal(self) -> bool:
        """Return whether nothing is degraded, so that no random number is drawn."""
        return dataclasses.replace(self, reflectivity=0.3) == IDEAL


IDEAL = SensorParams()


@functools.cache
def _presets() -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = json.loads(_PRESETS.read_text())
    return found


def preset_names() -> list[str]:
    """Return the names of the presets."""
    return list(_presets())


def preset_numbers(name: str) -> dict[str, tuple[float, str]]:
    """Return the numbers of a preset that differ from the ideal ones, each with its source.

    Raises
    ------
    ValueError
        If there is none of that name.
    """
    presets = _presets()
    if name not in presets:
        raise ValueError(f"conditions = {name!r}: valid choices are {', '.join(presets)}, SensorParams(...)")
    own = dict(presets[name])
    numbers = preset_numbers(own.pop("base")) if "base" in own else {}
    return numbers | {field: (float(value), source) for field, (value, source) in own.items()}


def sensor_params(value: SensorParams | Mapping[str, Any] | str | None) -> SensorParams:
    """Return parameters given as an instance, a preset's name, or a dict of fields beside `preset`.

    Raises
    ------
    ValueError
        Naming what is unknown, or the number that is beyond its limit.
    """
    if isinstance(value, str):
        return SensorParams(**{field: number for field, (number, _) in preset_numbers(value).items()})
    if isinstance(value, Mapping) and "preset" in value:
        own = {field: number for field, number in value.items() if field != "preset"}
        coerce_params(SensorParams, own)  # names an unknown field
        return dataclasses.replace(sensor_params(str(value["preset"])), **own)
    given = dict(value) if isinstance(value, Mapping) else value
    return coerce_params(SensorParams, given)
