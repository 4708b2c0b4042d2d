"""Band spectra and their predicted roughness, for the tests of noise and surface."""

from __future__ import annotations

import math

import numpy as np

from pipeline.surface.relief.spectrum import Bands, Roughness, band_wavelengths, residual_share

WAVES = band_wavelengths(0.4, 4.0)


def flat_bands(rms_m: float, wavelength_m: np.ndarray = WAVES) -> Bands:
    """Return bands of equal standard deviation, rms_m (m) together."""
    return Bands(wavelength_m, np.full(len(wavelength_m), rms_m / math.sqrt(len(wavelength_m))))


def predicted_rq(bands: Bands, window: Roughness) -> float:
    """Return the RMS residual, m, in a window on a plane surface displaced by these bands."""
    shares = [residual_share(w, window.window_m, window.degree, window.line) for w in bands.wavelength_m.tolist()]
    return float(np.sqrt(np.dot(shares, bands.sd_m**2)))
