"""Scale the parts of jointed rock until the walls of a mine are as rough as measured rock."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.optimize import minimize
from scipy.spatial import cKDTree

from pipeline.geometry.polyline import resample
from pipeline.metrics.rock.planefit import sweep_residuals
from pipeline.metrics.rock.profile import line_roughness
from pipeline.metrics.rock.roughness import CUT_HEIGHTS_M, SurfaceRoughness
from pipeline.metrics.rock.sampling import sample_triangles
from pipeline.surface.mesh.displacement import Bounds, bound_displacement, displaced
from pipeline.surface.mesh.lattice import WALL, Lattice
from pipeline.surface.relief.joints import Gains, JointedRock, parts_of_joints

_FOOTPRINT_M = 0.3  # of height, over which a bin of the sweeps averages
_STEP_M = 0.05  # of the points along a level line
_SHORTEST_M = 0.5  # shorter windows hold few points of the lattice
_STRETCHES, _STRETCH_M, _POINTS, _VOXEL_POINTS = 6, 8.0, 100_000, 20
_LEAST, _FIRST, _MOST = 0.02, 0.4, 4.0


def fit_rock(rock: JointedRock, measured: SurfaceRoughness, lattice: Lattice, bounds: Bounds, seed: int) -> JointedRock:
    """Return the rock with gains for its undulation, blocks and overbreak that fit measured roughness.

    The residuals of the mine's own walls, after bounds on their displacement, are compared with the measured ones in
    all windows of 0.5 m or more, by the squares of their logarithms' differences. The plan's corners are part of both.

    Parameters
    ----------
    rock : JointedRock
    measured : SurfaceRoughness
        Residuals to lines or to planes; the walls are measured in the same way.
    lattice : Lattice
        The mine's walls before displacement.
    bounds : Bounds
    seed : int
    """
    walls = RockWalls(rock, lattice, bounds, seed)
    used = [k for k, window in enumerate(measured.window_m) if window >= _SHORTEST_M]
    windows, wanted = np.array(measured.window_m)[used], np.array(measured.rq_m)[used]

    def misfit(log_gain: np.ndarray) -> float:
        ratio = walls.roughness(np.exp(log_gain), windows, measured.line) / wanted
        return float((np.log(ratio) ** 2).sum())

    # Medians are not smooth, so the search takes no derivatives; it begins with a step of a factor of two in each gain.
    first = np.log(_FIRST) + np.log(2) * np.vstack([np.zeros(3), np.eye(3)])
    options = {"initial_simplex": first, "xatol": 0.02, "fatol": 1e-4}
    bounds_of_gain = [(np.log(_LEAST), np.log(_MOST))] * 3
    found = minimize(misfit, first[0], method="Nelder-Mead", bounds=bounds_of_gain, options=options)
    return dataclasses.replace(rock, gains=Gains(*np.exp(found.x).round(3).tolist()))


class RockWalls:
    """The walls of a lattice, and the parts (3, n) m of their relief."""

    def __init__(self, rock: JointedRock, lattice: Lattice, bounds: Bounds, seed: int) -> None:
        count, columns = lattice.wall_vertices, len(lattice.walls.xy)
        self.bounds, self.seed = bounds, seed
        self.parts = parts_of_joints(lattice.vertices, lattice.direction, rock, seed)[:, :count]
        self.lattice = dataclasses.replace(
            lattice,
            vertices=lattice.vertices[:count],
            direction=lattice.direction[:count],
            roof_share=lattice.roof_share[:count],
            column=lattice.column[:count],
        )
        above = lattice.vertices[:count:columns, 2]
        away = [np.abs(above - level) for level in CUT_HEIGHTS_M]
        self.rows = [apart <= max(_FOOTPRINT_M / 2, apart.min()) for apart in away]
        faces = lattice.faces[lattice.piece == WALL]
        middle = lattice.vertices[faces].mean(axis=1)[:, :2]
        stretches = lattice.walls.xy[np.linspace(0, columns - 1, _STRETCHES, dtype=int)]
        self.faces = faces[np.isfinite(cKDTree(stretches).query(middle, distance_upper_bound=_STRETCH_M)[0])]

    def roughness(self, gains: np.ndarray, windows: np.ndarray, line: bool) -> np.ndarray:
        """Return the residuals (k,) m in windows (k,) m to lines or to planes, as the reference states its own."""
        wanted = np.tensordot(gains, self.parts, 1)
        points = displaced(self.lattice, bound_displacement(wanted, self.lattice, self.bounds))
        if line:
            lines = self._level_lines(points)
            return np.array([np.median(line_roughness(lines, float(window))) for window in windows])
        cloud, _ = sample_triangles(points[self.faces], _POINTS, np.random.default_rng(self.seed))
        found = {r.window_m: r.rq_m for r in sweep_residuals(cloud, tuple(windows.tolist()), _VOXEL_POINTS)}
        return np.array([found[window] for window in windows.tolist()])

    def _level_lines(self, points: np.ndarray) -> list[np.ndarray]:
        """Return closed lines (k, 2) m round every ring at each height, averaged over the footprint."""
        levels = points[:, :2].reshape(self.lattice.rows, -1, 2)
        lines = []
        for rows in self.rows:
            level = levels[rows].mean(axis=0)
            for ring in self.lattice.walls.rings:
                wall = level[ring.first : ring.first + ring.count]
                lines.append(resample(np.concatenate([wall, wall[:1]]), _STEP_M)[1])
        return lines
