"""Seeded solid noise with a given band spectrum. It depends only on the place, so surfaces have no seams."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipeline.surface.relief.spectrum import Bands, band_edges

_WAVES = 96  # in each band, enough that the noise does not visibly repeat along a drift
_BLOCK = 8192


@dataclass(frozen=True)
class Modulation:
    """A slow variation of roughness along the workings: its wavelength, m, and the s.d. of its logarithm."""

    wavelength_m: float
    spread: float


class Relieved(Protocol):
    """Points (n, 3) m that a relief moves, which way, and how far (n,) each belongs to a roof, from 0 to 1."""

    @property
    def vertices(self) -> np.ndarray:
        """Return the points (n, 3) m."""

    @property
    def direction(self) -> np.ndarray:
        """Return the ways (n, 3) into the workings, 0 of a point that stays."""

    @property
    def roof_share(self) -> np.ndarray:
        """Return the shares (n,)."""


def relief_of_noise(
    lattice: Relieved, wall: Bands, roof: Bands, modulation: Modulation, rng: np.random.Generator
) -> np.ndarray:
    """Return the displacement (n,) m of the lattice by noise with the spectra of walls and roof."""
    share = lattice.roof_share
    wanted = solid_noise(lattice.vertices, [wall, roof], [1 - share, share], rng)
    return wanted * slow_modulation(lattice.vertices, modulation.wavelength_m, modulation.spread, rng)


def solid_noise(
    points: np.ndarray, bands: list[Bands], shares: list[np.ndarray], rng: np.random.Generator
) -> np.ndarray:
    """Evaluate band noise; several spectra are mixed at each point over the same waves.

    Parameters
    ----------
    points : (n, 3) m
    bands : list of Bands
        All with the same wavelengths.
    shares : list of (n,)
        Weight of each spectrum's s.d. at each point.
    rng : numpy.random.Generator
        Draws directions, wavelengths within the bands, and phases.

    Returns
    -------
    (n,) m
        Mean 0; evaluated in 32 bits.
    """
    field = np.zeros(len(points))
    for b, unit in enumerate(unit_bands(points, bands[0].wavelength_m, rng)):
        field += unit * sum(share * spectrum.sd_m[b] for spectrum, share in zip(bands, shares, strict=True))
    return field


def unit_bands(points: np.ndarray, wavelength_m: np.ndarray, rng: np.random.Generator) -> Iterator[np.ndarray]:
    """Yield the noise (n,) of each band in turn, with s.d. 1."""
    for wavelength in wavelength_m.tolist():
        yield _sum_of_waves(points, *_waves(wavelength, rng))


def slow_modulation(points: np.ndarray, wavelength_m: float, spread: float, rng: np.random.Generator) -> np.ndarray:
    """Return a log-normal factor (n,) of mean square 1 that varies slowly in space; its logarithm has s.d. `spread`."""
    k, phase = _waves(wavelength_m, rng)
    return np.exp(spread * _sum_of_waves(points, k, phase) - spread**2)


def _waves(wavelength_m: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw the waves of a band: cycles per metre (3, n) and phases (n,) in cycles."""
    direction = rng.standard_normal((3, _WAVES))
    direction /= np.linalg.norm(direction, axis=0)
    shortest, longest = band_edges(wavelength_m)
    length = np.exp(rng.uniform(np.log(shortest), np.log(longest), _WAVES))
    return direction / length, rng.uniform(0, 1, _WAVES)


def _sum_of_waves(points: np.ndarray, cycles_per_m: np.ndarray, phase: np.ndarray) -> np.ndarray:
    total = np.empty(len(points))
    for at in range(0, len(points), _BLOCK):
        cycles = points[at : at + _BLOCK] @ cycles_per_m + phase
        cycles -= np.rint(cycles)  # in 64 bits: 32 bits would lose the phase far from the origin
        total[at : at + _BLOCK] = np.cos(np.float32(2 * np.pi) * cycles.astype(np.float32)).sum(axis=1)
    return total * np.sqrt(2 / cycles_per_m.shape[1])
