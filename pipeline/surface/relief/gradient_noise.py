"""Random numbers and smooth noise that depend only on integers and places, so that surfaces have no seams.

Integers are hashed, and the noise uses additions and products of 64-bit floats in a fixed order, so every processor
gives the same numbers.
"""

from __future__ import annotations

import numpy as np

_WORD = 1 << 64
_ODD = (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0xD6E8FEB86659FD93)
_BLOCK = 131072  # points at a time: smaller arrays make threads wait for each other, larger ones leave the cache
_CELLS_PER_WAVE = 1.5  # gradient noise is strongest at about 1.5 cells


def hashed(seed: int, *numbers: np.ndarray) -> np.ndarray:
    """Return a hash (n,) uint64 of a seed and integers (n,) int64 each.

    References
    ----------
    Finaliser of MurmurHash3, Appleby 2011, public domain.
    """
    word = np.full(np.shape(numbers[0]), (seed * _ODD[3] + 1) % _WORD, np.uint64)
    for place, number in enumerate(numbers[: len(_ODD)]):
        word = hashed_on(word, place, number)
    return word


def hashed_on(word: np.ndarray, place: int, number: np.ndarray) -> np.ndarray:
    """Return the hash (n,) of `hashed` after one more integer (n,), its `place`-th; `word` (n,) is that before it."""
    mixed = number.astype(np.int64).view(np.uint64) * np.uint64(_ODD[place])
    mixed ^= word
    return _mix(mixed)


def uniform(word: np.ndarray, draw: int) -> np.ndarray:
    """Return the `draw`-th number (n,) in [0, 1) of each hash (n,)."""
    return (_mix(word + np.uint64(((draw + 1) * _ODD[1]) % _WORD)) >> np.uint64(11)) * 2.0**-53


def bell(word: np.ndarray, draw: int) -> np.ndarray:
    """Return numbers (n,) of mean 0, s.d. 1 and at most 3.5 (a sum of four uniform numbers): nearly normal."""
    total = sum(uniform(word, 4 * draw + k + 1000) for k in range(4))
    return (total - 2.0) * np.sqrt(3.0)


def gradient_noise(points: np.ndarray, wavelength_m: float, seed: int) -> np.ndarray:
    """Return smooth noise (n,) with mean 0 and s.d. 1 at points (n, 3) m.

    References
    ----------
    Perlin 2002, Improving noise, doi:10.1145/566654.566636
    """
    turned = _turned(points, seed) * (_CELLS_PER_WAVE / wavelength_m)
    parts = [turned[:, at : at + _BLOCK] for at in range(0, turned.shape[1], _BLOCK)]
    return np.concatenate([np.zeros(0), *(_noise(part, seed) for part in parts)])


def self_affine(
    points: np.ndarray, rms_m: float, hurst: float, shortest_m: float, longest_m: float, seed: int
) -> np.ndarray:
    """Return noise (n,) m whose octaves from `shortest_m` to `longest_m` have amplitudes ~ wavelength^hurst."""
    octaves = max(1, int(np.floor(np.log2(longest_m / shortest_m) + 1e-9)) + 1)
    wavelength = [longest_m / 2**k for k in range(octaves)]
    amplitude = np.array([(w / longest_m) ** hurst for w in wavelength])
    amplitude *= rms_m / np.sqrt((amplitude**2).sum())
    field = np.zeros(len(points))
    for k, (w, a) in enumerate(zip(wavelength, amplitude.tolist(), strict=True)):
        field += a * gradient_noise(points, w, seed + k)
    return field


def _mix(word: np.ndarray) -> np.ndarray:
    """Mix the bits of words (n,) in place, and return them."""
    word ^= word >> np.uint64(33)
    word *= np.uint64(0xFF51AFD7ED558CCD)
    word ^= word >> np.uint64(33)
    word *= np.uint64(0xC4CEB9FE1A85EC53)
    word ^= word >> np.uint64(33)
    return word


def _turned(points: np.ndarray, seed: int) -> np.ndarray:
    """Return the points as (3, n), turned by a rotation of the seed: cells must not lie along walls and floor."""
    numbers = uniform(hashed(seed, np.arange(4)), 0) - 0.5
    w, x, y, z = numbers / np.sqrt((numbers * numbers).sum())
    rotation = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    px, py, pz = points.T
    return np.stack([a * px + b * py + c * pz for a, b, c in rotation])


def _noise(cells: np.ndarray, seed: int) -> np.ndarray:
    """Evaluate gradient noise at places (3, n) in cells."""
    low = np.floor(cells)
    (x, y, z), corner = cells - low, low.astype(np.int64)
    fade = [t * t * t * (t * (t * 6 - 15) + 10) for t in (x, y, z)]
    total = np.zeros(cells.shape[1])
    fade_x, fade_y, fade_z = ((1 - t, t) for t in fade)
    along_x, along_y, along_z = ((t, t - 1) for t in (x, y, z))
    for i in (0, 1):
        in_x = hashed(seed, corner[0] + i)
        for j in (0, 1):
            in_xy = hashed_on(in_x, 1, corner[1] + j)
            fade_xy = fade_x[i] * fade_y[j]
            for k in (0, 1):
                word = hashed_on(in_xy, 2, corner[2] + k)
                a, b, c = (_component(word, n) for n in range(3))
                total += fade_xy * fade_z[k] * (a * along_x[i] + b * along_y[j] + c * along_z[k])
    return total / _UNIT_SD


def _component(word: np.ndarray, n: int) -> np.ndarray:
    """Return the `n`-th component (m,) of the gradients that the hashes (m,) hold, in [-1, 1)."""
    bits = (word >> np.uint64(21 * n)) & np.uint64(0x1FFFFF)
    share = bits.view(np.int64).astype(np.float64)  # faster than from unsigned numbers
    share *= 2.0**-20
    share -= 1.0
    return share


def _noise_sd() -> float:
    """Return the s.d. of the noise before scaling: gradients have variance 1/3, the rest is integrated over a cell."""
    t = (np.arange(2000) + 0.5) / 2000
    weight = 1 - t * t * t * (t * (t * 6 - 15) + 10)
    return float(np.sqrt(8 * (1 / 3) * 3 * np.mean(weight**2 * t**2) * np.mean(weight**2) ** 2))


_UNIT_SD = _noise_sd()
