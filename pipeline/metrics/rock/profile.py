"""Profiles of rock (offsets along lines), and their spectrum, amplitude and roughness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from shapely import LinearRing

from pipeline.geometry.nearest_edges import nearest_edges
from pipeline.geometry.polyline import arc_length
from pipeline.metrics.digits import repeatable
from pipeline.metrics.rock.planefit import fit_voxel_planes, planes_at

_LEAST_POINTS = 24
_LEAST_OF_LINE = 6  # points of a window
_STRIP_M = 0.05
_FILL = 0.8  # share of a window that a profile must span
_HANN = np.hanning(257)  # at even places along a profile


@dataclass(frozen=True)
class Spectrum:
    """One-sided power spectral density, m2 per cycle/m, by wavelength; valid between the two wavelengths `valid_m`."""

    wavelength_m: list[float]
    psd_m3: list[float]
    valid_m: tuple[float, float]
    windows: int


@dataclass(frozen=True)
class Amplitude:
    """Offsets from the smooth local surface.

    Percentiles 5, 25, 50, 75 and 95, mm; s.d., mm; skewness; excess kurtosis; and `variation`, the coefficient of
    variation of the s.d. over windows.
    """

    percentiles_mm: list[float]
    sd_mm: float
    skewness: float
    kurtosis: float
    variation: float


Profile = np.ndarray  # (n, 2): position along a line and offset from it, m; sorted by position


def sweep_runs(sweep: np.ndarray, max_gap_m: float) -> list[np.ndarray]:
    """Split a planar sweep (n, 2) m, in order of bearing, into pieces of wall without a gap."""
    gap = np.linalg.norm(np.diff(sweep, axis=0), axis=1)
    return [run for run in np.split(sweep, np.flatnonzero(gap > max_gap_m) + 1) if len(run) >= _LEAST_POINTS]


def profiles_of_runs(runs: list[np.ndarray], window_m: float) -> list[Profile]:
    """Cut lines of points (n, 2) m into windows and return the offsets from the straight line fitted to each window."""
    profiles = []
    for run in runs:
        along = arc_length(run)
        for start in np.arange(0.0, max(along[-1] - _FILL * window_m, 0.0) + 1e-9, window_m / 2):
            part = run[(along >= start) & (along < start + window_m)]
            if len(part) >= _LEAST_POINTS:
                profile = _from_line(part)
                if np.ptp(profile[:, 0]) >= _FILL * window_m * 0.8:
                    profiles.append(profile)
    return profiles


def profiles_of_cloud(points: np.ndarray, window_m: float) -> list[Profile]:
    """Cut points of a surface (n, 3) m into voxels, and each voxel into horizontal strips along its fitted plane."""
    planes = fit_voxel_planes(points, window_m, 4 * _LEAST_POINTS)
    plane = planes_at(points, planes, window_m)
    used = np.flatnonzero((plane >= 0) & (planes.sigma[plane] <= window_m / 6)) if len(planes.sigma) else plane[:0]
    plane, normal = plane[used], planes.normal  # voxels at a corner, which is no surface, are left out
    level = np.cross(normal, [0.0, 0.0, 1.0])
    size = np.linalg.norm(level, axis=1, keepdims=True)
    level = np.where(size > 0.3, level / np.maximum(size, 1e-30), [1.0, 0.0, 0.0])
    level -= np.einsum("ij,ij->i", level, normal)[:, None] * normal
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    local = points[used] - planes.centre[plane]
    along, up, out = (np.einsum("ij,ij->i", local, of[plane]) for of in (level, np.cross(normal, level), normal))
    strip = np.floor(up / _STRIP_M).astype(np.int64)
    order, count = _runs(along, plane * (np.ptp(strip) + 1) + strip - strip.min() if len(strip) else strip)
    last = np.cumsum(count) - 1
    long = along[order[last]] - along[order[last - count + 1]] >= _FILL * window_m * 0.8
    kept = (count >= _LEAST_POINTS) & long
    order, count = order[np.repeat(kept, count)], count[kept]
    return _from_lines(np.column_stack([along[order], out[order]]), count)


def _runs(along: np.ndarray, number: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the order (n,) by number, and by place of the same number, and how many (k,) of each number there are."""
    order = np.lexsort((along, number))
    first = np.flatnonzero(np.diff(number[order], prepend=-1))
    return order, np.diff(first, append=len(order))


def _from_line(points: np.ndarray) -> Profile:
    """Fit a straight line to points (n, 2); return the positions along it and the offsets from it."""
    return _from_lines(points, np.array([len(points)]))[0]


def _from_lines(points: np.ndarray, count: np.ndarray) -> list[Profile]:
    """Fit a straight line to each run of so many of the points (n, 2), as `_from_line` does."""
    if not len(count):
        return []
    first = np.cumsum(count) - count
    centred = points - np.repeat(np.add.reduceat(points, first) / count[:, None], count, axis=0)
    x, y = centred.T
    xx, xy, yy = (np.add.reduceat(product, first) for product in (x * x, x * y, y * y))
    _, vectors = np.linalg.eigh(np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2))
    along, off = (np.einsum("ij,ij->i", centred, np.repeat(vectors[:, :, k], count, axis=0)) for k in (1, 0))
    order, _ = _runs(along, np.repeat(np.arange(len(count)), count))
    return np.split(np.column_stack([along, off])[order], first[1:])


def spectrum_of(profiles: list[Profile], wavelength_m: np.ndarray, window_m: float, footprint_m: float) -> Spectrum:
    """Average the profiles' periodograms (Lomb-Scargle, Hann taper), scaled so that the integral is the variance.

    The valid band begins at twice the median sampling step or at the sensor's footprint, whichever is larger, and ends
    at half the window.
    """
    omega, total = 2 * np.pi / wavelength_m, np.zeros(len(wavelength_m))
    if not profiles:
        return Spectrum(wavelength_m.tolist(), total.tolist(), repeatable((footprint_m, window_m / 2)), 0)
    count = np.array([len(p) for p in profiles])
    first = np.cumsum(count) - count
    place, offset = np.concatenate(profiles).T
    length = place[first + count - 1] - place[first]
    share = (place - np.repeat(place[first], count)) / np.repeat(length, count)
    taper = np.interp((len(_HANN) - 1) * share, np.arange(len(_HANN)), _HANN)
    mean = np.add.reduceat(offset * (taper + 1e-12), first) / np.add.reduceat(taper + 1e-12, first)
    tapered = taper * (offset - np.repeat(mean, count))
    weight = 2 * length / np.add.reduceat(taper**2, first)
    for k, frequency in enumerate(omega.tolist()):
        total[k] = weight @ _periodogram(place, tapered, first, count, frequency)
    step = float(np.median(_median_steps(place, first, count)))
    return Spectrum(
        wavelength_m.tolist(),
        repeatable((total / len(profiles)).tolist()),
        repeatable((max(2 * step, footprint_m), window_m / 2)),
        len(profiles),
    )


def _periodogram(
    place: np.ndarray, offset: np.ndarray, first: np.ndarray, count: np.ndarray, omega: float
) -> np.ndarray:
    """Return the Lomb-Scargle power (k,) of profiles that stand one after another, at one angular frequency.

    It is that of `scipy.signal.lombscargle`, which takes one profile at a time; a surface has ten thousand.

    References
    ----------
    Scargle 1982, ApJ 263:835, doi:10.1086/160554
    """
    cos, sin = np.cos(omega * place), np.sin(omega * place)
    cc, cs, yc, ys = (np.add.reduceat(v, first) for v in (cos * cos, cos * sin, offset * cos, offset * sin))
    tau = np.arctan2(2 * cs, 2 * cc - count) / 2  # makes the two waves orthogonal
    c, s = np.cos(tau), np.sin(tau)
    even = np.clip(c * c * cc + 2 * c * s * cs + s * s * (count - cc), 1e-12, count - 1e-12)
    return np.asarray(((c * yc + s * ys) ** 2 / even + (c * ys - s * yc) ** 2 / (count - even)) / 2)


def _median_steps(place: np.ndarray, first: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Return the median distance (k,) m of neighbours in each of the profiles that stand one after another."""
    step = np.diff(place, append=0.0)
    step[first + count - 1] = np.inf  # from a profile to the next: sorted behind the profile's own steps
    step = step[np.lexsort((step, np.repeat(np.arange(len(count)), count)))]
    return (step[first + (count - 2) // 2] + step[first + (count - 1) // 2]) / 2


def amplitude_of(profiles: list[Profile]) -> Amplitude | None:
    """Describe the distribution of the profiles' offsets; return None without profiles."""
    if not profiles:
        return None
    offset = np.concatenate([p[:, 1] for p in profiles])
    sd = float(offset.std())
    z = (offset - offset.mean()) / max(sd, 1e-12)
    each = np.array([p[:, 1].std() for p in profiles])
    return Amplitude(
        percentiles_mm=(1000 * np.percentile(offset, [5, 25, 50, 75, 95])).round(2).tolist(),
        sd_mm=round(1000 * sd, 2),
        skewness=round(float((z**3).mean()), 3),
        kurtosis=round(float((z**4).mean() - 3), 3),
        variation=round(float(each.std() / each.mean()), 3) if each.mean() > 0 else 0.0,
    )


def line_roughness(runs: list[np.ndarray], window_m: float) -> np.ndarray:
    """Return the RMS residual to a straight line, (k,) m, of each of the adjoining windows along runs (n, 2) m."""
    residuals = [np.zeros(0)]
    for run in runs:
        along = arc_length(run)
        index = np.floor(along / window_m).astype(int)
        whole = index < int(along[-1] // window_m)
        index, (x, y) = index[whole], (run[whole] - run.mean(axis=0)).T
        count = np.bincount(index)
        mx, my = (np.bincount(index, v) / np.maximum(count, 1) for v in (x, y))
        x, y = x - mx[index], y - my[index]
        xx, xy, yy = (np.bincount(index, v) for v in (x * x, x * y, y * y))
        least = (xx + yy) / 2 - np.hypot((xx - yy) / 2, xy)  # the smaller eigenvalue of the scatter
        residuals.append(np.sqrt(np.maximum(least, 0.0) / np.maximum(count, 1))[count >= _LEAST_OF_LINE])
    return np.concatenate(residuals)


def project_on_rings(rings: list[LinearRing], places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return for each place (n, 2): its nearest ring, the arc length on it, and the distance from it, (n,) each."""
    starts, ends, ring, before = [], [], [], []
    for k, line in enumerate(rings):
        xy = np.asarray(line.coords)[:, :2]
        size = np.linalg.norm(np.diff(xy, axis=0), axis=1)
        starts.append(xy[:-1])
        ends.append(xy[1:])
        ring.append(np.full(len(size), k))
        before.append(np.concatenate([[0.0], np.cumsum(size)[:-1]]))
    a, b, number, passed = (np.concatenate(v) for v in (starts, ends, ring, before))
    found = nearest_edges(np.stack([a, b], axis=1), places)
    nearest = found.edge
    step = b[nearest] - a[nearest]
    share = ((places - a[nearest]) * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-30)
    on_piece = np.clip(share, 0, 1) * np.linalg.norm(step, axis=1)
    return number[nearest], passed[nearest] + on_piece, found.distance_m


def arc_windows(along: np.ndarray, offset: np.ndarray, step_m: float, window_m: float) -> list[np.ndarray]:
    """Return the offsets at even steps in windows of the arc; no window contains a gap wider than four steps."""
    order = np.argsort(along, kind="stable")
    along, offset = along[order], offset[order]
    ends = np.append(np.flatnonzero(np.diff(along) > 4 * step_m) + 1, len(along))
    starts = np.append(0, ends[:-1])
    windows = []
    for first, end in zip(starts.tolist(), ends.tolist(), strict=True):
        s, v = along[first:end], offset[first:end]
        for start in np.arange(s[0], s[-1] - window_m + 1e-9, window_m / 2) if len(s) else ():
            windows.append(np.interp(start + np.arange(round(window_m / step_m)) * step_m, s, v))
    return windows


def tapered(profile: np.ndarray) -> np.ndarray:
    """Return offsets (n,) at even places without their linear trend, under a Hann window."""
    place = np.arange(len(profile)) - (len(profile) - 1) / 2
    level = profile - profile.mean()
    return np.asarray((level - place * (place @ level) / (place @ place)) * np.hanning(len(profile)))
