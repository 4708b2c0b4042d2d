"""Place a world's lights again along its network, by the distance that its own lights show."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
import shapely

from minexplore.bundle import MODEL
from pipeline.errors import ArtifactError
from pipeline.geometry.polyline import arc_length
from pipeline.mjcf.scene import SpotLight, place_lights
from pipeline.types import DriftNetwork

_OFF_M = 0.02  # along the drift: places have three decimals, and rounding adds up over a line
_TURNED = 0.05  # of the direction: it follows from two places 4 m apart
_LONGEST_M = 1e9


def remake_lights(folder: Path, stated: mujoco.MjSpec, network: DriftNetwork) -> list[SpotLight]:
    """Return the lights as the builder places them along the main drift or all drifts.

    Height, pitch and cut-off angle are those of the first light; the distance is read off two lights of one line.

    Raises
    ------
    ArtifactError
        If no distance along either gives the places of the lights.
    """
    lights = list(stated.lights)
    if not lights:
        return []
    places = np.array([light.pos for light in lights])
    found = places[:, :2]
    height, cutoff = float(places[0, 2]), float(lights[0].cutoff)
    pitch = math.degrees(math.asin(min(1.0, max(-1.0, -lights[0].dir[2] / np.linalg.norm(lights[0].dir)))))
    best = _LONGEST_M
    for lines in ([np.array(network.main_drift_m)], [np.array(leg.stations_m) for leg in network.legs]):
        for spacing, count in _spacings(lines, found):
            made = place_lights(lines, spacing, height, pitch, cutoff, count)
            if len(made) != len(found):
                continue
            off = np.linalg.norm(np.array([light.place_m[:2] for light in made]) - found, axis=1)
            turned = np.array([light.direction for light in made]) - [light.dir for light in lights]
            best = min(best, float(off.max()))
            if off.max() <= _OFF_M and np.abs(turned).max() <= _TURNED:
                # The distance was read off rounded places: the lights' own places are within that error.
                return [
                    SpotLight(tuple(map(float, place)), tuple(map(float, own.dir)), cutoff)  # type: ignore[arg-type]
                    for place, own in zip(places, lights, strict=True)
                ]
    raise ArtifactError(
        f"{folder / MODEL}: light {lights[0].name} and {len(lights) - 1} more: not at even distances along the drifts "
        f"(the best even distance leaves {best:.3f} m, want at most {_OFF_M} m), or not along them"
    )


def _spacings(lines: list[np.ndarray], found: np.ndarray) -> list[tuple[float, int | None]]:
    """Return distances and greatest numbers a line that the lights may have been placed with."""
    lengths = [float(arc_length(line)[-1]) for line in lines]
    choices: list[tuple[float, int | None]] = []
    if len(found) == len(lines):  # one light a line: its middle, whatever the distance
        choices += [(max(lengths) + 1.0, None), (max(max(lengths), 1.0), 1)]
    for number, line in enumerate(lines[: len(found) - 1]):
        shape = shapely.LineString(line)
        along = [float(shape.project(shapely.Point(place))) for place in found[number:]]
        near = [shape.distance(shapely.Point(place)) < _OFF_M for place in found[number:]]
        run = next((k for k, is_near in enumerate(near) if not is_near), len(near))
        run = next((k for k in range(1, run) if along[k] <= along[k - 1]), run)
        for last in {run - 1, 1} - {0, -1}:
            if last < len(along):
                spacing = (along[last] - along[0]) / last
                if spacing > 0.5:
                    counts = {max(1, int(length // spacing) + 1) for length in lengths}
                    limits = [None, *(c for c in range(2, max(counts)) if _total(lengths, spacing, c) == len(found))]
                    choices += [(spacing, limit) for limit in limits]
    return choices


def _total(lengths: list[float], spacing: float, count: int) -> int:
    return sum(min(int(length // spacing) + 1, count) for length in lengths)
