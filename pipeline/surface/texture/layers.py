"""A texture of rock in layers of seeded noise: tint, mineral grain, cracks and veins, stain, wet streaks, dust."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.types import Image

_VEIN, _DUST = np.array([205.0, 200.0, 190.0]), np.array([150.0, 141.0, 128.0])  # quartz; dry drill and road dust
_RUST = np.array([0.92, 0.66, 0.44])  # what iron oxide leaves of each channel
_FILM, _WET = 0.2, 0.5  # of the light, that damp rock and a film of water take: wet rock reflects half of dry rock's
_HUES = 4  # of a brightness in the palette


@dataclass(frozen=True)
class Layers:
    """How strong each layer is, from 0 (none) to 1.

    `tint` varies colour over metres, `grain` are light and dark minerals of a few millimetres with cracks and veins,
    `stain` is iron oxide, `streaks` are wet and run along the texture's second axis, `dust` covers all else.
    """

    tint: float
    grain: float
    stain: float
    streaks: float
    dust: float


@dataclass(frozen=True)
class _Canvas:
    """A square of `size_px` that covers `repeat_m` and repeats without a seam."""

    size_px: int
    repeat_m: float
    rng: np.random.Generator

    def noise(self, shortest_m: float, longest_m: float, slope: float, across: float = 1.0) -> np.ndarray:
        """Return noise of s.d. 1 between two wavelengths, amplitude ~ frequency^-slope.

        With `across` below 1 structures are that many times longer along the first axis of the array.
        """
        step_m = self.repeat_m / self.size_px
        shortest_m = max(shortest_m, 2.2 * step_m)  # what the pixels can hold
        rows, columns = np.fft.fftfreq(self.size_px, step_m) / across, np.fft.rfftfreq(self.size_px, step_m)
        columns = columns[columns <= 1 / shortest_m]  # the others would be set to 0
        frequency = np.hypot(rows[:, None], columns[None, :])
        frequency[0, 0] = np.inf
        kept = (frequency >= 1 / min(longest_m, self.repeat_m)) & (frequency <= 1 / shortest_m)
        along = np.fft.rfft(self.rng.standard_normal((self.size_px, self.size_px)))[:, : len(columns)]
        white = np.fft.fft(along, axis=0)
        shaped = np.zeros_like(white)
        shaped[kept] = white[kept] * frequency[kept] ** -slope
        field = np.fft.irfft(np.fft.ifft(shaped, axis=0), self.size_px)
        return field / max(float(field.std()), 1e-12)


def make_rock_texture(
    size_px: int, repeat_m: float, rgb: tuple[int, int, int], layers: Layers, colours: int, rng: np.random.Generator
) -> Image:
    """Return a square texture of rock that repeats without a seam, with few enough colours for a palette.

    Parameters
    ----------
    size_px : int
    repeat_m : float
        Length on the rock that the texture covers.
    rgb : 3 ints, 0-255
        Mean colour of clean dry rock.
    layers : Layers
    colours : int
        Greatest number of different colours.
    rng : numpy.random.Generator

    Returns
    -------
    (size_px, size_px, 3) uint8
        Channels in OpenCV's order: blue, green, red. Rows run down, as water does.
    """
    canvas = _Canvas(size_px, repeat_m, rng)
    mottle = canvas.noise(0.03, 0.5, 1.3)
    picture = _tinted(canvas, rgb, layers.tint) * (1 + 0.09 * mottle[..., None])
    picture = _grained(canvas, picture, layers.grain)
    rust = layers.stain * _ramp(canvas.noise(0.15, 1.5, 1.3) + 0.35 * mottle, 0.7, 1.9)[..., None]
    picture += 0.75 * rust * (_RUST * picture.mean(axis=2, keepdims=True) - picture)
    streak = 0.7 * canvas.noise(0.08, 0.8, 1.2, across=0.15) + 0.8 * canvas.noise(0.3, repeat_m, 1.0)
    picture *= 1 - layers.streaks * (_FILM + (_WET - _FILM) * _ramp(streak, -0.4, 2.0))[..., None]
    cover = np.clip(layers.dust * (0.75 + 0.3 * canvas.noise(0.1, 1.0, 1.2)), 0.0, 1.0)[..., None]
    picture += 0.75 * cover * (_DUST - picture)
    return reduce_colours(np.clip(np.round(picture), 0, 255).astype(np.uint8), colours)[..., ::-1].copy()


def _tinted(canvas: _Canvas, rgb: tuple[int, int, int], tint: float) -> np.ndarray:
    brightness, hue = canvas.noise(0.7, canvas.repeat_m, 1.0), canvas.noise(0.5, canvas.repeat_m, 1.2)
    warm = hue[..., None] * np.array([1.0, 0.1, -1.0])
    return np.array(rgb, float) * (1 + tint * (0.09 * brightness[..., None] + 0.03 * warm))


def _grained(canvas: _Canvas, picture: np.ndarray, grain: float) -> np.ndarray:
    """Add feldspar and dark minerals of 4 to 20 mm, dark cracks, and light veins."""
    mineral = canvas.noise(0.004, 0.02, 0.3)
    picture = picture * (1 + grain * (0.45 * _ramp(mineral, 1.1, 1.7) - 0.4 * _ramp(-mineral, 1.2, 1.8))[..., None])
    # The line on which smooth noise is zero wanders as a crack does; a second noise says where there are any.
    line = canvas.noise(0.12, 1.2, 1.6) + 0.12 * canvas.noise(0.02, 0.12, 1.0)
    crack = np.exp(-((line / 0.012) ** 2)) * _ramp(canvas.noise(0.4, 4.0, 1.0), -0.2, 0.6)
    picture = picture * (1 - 0.5 * grain * crack[..., None])
    line = canvas.noise(0.4, 2.0, 1.6) + 0.05 * canvas.noise(0.03, 0.2, 1.0)
    vein = np.exp(-(((line - 0.7) / 0.012) ** 2)) * _ramp(canvas.noise(0.4, 4.0, 1.0), 0.2, 1.0)
    return picture + 0.5 * grain * vein[..., None] * (_VEIN - picture)


def _ramp(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return 0 below `low`, 1 above `high`, and a smooth rise between."""
    share = np.clip((values - low) / (high - low), 0.0, 1.0)
    return share * share * (3 - 2 * share)


def reduce_colours(picture: np.ndarray, most: int) -> np.ndarray:
    """Return a picture (n, n, 3) uint8 with at most `most` colours.

    Pixels are sorted by brightness into classes of equal size, and each class by hue; a class has its mean colour.
    """
    pixels = picture.reshape(-1, 3).astype(np.int64)
    bright, warm = pixels @ [2, 5, 1], pixels[:, 0] - pixels[:, 2]
    bright, warm = bright.astype(np.int16), warm.astype(np.int16)  # NumPy sorts these by counting
    classes = np.zeros(len(pixels), dtype=np.int64)
    levels = max(1, most // _HUES)
    order = np.lexsort((warm, bright))
    for level, members in enumerate(np.array_split(order, levels)):
        by_hue = members[np.argsort(warm[members], kind="stable")]
        for hue, part in enumerate(np.array_split(by_hue, min(_HUES, most))):
            classes[part] = level * _HUES + hue
    count = np.maximum(np.bincount(classes, minlength=levels * _HUES), 1)
    sums = [np.bincount(classes, pixels[:, k], levels * _HUES) for k in range(3)]
    palette = np.round(np.column_stack(sums) / count[:, None]).astype(np.uint8)
    return palette[classes].reshape(picture.shape)
