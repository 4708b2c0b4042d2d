"""The lights of a volume, placed again along its legs by the values that its own lights show."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from pipeline.errors import ArtifactError
from pipeline.mjcf.scene import SpotLight
from pipeline.params.realism import LightParams
from pipeline.schema.rules import numbers_in
from pipeline.volume.world.bundle import lights_of
from pipeline.volume.world.topology import LegNetwork

_OFF_M = 0.005  # places have three decimals, and a distance that is read off them is as much off a row later
_TURNED = 1e-6  # of a direction, whose height has twelve digits
_MIDDLE_M = 2e-3  # from the middle of its leg, of a leg's only light
_TRIED = 8  # distances: those that occur most often between neighbours
_WIDEST_DEG = 90.0
_LEAST_M = 1e-9  # height of lights on the floor, which other heights are read off


def light_of(model: Path, attributes: dict[str, str]) -> SpotLight:
    """Return the light of an element; `ArtifactError` if it lacks a place, a direction or an angle."""
    texts = {name: attributes.get(name, "") for name in ("pos", "dir", "cutoff")}
    place, direction, cutoff = (numbers_in(text) or [] for text in texts.values())
    if (len(place), len(direction), len(cutoff)) != (3, 3, 1) or not 0 < cutoff[0] <= _WIDEST_DEG:
        raise ArtifactError(f"{model}: light: {texts}, want a place, a direction and at most {_WIDEST_DEG:g} deg")
    (x, y, z), (east, north, up) = place, direction
    return SpotLight((x, y, z), (east, north, up), cutoff[0])


def remake_lights(model: Path, stated: Sequence[SpotLight], legs: LegNetwork) -> list[SpotLight]:
    """Return the lights as the builder places them along the legs.

    Pitch and cut-off angle are those of the first light, the height is the largest over the floor, and the distance is
    one of those between neighbours. Places and directions are the stated ones where they are within rounding.

    Raises
    ------
    ArtifactError
        If no distance gives the lights.
    """
    if not stated:
        return []
    places, ways = (np.array([getattr(light, name) for light in stated]) for name in ("place_m", "direction"))
    pitch = math.degrees(math.asin(min(1.0, max(-1.0, -float(ways[0, 2])))))
    if not 0 <= pitch <= 90:
        raise ArtifactError(f"{model}: lights look up by {-pitch:.1f} deg, want 0 to 90 deg down")
    best = math.inf
    for spacing, count in _spacings(places, ways, legs):
        values = {"along": "network", "spacing_m": spacing, "pitch_deg": pitch, "count": count}
        values["cutoff_deg"] = stated[0].cutoff_deg
        on_floor = lights_of(LightParams.model_validate({**values, "height_m": _LEAST_M}), legs)
        if len(on_floor) != len(stated):
            continue
        over = places[:, 2] - np.array([light.place_m[2] for light in on_floor])
        height = max(round(float(over.max()), 3), _LEAST_M)
        made = lights_of(LightParams.model_validate({**values, "height_m": height}), legs)
        off = float(np.abs(np.array([light.place_m for light in made]) - places).max())
        turned = float(np.abs(np.array([light.direction for light in made]) - ways).max())
        best = min(best, off) if turned <= _TURNED else best
        if off <= _OFF_M and turned <= _TURNED:
            return [replace(one, cutoff_deg=stated[0].cutoff_deg) for one in stated]
    raise ArtifactError(
        f"{model}: {len(stated)} lights: not at even distances along the legs, at one height, and along them (the best "
        f"even distance leaves {best:.3f} m, want at most {_OFF_M} m)"
    )


def _spacings(places: np.ndarray, ways: np.ndarray, legs: LegNetwork) -> Iterator[tuple[float, int | None]]:
    """Yield distances and greatest numbers a leg that the lights may have been placed with."""
    ends = np.array([[legs.stations_m[leg.start], legs.stations_m[leg.end]] for leg in legs.legs])
    runs = np.hypot(*(ends[:, 1] - ends[:, 0])[:, :2].T)
    step = np.diff(places[:, :2], axis=0)
    apart = np.hypot(*step.T)
    same = np.abs(ways[1:] - ways[:-1]).max(axis=1, initial=0.0) <= _TURNED
    common = Counter(apart[same].round(2).tolist()).most_common(_TRIED)
    for distance, _ in common:
        near = apart[same & (np.abs(apart - distance) <= 0.01)]
        for spacing in dict.fromkeys([distance, round(float(near.mean()), 3), float(near.mean())]):
            if spacing > 0.5:
                yield spacing, None
                numbers = (runs[runs >= spacing / 2] // spacing + 1).astype(np.int64)
                for count in range(2, int(numbers.max(initial=0))):
                    if np.minimum(numbers, count).sum() == len(places):
                        yield spacing, count
    # One light a leg, in its middle: any distance that leaves out the same legs is as good.
    middle = cKDTree(ends.mean(axis=1)[:, :2]).query_ball_point(places[:, :2], _MIDDLE_M)
    lit = [min(runs[some]) for some in middle if some]
    if lit:
        yield max(2 * float(min(lit)), 0.5 + 1e-6), 1
