"""Scale the parts of jointed rock until its roughness is that of measured rock."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.optimize import least_squares

from pipeline.metrics.planefit import sweep_residuals
from pipeline.metrics.profile import line_roughness
from pipeline.metrics.roughness import SurfaceRoughness
from pipeline.surface.joints import Gains, JointedRock, parts_of_joints

_LENGTH_M, _HEIGHT_M, _STEP_M = 36.0, 2.4, 0.05
_AZIMUTHS_DEG = (0.0, 45.0, 90.0, 135.0)  # joint sets cut walls of every direction
_FOOTPRINT_M = 0.3  # of height, over which a bin of the sweeps averages
_SHORTEST_M = 0.5  # shorter windows hold few points of the mesh
_VOXEL_POINTS = 20
_LEAST, _MOST = 0.02, 4.0


def fit_rock(rock: JointedRock, measured: SurfaceRoughness, seed: int) -> JointedRock:
    """Return the rock with gains for its undulation, blocks and overbreak that fit measured roughness.

    The residuals of four flat walls, which face different directions, are compared with the measured ones in all
    windows of 0.5 m or more, by least squares of their logarithms.

    Parameters
    ----------
    rock : JointedRock
    measured : SurfaceRoughness
        Residuals to lines or to planes; the walls are measured in the same way.
    seed : int
    """
    walls = [_Wall(np.radians(azimuth), rock, seed) for azimuth in _AZIMUTHS_DEG]
    used = [k for k, window in enumerate(measured.window_m) if window >= _SHORTEST_M]
    windows, wanted = np.array(measured.window_m)[used], np.array(measured.rq_m)[used]

    def misfit(log_gain: np.ndarray) -> np.ndarray:
        return np.log(_roughness(walls, np.exp(log_gain), windows, measured.line) / wanted)

    bounds = np.log([_LEAST, _MOST])
    found = least_squares(misfit, np.zeros(3), bounds=tuple(bounds), diff_step=0.05)
    return dataclasses.replace(rock, gains=Gains(*np.exp(found.x).round(3).tolist()))


class _Wall:
    """A flat, upright wall along an azimuth, and the parts (3, rows, columns) m of its relief."""

    def __init__(self, azimuth_rad: float, rock: JointedRock, seed: int) -> None:
        along, up = np.meshgrid(np.arange(0, _LENGTH_M, _STEP_M), np.arange(0, _HEIGHT_M, _STEP_M))
        heading = np.array([np.sin(azimuth_rad), np.cos(azimuth_rad), 0.0])
        self.inward = np.array([heading[1], -heading[0], 0.0])
        self.along = along
        self.points = along[..., None] * heading + up[..., None] * np.array([0.0, 0.0, 1.0])
        flat = self.points.reshape(-1, 3)
        self.parts = parts_of_joints(flat, np.broadcast_to(self.inward, flat.shape), rock, seed).reshape(3, *up.shape)

    def lines(self, gains: np.ndarray) -> list[np.ndarray]:
        """Return level cuts (n, 2) m: along the wall, and the displacement averaged over the footprint's height."""
        relief = np.tensordot(gains, self.parts, 1)
        rows = round(_FOOTPRINT_M / _STEP_M)
        cuts = [relief[at : at + rows].mean(axis=0) for at in range(0, len(relief) - rows + 1, rows)]
        return [np.column_stack([self.along[0], cut]) for cut in cuts]

    def cloud(self, gains: np.ndarray) -> np.ndarray:
        """Return the displaced points (n, 3) m."""
        relief = np.tensordot(gains, self.parts, 1)
        return (self.points + relief[..., None] * self.inward).reshape(-1, 3)


def _roughness(walls: list[_Wall], gains: np.ndarray, windows: np.ndarray, line: bool) -> np.ndarray:
    """Return the walls' residuals (k,) m in windows (k,) m, as the reference states its own."""
    if line:
        lines = [run for wall in walls for run in wall.lines(gains)]
        return np.array([np.median(line_roughness(lines, float(window))) for window in windows])
    clouds = [sweep_residuals(wall.cloud(gains), tuple(windows.tolist()), _VOXEL_POINTS) for wall in walls]
    squares = [[found.rq_m**2 for cloud in clouds for found in cloud if found.window_m == w] for w in windows]
    return np.sqrt([np.mean(square) for square in squares])
