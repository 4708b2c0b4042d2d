"""Place a world's lights again along its network, by the distance that its own lights show."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
import shapely

from minexplore.bundle import MODEL, RECORD
from pipeline.errors import ArtifactError
from pipeline.geometry.polyline import arc_length
from pipeline.mjcf.scene import SpotLight, place_lights
from pipeline.types import DriftNetwork

_OFF_M = 0.02  # along the drift: places have three decimals, and rounding adds up over a line
_LENGTH = 1e-4
_TURNED = 0.05  # of the direction: it follows from two places 4 m apart
_LONGEST_M = 1e9
_HIGHEST_M = 1000.0
_WIDEST_DEG = 90.0


def remake_lights(folder: Path, stated: mujoco.MjSpec, count: int, network: DriftNetwork) -> list[SpotLight]:
    """Return the lights, `count` by the record, as the builder places them along the main drift or all drifts.

    Height, pitch and cut-off angle are those of the first light; the distance is read off two lights of one line.

    Raises
    ------
    ArtifactError
        If there are more or fewer, they are not over the floor, look up, or no distance along either gives their
        places.
    """
    lights = list(stated.lights)
    if len(lights) != count:
        raise ArtifactError(f"{folder / MODEL}: {len(lights)} lights, {RECORD} has {count}")
    if not lights:
        return []
    places, ways = np.array([light.pos for light in lights]), np.array([light.dir for light in lights])
    if not (np.abs(np.linalg.norm(ways, axis=1) - 1) <= _LENGTH).all():
        raise ArtifactError(f"{folder / MODEL}: a light whose direction has not the length 1")
    height, cutoff = float(places[0, 2]), float(lights[0].cutoff)
    pitch = math.degrees(math.asin(min(1.0, max(-1.0, -float(ways[0, 2])))))
    if not (0 < height <= _HIGHEST_M and pitch >= 0 and 0 < cutoff <= _WIDEST_DEG):
        raise ArtifactError(
            f"{folder / MODEL}: light {lights[0].name}: {height:g} m high, {pitch:.1f} deg down, {cutoff:g} deg wide; "
            f"want at most {_HIGHEST_M:g} m over the floor, looking down, and at most {_WIDEST_DEG:g} deg"
        )
    found, best = places[:, :2], _LONGEST_M
    for lines in ([np.array(network.main_drift_m)], [np.array(leg.stations_m) for leg in network.legs]):
        for spacing, most in _spacings(lines, found):
            made = place_lights(lines, spacing, height, pitch, cutoff, most)
            if len(made) != len(found):
                continue
            off = np.linalg.norm(np.array([light.place_m for light in made]) - places, axis=1)
            turned = np.array([light.direction for light in made]) - ways
            best = min(best, float(off.max()))
            if off.max() <= _OFF_M and np.abs(turned).max() <= _TURNED and np.abs(turned[:, 2]).max() <= _LENGTH:
                # The distance was read off rounded places: the lights' own places are within that error.
                return [
                    SpotLight((float(x), float(y), height), tuple(map(float, way)), cutoff)  # type: ignore[arg-type]
                    for (x, y, _), way in zip(places, ways, strict=True)
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
