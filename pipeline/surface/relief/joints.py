"""Relief of jointed rock: faces bounded by joint sets, overbreak, and a self-affine undulation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.surface.relief.gradient_noise import bell, gradient_noise, hashed, self_affine, uniform

_WAVY_M = (0.8, 6.0)  # wavelengths of the joints' own waviness
_WAVY_HURST = 0.9
_NO_NORMAL = 1e-9
_SHIFT = 1000.0  # layers by which joints are offset where they end at another joint


@dataclass(frozen=True)
class JointSet:
    """A set of parallel joints: dip direction clockwise from north, dip below the horizontal, and mean spacing."""

    dip_direction_deg: float
    dip_deg: float
    spacing_m: float

    @property
    def normal(self) -> np.ndarray:
        """Return the upward unit normal (3,) in the mine frame: x east, y north, z up."""
        azimuth, dip = np.radians([self.dip_direction_deg, self.dip_deg])
        return np.array([np.sin(dip) * np.sin(azimuth), np.sin(dip) * np.cos(azimuth), np.cos(dip)])


@dataclass(frozen=True)
class Faces:
    """The faces that blocks leave in a wall.

    A share `stepped` of the blocks is set back or stands out; over all blocks the steps have the s.d. `step_m`. A face
    lies along a joint set if that is at most `follow_deg` from the wall, else it has slopes of s.d. `slope` at random.
    """

    step_m: float
    stepped: float
    slope: float
    follow_deg: float


@dataclass(frozen=True)
class Undulation:
    """Self-affine relief: RMS, Hurst exponent, and its shortest and longest wavelengths."""

    rms_m: float
    hurst: float
    shortest_m: float
    longest_m: float


@dataclass(frozen=True)
class Gains:
    """Factors of the parts of the relief; `fit_rock` finds those of a reference."""

    undulation: float = 1.0
    blocks: float = 1.0
    overbreak: float = 1.0


@dataclass(frozen=True)
class JointedRock:
    """Jointed rock.

    `sets` are in the order of persistence: the first is continuous, each other ends at those before it. `jitter` is the
    share of the spacing by which single joints lie off their even places, `waviness_m` the RMS deviation of a joint
    from a plane. Blocks are `overbreak_size` times larger where overbreak follows joints. Roughness varies along the
    drift over `patch_m` by a log-normal factor whose logarithm has s.d. `patchiness`.
    """

    sets: tuple[JointSet, ...]
    jitter: float
    waviness_m: float
    block: Faces
    overbreak: Faces
    overbreak_size: float
    undulation: Undulation
    patch_m: float
    patchiness: float
    gains: Gains = Gains()


def relief_of_joints(points: np.ndarray, inward: np.ndarray, rock: JointedRock, seed: int) -> np.ndarray:
    """Return the displacement (n,) m, positive into the workings, that jointed rock gives to a smooth surface.

    Parameters
    ----------
    points, inward : (n, 3)
        Places, m, mine frame, and unit normals of the smooth surface into the workings.
    rock : JointedRock
    seed : int
    """
    undulation, blocks, overbreak = parts_of_joints(points, inward, rock, seed)
    gains = rock.gains
    return gains.undulation * undulation + gains.blocks * blocks + gains.overbreak * overbreak


def parts_of_joints(points: np.ndarray, inward: np.ndarray, rock: JointedRock, seed: int) -> np.ndarray:
    """Return the parts (3, n) m of the relief before gains: undulation, blocks, overbreak; see `relief_of_joints`."""
    shift = [self_affine(points, rock.waviness_m, _WAVY_HURST, *_WAVY_M, seed + 100 * (k + 1)) for k in range(3)]
    wavy = points + np.stack(shift, axis=1)
    patch = np.exp(rock.patchiness * gradient_noise(points, rock.patch_m, seed + 400) - rock.patchiness**2)
    u = rock.undulation
    parts = [self_affine(points, u.rms_m, u.hurst, u.shortest_m, u.longest_m, seed + 600)]
    for k, (faces, size) in enumerate(((rock.block, 1.0), (rock.overbreak, rock.overbreak_size))):
        block = number_blocks(wavy, rock.sets, rock.jitter, size, seed + 500 + 50 * k)
        parts.append(patch * _cut_faces(wavy, inward, block, faces, rock.sets))
    return np.stack(parts)


def number_blocks(points: np.ndarray, sets: tuple[JointSet, ...], jitter: float, size: float, seed: int) -> np.ndarray:
    """Return a number (n,) uint64 for the block that holds each point (n, 3) m; spacings are multiplied by `size`."""
    x, y, z = points.T
    layers: list[np.ndarray] = []
    for k, joints in enumerate(sets):
        a, b, c = (joints.normal / (size * joints.spacing_m)).tolist()
        layers.append(_layer(a * x + b * y + c * z, jitter, seed + 10 * k, layers))
    return hashed(seed + 9, *layers)


def _layer(place: np.ndarray, jitter: float, seed: int, above: list[np.ndarray]) -> np.ndarray:
    """Return the layer (n,) between two joints; joints are offset anew in every block of the sets `above`."""
    if above:
        place = place + _SHIFT * uniform(hashed(seed, *above), 0)
    layer = np.floor(place).astype(np.int64)
    low, high = (layer + side + jitter * (uniform(hashed(seed + 1, layer + side, *above), 0) - 0.5) for side in (0, 1))
    return layer - (place < low) + (place >= high)


def _cut_faces(
    points: np.ndarray, inward: np.ndarray, block: np.ndarray, faces: Faces, sets: tuple[JointSet, ...]
) -> np.ndarray:
    """Return the displacement (n,) m of plane faces, one for each block."""
    name, index, count = np.unique(block, return_inverse=True, return_counts=True)
    centre, normal = (
        np.stack([np.bincount(index, v) for v in vectors.T], axis=1) / count[:, None] for vectors in (points, inward)
    )
    for lone in np.flatnonzero((np.abs(normal) < _NO_NORMAL).all(axis=1)).tolist():
        normal[lone] = inward[int(np.argmax(index == lone))]  # both walls of a narrow drift: that of its first point
    normal /= np.sqrt((normal * normal).sum(axis=1, keepdims=True))
    slope = _joint_slopes(normal, sets, faces.follow_deg)
    random = faces.slope * np.stack([bell(name, 10 + k) for k in range(3)], axis=1)
    random -= normal * (random * normal).sum(axis=1, keepdims=True)
    along_joint = np.any(slope != 0, axis=1, keepdims=True)
    slope += random * np.where(along_joint, 0.5, 1.0)
    step = faces.step_m * bell(name, 1) * (uniform(name, 2) < faces.stepped) / np.sqrt(faces.stepped)
    offset = points - centre[index]
    return step[index] + (offset * slope[index]).sum(axis=1)


def _joint_slopes(normal: np.ndarray, sets: tuple[JointSet, ...], follow_deg: float) -> np.ndarray:
    """Return the slope vectors (b, 3) that turn faces with normals (b, 3) into the nearest joint set, 0 if too far."""
    joints = np.stack([s.normal for s in sets])
    cosine = sum(normal[:, k, None] * joints[None, :, k] for k in range(3))
    nearest = np.abs(cosine).argmax(axis=1)
    cosine = np.take_along_axis(cosine, nearest[:, None], axis=1)
    slope = normal - joints[nearest] / cosine
    return np.where(np.abs(cosine) >= np.cos(np.radians(follow_deg)), slope, 0.0)
