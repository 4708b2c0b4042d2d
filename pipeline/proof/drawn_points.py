"""Points drawn on the triangles of the visible rock, on which its texture is measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.metrics.rock.sampling import add_noise, sample_triangles, unit_normals
from pipeline.params.validation import TextureReportParams


@dataclass(frozen=True)
class Sampled:
    """Points drawn on a piece of the rock.

    Attributes
    ----------
    points : (n, 3) float64, m, mine frame
    triangles : (k, 3, 3) float64, m
        Those that the points were drawn on.
    face : (n,) int
        The triangle of each point.
    """

    points: np.ndarray
    triangles: np.ndarray
    face: np.ndarray

    def with_noise(self, params: TextureReportParams, rng: np.random.Generator) -> np.ndarray:
        """Return the points, moved by the paper's noise."""
        noise_m = params.noise_normal_m, params.noise_in_plane_m
        points = self.points.copy()
        add_noise(points, unit_normals(self.triangles), self.face, *noise_m, rng)
        return points


def sample_pieces(pieces: list[np.ndarray], params: TextureReportParams, rng: np.random.Generator) -> list[Sampled]:
    """Draw points on the walls and on the roof, given as triangles (k, 3, 3) m."""
    found = []
    for triangles, most in zip(pieces, (params.wall_points, params.roof_points), strict=True):
        points, face = sample_triangles(triangles, number_of_points(triangles, most, params.points_per_m2), rng)
        found.append(Sampled(points, triangles, face))
    return found


def number_of_points(triangles: np.ndarray, most: int, per_m2: float) -> int:
    """Return how many points to draw on triangles (k, 3, 3) m: so many a square metre, 1,000 to `most`."""
    sides = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return max(1000, min(most, int(per_m2 * np.linalg.norm(sides, axis=1).sum() / 2)))
