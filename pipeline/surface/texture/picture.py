"""A rock texture made of seeded noise, so that the world needs no photograph."""

from __future__ import annotations

import numpy as np

from pipeline.types import Image


def make_texture(
    size_px: int, spectral_exponent: float, contrast: float, rgb: tuple[int, int, int], rng: np.random.Generator
) -> Image:
    """Return a square texture that repeats without a seam.

    Noise is filtered in the frequency domain, which makes it periodic. All channels share one brightness field, and
    each has a weaker field of its own, which varies the hue.

    Parameters
    ----------
    size_px : int
    spectral_exponent : float
        Amplitude is proportional to frequency to the power of minus this.
    contrast : float
        Standard deviation of the brightness as a share of its mean.
    rgb : 3 ints, 0-255
        Mean colour.
    rng : numpy.random.Generator

    Returns
    -------
    (size_px, size_px, 3) uint8
        Channels in OpenCV's order: blue, green, red.
    """
    frequency = np.hypot(np.fft.fftfreq(size_px)[:, None], np.fft.rfftfreq(size_px)[None, :])
    frequency[0, 0] = np.inf
    fields = []
    for _ in range(4):
        white = np.fft.rfft2(rng.standard_normal((size_px, size_px)))
        field = np.fft.irfft2(white * frequency**-spectral_exponent, s=(size_px, size_px))
        fields.append(field / field.std())
    tone = 1.0 + contrast * (fields[0][..., None] + 0.08 * np.stack(fields[1:], axis=-1))
    return np.clip(np.round(np.array(rgb[::-1]) * tone), 0, 255).astype(np.uint8)
