"""Planes and boxes with the surface of a floor's wedges, for local models.

MuJoCo finds the contact of a wheel with a plane or a box by a formula, and with a wedge, which is a mesh, by a search
that takes several times as long. A wedge's plane may go on beyond the wedge wherever the floor is not lower. Where
the floor is nowhere lower, a plane has the wedge's surface. Where a rectangle holds the wedge and nothing of what is
lower, a box has it.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from minexplore.rotations import quaternion

_OFF_M = 0.0005  # what is nearer to a plane than this lies on it
_ASIDE_M = 0.001  # outlines that overlap by no more are apart
_STEEPEST = 1.0  # a box of steeper ground could come out beside a lower floor
_SHARE = 1e-9  # of a wedge's size: corners of its top and its bottom are no farther apart in plan


@dataclass(frozen=True)
class Primitive:
    """A plane or a box (m) whose upper face is the top of a wedge, and maybe of others: MuJoCo's words for it."""

    wedge: int
    type: mujoco.mjtGeom
    place: np.ndarray
    quaternion: np.ndarray
    size: np.ndarray


@dataclass(frozen=True)
class _Top:
    """The part of a wedge's top within a box of the plan: its corners (k, 3) m, plane and zone.

    `plane` is (a, b, c) of z = a x + b y + c, or nothing where the top is not one.
    """

    corners: np.ndarray
    plane: np.ndarray | None
    zone: str
    thick_m: float


def simplify_floor(
    wedges: list[np.ndarray], zones: list[str], low_m: np.ndarray, high_m: np.ndarray
) -> tuple[list[Primitive], list[int]]:
    """Return what has the surface of the floor's wedges within a box of the plan.

    Parameters
    ----------
    wedges : list of (2 k, 3) float64, m, mine frame
        All wedges that reach into the box: the corners of each one's bottom, and those of its top in the same order.
    zones : list of str
        The floor zone of each.
    low_m, high_m : (2,) float64, m, mine frame
        The box.

    Returns
    -------
    primitives : list of Primitive
        Nowhere in the box higher than the wedges, nor lower than those that they replace, by more than a millimetre.
    kept : list of int
        The wedges that no primitive replaces.
    """
    found = [_top_of(wedge, zone, low_m, high_m) for wedge, zone in zip(wedges, zones, strict=True)]
    if any(top is None for top in found):  # its surface is known only from its hull
        return [], list(range(len(wedges)))
    tops = {number: top for number, top in enumerate(found) if top is not None and len(top.corners) > 2}
    options = [option for number in tops for option in _options(number, tops)]
    left, primitives = set(tops), []
    while options:
        best, covered = max(options, key=lambda option: (len(option[1] & left), option[0].type == _PLANE))
        if not covered & left:
            break
        primitives.append(best)
        left -= covered
    return primitives, sorted(left)


_PLANE, _BOX = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_BOX


def _top_of(wedge: np.ndarray, zone: str, low_m: np.ndarray, high_m: np.ndarray) -> _Top | None:
    """Return the top of a wedge within a box; nothing if the wedge is no slab under a convex loop."""
    bottom, top = wedge[: len(wedge) // 2], wedge[len(wedge) // 2 :]
    if len(wedge) % 2 or np.abs(bottom[:, :2] - top[:, :2]).max() > _SHARE * np.ptp(wedge, axis=0).max():
        return None
    along = np.roll(top, -1, axis=0) - top
    after = np.roll(along, -1, axis=0)
    turns = along[:, 0] * after[:, 1] - along[:, 1] * after[:, 0]
    if (turns < -1e-6).any() or (top[:, 2] <= bottom[:, 2]).any():
        return None
    middle = top.mean(axis=0)
    places = np.column_stack([top[:, :2] - middle[:2], np.ones(len(top))])
    (a, b, c), *_ = np.linalg.lstsq(places, top[:, 2] - middle[2], rcond=None)
    plane = np.array([a, b, c + middle[2] - a * middle[0] - b * middle[1]])
    is_plane = np.abs(_over(plane, top)).max() <= _OFF_M and np.hypot(a, b) <= _STEEPEST
    corners = top
    for axis in (0, 1):
        corners = _cut(corners, corners[:, axis] - low_m[axis])
        corners = _cut(corners, high_m[axis] - corners[:, axis])
    return _Top(corners, plane if is_plane else None, zone, float((top - bottom)[:, 2].min()))


def _cut(loop: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Return the part of a convex loop (k, n) where a linear function, (k,) at its corners, is positive."""
    kept = []
    for i in range(len(loop)):
        j = (i + 1) % len(loop)
        if inside[i] >= 0:
            kept.append(loop[i])
        if (inside[i] >= 0) != (inside[j] >= 0):
            kept.append(loop[i] + inside[i] / (inside[i] - inside[j]) * (loop[j] - loop[i]))
    return np.array(kept).reshape(-1, loop.shape[1])


def _over(plane: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return how high (k,) m a plane is over points (k, 3) m."""
    return points[:, 0] * plane[0] + points[:, 1] * plane[1] + plane[2] - points[:, 2]


def _options(number: int, tops: dict[int, _Top]) -> list[tuple[Primitive, set[int]]]:
    """Return the primitives with a wedge's plane as their surface, and the wedges whose tops each of them has."""
    own = tops[number]
    if own.plane is None:
        return []
    over = {k: _over(own.plane, top.corners) for k, top in tops.items()}
    others = {k for k, top in tops.items() if top.zone != own.zone}
    lower = [tops[k].corners for k in others]  # as one zone's floor must not reach into another's
    for k in tops.keys() - others:
        if over[k].max() > _OFF_M:
            lower.append(_cut(tops[k].corners, over[k] - _OFF_M))
    lower = [loop for loop in lower if len(loop) > 2]
    frame = _Frame.on(own)
    if not lower:
        on_it = {k for k in tops if over[k].min() >= -_OFF_M}
        return [(Primitive(number, _PLANE, frame.origin, quaternion(frame.axes), np.array([0.0, 0.0, 1.0])), on_it)]
    on_it = {k for k in tops.keys() - others if np.abs(over[k]).max() <= _OFF_M}
    for covered in (on_it, {number}):
        box = frame.box_round([tops[k].corners for k in sorted(covered)], lower, own.thick_m)
        if box is not None:
            return [(Primitive(number, _BOX, *box), covered)]
    return []


@dataclass(frozen=True)
class _Frame:
    """A frame on a plane (3,): a point of it (3,) m, and axes (3, 3), as columns; the last is its normal."""

    plane: np.ndarray
    origin: np.ndarray
    axes: np.ndarray

    @classmethod
    def on(cls, top: _Top) -> _Frame:
        """Return a frame on a wedge's plane."""
        assert top.plane is not None
        a, b, c = top.plane
        x, y = top.corners[:, :2].mean(axis=0)
        normal, ahead = np.array([-a, -b, 1.0]) / np.sqrt(a * a + b * b + 1), np.array([1.0, 0.0, a]) / np.hypot(1, a)
        axes = np.column_stack([ahead, np.cross(normal, ahead), normal])
        return cls(top.plane, np.array([x, y, a * x + b * y + c]), axes)

    def places(self, corners: np.ndarray) -> np.ndarray:
        """Return where on the plane (k, 2) m points (k, 3) m of the mine frame are, seen from above."""
        on_it = corners + np.outer(_over(self.plane, corners), [0.0, 0.0, 1.0])
        return np.asarray((on_it - self.origin) @ self.axes[:, :2])

    def box_round(
        self, inside: list[np.ndarray], outside: list[np.ndarray], thick_m: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Return place, quaternion and size of a box that holds some loops (k, 3) m, seen from above, and no others."""
        found = _rectangle_round(*(_Loops.of(loops, self.places(np.concatenate(loops))) for loops in (inside, outside)))
        if found is None:
            return None
        along, low, high = found
        turn = np.array([[along[0], -along[1], 0], [along[1], along[0], 0], [0, 0, 1]])
        axes = self.axes @ turn
        half = np.append((high - low) / 2, thick_m / 2)
        middle = np.append((low + high) / 2, -half[2])
        return self.origin + axes @ middle, quaternion(axes), half


@dataclass(frozen=True)
class _Loops:
    """Convex loops on a plane: corners (n, 2) m, the edges (n, 2) that begin there, and where each loop begins."""

    corners: np.ndarray
    edges: np.ndarray
    first: np.ndarray

    @classmethod
    def of(cls, loops: list[np.ndarray], corners: np.ndarray) -> _Loops:
        """Take all loops' corners (n, 2) m, of which each loop has as many as it is long."""
        ends = np.cumsum([len(loop) for loop in loops])
        first, after = np.append(0, ends[:-1]), np.arange(1, len(corners) + 1)
        after[ends - 1] = first
        return cls(corners, corners[after] - corners, first)


def _rectangle_round(inside: _Loops, outside: _Loops) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return a rectangle that holds loops and none of others: direction (2,), least and most (2,) m along its sides."""
    ways = np.concatenate([inside.edges, outside.edges])
    length = np.hypot(ways[:, 0], ways[:, 1])
    ways = ways[length > _ASIDE_M] / length[length > _ASIDE_M, None]
    turns = np.stack([ways, np.column_stack([-ways[:, 1], ways[:, 0]])], axis=1)  # (ways, 2 axes, 2)
    own = np.einsum("wij,kj->wki", turns, inside.corners)
    low, high = own.min(axis=1), own.max(axis=1)
    # A loop is outside of a rectangle if a side of either has the other beyond it.
    theirs = np.einsum("wij,kj->wki", turns, outside.corners)
    least, most = (function.reduceat(theirs, outside.first, axis=1) for function in (np.minimum, np.maximum))
    beside = (least > high[:, None] - _ASIDE_M) | (most < low[:, None] + _ASIDE_M)
    ends = np.stack([np.where(pick, high, low) for pick in ((0, 0), (0, 1), (1, 0), (1, 1))], axis=1)
    ends = np.einsum("wki,wij->wkj", ends, turns)
    edges = outside.edges
    normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.maximum(np.hypot(*edges.T), 1e-12)[:, None]
    nearest = np.einsum("wkj,ej->wke", ends, normals).min(axis=1)
    behind = nearest - (normals * outside.corners).sum(axis=1) > -_ASIDE_M
    apart = beside.any(axis=2) | np.logical_or.reduceat(behind, outside.first, axis=1)
    fits = np.flatnonzero(apart.all(axis=1) & (high - low > 2 * _ASIDE_M).all(axis=1))
    return (ways[fits[0]], low[fits[0]], high[fits[0]]) if len(fits) else None
