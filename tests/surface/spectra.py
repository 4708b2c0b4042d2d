"""Roughness that a spectrum should give, for the tests of noise and fits."""

from __future__ import annotations

import numpy as np

from pipeline.surface.spectrum import Bands, Roughness, residual_share


def predicted_rq(bands: Bands, wanted: Roughness) -> float:
    """Return the RMS residual, m, that a plane surface displaced by these bands has in a window."""
    shares = [residual_share(w, wanted.window_m, wanted.degree, wanted.line) for w in bands.wavelength_m.tolist()]
    return float(np.sqrt(np.dot(shares, bands.sd_m**2)))
