"""A LiDAR in a world: scans from poses, still or moving."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from minexplore.sensing.lidar import Backend
from minexplore.sensing.mount import Mount, Pose3D
from minexplore.sensing.params import IDEAL, SensorParams
from minexplore.sensing.scanners.caster import Hits, SurfaceCaster, shared_caster
from minexplore.sensing.scanners.cloud import PointCloud
from minexplore.sensing.scanners.degradation import degrade_hits, reflectivities
from minexplore.sensing.scanners.labels import DUST
from minexplore.sensing.scanners.pattern import Rays, ScanPattern
from minexplore.sensing.scanners.pattern_files import load_pattern
from minexplore.world import World


class Scanner:
    """One LiDAR on a robot; `scan` returns the cloud that it makes at a pose."""

    def __init__(
        self, pattern: ScanPattern, caster: SurfaceCaster, mount: Mount | None = None, params: SensorParams = IDEAL
    ) -> None:
        """Take a pattern and what casts its rays; with the ideal parameters no random number is drawn."""
        self.pattern, self.mount, self.params = pattern, mount or Mount(), params
        self.caster, self._reflectivity = caster, reflectivities(params)

    def scan(
        self, robot: Pose3D, rng: np.random.Generator | None = None, number: int = 0, before: Pose3D | None = None
    ) -> PointCloud:
        """Return the cloud of one scan.

        Parameters
        ----------
        robot : Pose3D
            The robot's pose when the scan ends, its origin on the floor under its middle.
        rng : numpy.random.Generator, optional
            Draws noise and what is lost; needed unless the parameters are ideal.
        number : int
            Of the scan; a rosette does not repeat.
        before : Pose3D, optional
            The robot's pose when the scan begins: every ray is then cast from where the sensor was when it was
            fired, so that the cloud, read as from one pose, is bent as a moving sensor's is.

        Raises
        ------
        ValueError
            If the parameters need random numbers and there is no generator.
        """
        if rng is None and not self.params.is_ideal:
            raise ValueError("scan: these parameters draw random numbers: want rng")
        rays = self.pattern.scan(number)
        now = self.mount.on(robot)
        origins, directions = place_rays(rays, now, self.mount.on(before) if before else None, self.pattern.period_s)
        hits = self.caster.cast(origins, directions)
        near, far = self.pattern.range_m
        if not self.params.is_ideal:
            assert rng is not None  # checked above
            hits = degrade_hits(hits, origins, directions, self.pattern, self.params, self.caster, rng)
        kept = np.flatnonzero((hits.range_m >= near) & (hits.range_m <= far))
        return self._cloud(rays, hits, kept)

    def _cloud(self, rays: Rays, hits: Hits, kept: np.ndarray) -> PointCloud:
        range_m, label = hits.range_m[kept], hits.label[kept]
        intensity = self._reflectivity[label] * hits.cosine[kept]
        if self.params.dust_per_m:
            intensity *= np.exp(-2 * self.params.dust_per_m * range_m, where=label != DUST, out=np.ones_like(range_m))
        return PointCloud(
            rays.directions[kept],
            range_m,
            rays.ring[kept],
            rays.time_s[kept],
            intensity,
            label,
            kept,
            len(hits.range_m),
        )


def scanner_of(
    name: str | Path,
    world: World,
    mount: Mount | None = None,
    params: SensorParams = IDEAL,
    backend: Backend = "auto",
) -> Scanner:
    """Return a LiDAR in a world by the name of its pattern, or by the `.json` file of one; see `load_pattern`.

    Raises
    ------
    ValueError
        If there is no pattern of that name, or the file is refused.
    FileNotFoundError
        If there is no such file.
    """
    pattern = load_pattern(name)
    return Scanner(pattern, shared_caster(world, pattern.range_m[1], backend), mount, params)


def place_rays(rays: Rays, now: Pose3D, before: Pose3D | None, period_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Return origins (3,) or (n, 3) m and directions (n, 3) float32 of rays in the mine frame.

    The sensor moves evenly from `before` to `now` in `period_s`: its place along a line, its axes about one axis.
    """
    if before is None:
        return now.place_m, rays.directions @ now.axes.T.astype(np.float32)
    share = (rays.time_s / np.float32(period_s)).astype(np.float64)
    origins = before.place_m + share[:, None] * (now.place_m - before.place_m)
    axis, angle = _turn_between(before.axes, now.axes)
    turned = _turn(rays.directions.astype(np.float64), axis, share * angle)
    return origins, np.ascontiguousarray(turned @ before.axes.T, dtype=np.float32)


def _turn_between(one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the axis (3,), in the frame of `one`, and the angle, rad, that turn `one` into `other`."""
    turn = one.T @ other
    skew = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
    sine = float(np.linalg.norm(skew))
    angle = float(np.arctan2(sine, (np.trace(turn) - 1) / 2))
    return (skew / sine if sine > 1e-12 else np.array([0.0, 0.0, 1.0])), angle


def _turn(vectors: np.ndarray, axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return vectors (n, 3) turned about one axis by angles (n,) rad (Rodrigues)."""
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    turned: np.ndarray = vectors * cos + np.cross(axis, vectors) * sin + axis * (vectors @ axis)[:, None] * (1 - cos)
    return turned
