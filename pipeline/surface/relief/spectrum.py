"""Band spectra of rock, fitted to the roughness that a surface has to have in several windows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import minimize

from pipeline.errors import GeometryError

_DIRECTIONS = 400
_SAMPLES = 17  # along a side of a window: more than two for a wavelength of the shortest band
_WIDTH_OCTAVES = 0.5
_SMOOTHNESS = 0.02
# With SciPy's own 1e-6 one BLAS thread and two found s.d. that differ by 5e-4; with this all kernels agree within 1e-5.
_TOLERANCE = 1e-12


@dataclass(frozen=True)
class Bands:
    """Half-octave bands of a solid isotropic noise: centre wavelengths (n,) m, longest first, and s.d. (n,) m."""

    wavelength_m: np.ndarray
    sd_m: np.ndarray

    @property
    def rms_m(self) -> float:
        """Return the s.d. of the displacement, all bands together, m."""
        return float(np.sqrt((self.sd_m**2).sum()))


@dataclass(frozen=True)
class Roughness:
    """RMS residual to a fit in a window: `degree` 1 is a plane, 2 a quadratic; with `line`, along a profile."""

    window_m: float
    rq_m: float
    degree: int = 1
    line: bool = False
    weight: float = 1.0


def band_wavelengths(shortest_m: float, longest_m: float) -> np.ndarray:
    """Return the centres (n,) m of half-octave bands, longest first; no wave is shorter than `shortest_m`."""
    if not 0 < shortest_m < longest_m:
        raise GeometryError(f"spectrum: no band between {shortest_m:g} m and {longest_m:g} m")
    count = max(1, int(np.floor(np.log2(longest_m / shortest_m) / _WIDTH_OCTAVES)))
    return shortest_m * 2.0 ** (_WIDTH_OCTAVES * (np.arange(count, 0, -1) - 0.5))


def band_edges(wavelength_m: float) -> tuple[float, float]:
    """Return a band's shortest and longest wavelength, m."""
    half = 2.0 ** (_WIDTH_OCTAVES / 2)
    return wavelength_m / half, wavelength_m * half


@lru_cache(maxsize=512)
def residual_share(wavelength_m: float, window_m: float, degree: int, line: bool) -> float:
    """Return the share of a band's variance that remains after a polynomial fit in a square window or along a line.

    The noise is solid: on a plane through it, the wavelengths are those of the band and longer.
    """
    z, turn = _directions()
    k = 2 * np.pi / (wavelength_m * 2.0 ** (_WIDTH_OCTAVES * (z / 2)))  # uniform over the band and over the sphere
    up = np.roll(z, len(z) // 3)  # so that direction and wavelength are independent
    kx, ky = k * np.sqrt(1 - up**2) * np.cos(turn), k * np.sqrt(1 - up**2) * np.sin(turn)
    t = (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5
    x, y = (t, np.zeros(1)) if line else (np.repeat(t, _SAMPLES), np.tile(t, _SAMPLES))
    powers = [(i, j) for i in range(degree + 1) for j in range(0 if line else degree + 1) or (0,) if i + j <= degree]
    basis, _ = np.linalg.qr(np.column_stack([x**i * np.broadcast_to(y, x.shape) ** j for i, j in powers]))
    waves = np.exp(1j * window_m * np.outer(t, kx))
    if not line:
        waves = (waves[:, None] * np.exp(1j * window_m * np.outer(t, ky))).reshape(len(x), -1)
    explained = (np.abs(basis.T @ waves) ** 2).sum(axis=0) / len(x)
    return float(1 - explained.mean())


def _directions() -> tuple[np.ndarray, np.ndarray]:
    i = np.arange(_DIRECTIONS)
    return (2 * i + 1) / _DIRECTIONS - 1, i * np.pi * (3 - 5**0.5)


def fit_bands(wanted: list[Roughness], wavelength_m: np.ndarray, max_rms_m: float) -> Bands:
    """Fit a smooth band spectrum to the wanted roughness, by ratio, within a bound on the amplitude.

    Parameters
    ----------
    wanted : list of Roughness
    wavelength_m : (n,) m
    max_rms_m : float
        Bound on the s.d. of the displacement. If it is active, long windows are smoother than wanted.

    Raises
    ------
    GeometryError
        If `wanted` is empty, or the fit does not converge.
    """
    if not wanted:
        raise GeometryError("spectrum: there is no roughness to fit")
    shares = np.array(
        [[residual_share(w, r.window_m, r.degree, r.line) for w in wavelength_m.tolist()] for r in wanted]
    )
    target = 2 * np.log([r.rq_m for r in wanted])
    weight = np.array([r.weight for r in wanted])

    def cost(log_energy: np.ndarray) -> float:
        misfit = np.log(shares @ np.exp(log_energy)) - target
        return float((weight * misfit**2).sum() + _SMOOTHNESS * (np.diff(log_energy, 2) ** 2).sum())

    start = np.full(len(wavelength_m), np.log(max_rms_m**2 / len(wavelength_m) / 4))
    within_bound = {"type": "ineq", "fun": lambda q: 1.0 - np.exp(q).sum() / max_rms_m**2}
    result = minimize(
        cost,
        start,
        method="SLSQP",
        constraints=[within_bound],
        bounds=[(-30, 4)] * len(start),
        options={"maxiter": 500, "ftol": _TOLERANCE},
    )
    if not result.success:
        raise GeometryError(f"spectrum: no fit to {len(wanted)} roughness values ({result.message})")
    return Bands(wavelength_m, np.array([float(f"{sd:.4g}") for sd in np.exp(result.x / 2)]))
