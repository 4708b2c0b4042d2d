"""How deep convex parts reach into the free space: the largest distance from its surface that a part has in it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import manifold3d
import numpy as np

from pipeline.geometry.facets.inside import Inside
from pipeline.geometry.nearest_facets import closest_points
from pipeline.volume.rock.tiles import Tile

_KNOWN_M = 1e-4  # to which a depth is known
_TOGETHER = 100_000  # cells; where more are left, the depth is what they may have at most
_ASKED = 256  # places that rays call free and the solid angle does not, until one counts as free


@dataclass(frozen=True)
class Depth:
    """A depth, m, and its place (3,) m: within 0.1 mm, or an upper bound where a part has too many cells left."""

    depth_m: float
    place_m: np.ndarray


def deepest(parts: Iterable[np.ndarray], free: Tile, inside: Inside, corners: np.ndarray) -> Depth:
    """Return how deep the deepest of some convex parts reaches into the free space.

    A boolean gives what a part shares with the free space. Tetrahedra cover it, and those that may hold a deeper place
    than the deepest known one are cut in two. The distance from one facet is convex, so that in a tetrahedron it is
    largest at a corner; the distance from the surface is no larger.

    Parameters
    ----------
    parts : iterable of (k, 3) float64, m
        The corners of each part.
    free : Tile
        The free space, in the frame of the parts.
    inside : Inside
        Of the same free space.
    corners : (f, 3, 3) float64, m
        Its facets.
    """
    deepest_one = Depth(0.0, np.zeros(3))
    for part in parts:
        cells = _cells_of(part, free, inside)
        while len(cells):
            middles, from_rock, most, found = _bounds(cells, inside, corners, deepest_one.depth_m)
            if found is not None:
                deepest_one = Depth(float(from_rock[found]), middles[found])
            left = most > deepest_one.depth_m + _KNOWN_M
            if left.sum() > _TOGETHER:
                deepest_one = Depth(float(most.max()), middles[most.argmax()])
                break
            cells = _halves(cells[left])
    return deepest_one


def is_deeper(part: np.ndarray, than_m: float, free: Tile, inside: Inside, corners: np.ndarray) -> bool:
    """Return whether a part (k, 3) m reaches deeper into the free space than `than_m`, to 0.1 mm, as `deepest` does.

    The search ends at the first place that is deeper, and leaves out what cannot be: a small part of the search for
    how deep it is. It also ends, with yes, where rays miscount at hundreds of places: one such part of a scan took over
    a minute, 718 others 4 s together.
    """
    cells = _cells_of(part, free, inside)
    while len(cells):
        _, _, most, found = _bounds(cells, inside, corners, than_m, _ASKED)
        left = most > than_m + _KNOWN_M
        if left.sum() > _TOGETHER or found is not None:
            return True
        cells = _halves(cells[left])
    return False


def _bounds(
    cells: np.ndarray, inside: Inside, corners: np.ndarray, than_m: float, asked: float = np.inf
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int | None]:
    """Return the middles (n, 3) m of tetrahedra, how far they and any place of them may be from rock, (n,) m.

    The last is the number of the deepest middle that is in the free space, if it is deeper than `than_m`; see
    `_deepest_free`.
    """
    middles = cells.mean(axis=1)
    from_rock, facet = inside.nearest(middles)
    found = _deepest_free(middles, from_rock, inside, than_m, asked)
    reach = np.linalg.norm(cells - middles[:, None], axis=2).max(axis=1)
    beside = closest_points(np.repeat(corners[facet], 4, axis=0), cells.reshape(-1, 3))
    apart = np.linalg.norm(cells - beside.reshape(-1, 4, 3), axis=2).max(axis=1)
    return middles, from_rock, np.minimum(from_rock + reach, apart), found


def _deepest_free(
    middles: np.ndarray, from_rock: np.ndarray, inside: Inside, than_m: float, asked: float
) -> int | None:
    """Return the number of the deepest place that is in the free space and deeper than `than_m`.

    Of deeper ones that are not, `from_rock` (n,) m becomes negative: rays miscount where a mesh crosses itself. After
    about so many as `asked` the next one counts as free.
    """
    deeper = np.flatnonzero(from_rock > than_m)
    deeper = deeper[np.argsort(-from_rock[deeper], kind="stable")]
    for number in range(len(deeper).bit_length()):  # each time twice as many: a solid angle takes long
        some = deeper[2**number - 1 : 2 ** (number + 1) - 1]
        if 2**number > asked:
            return int(some[0])
        free = inside.are_free(middles[some])
        if free.any():
            return int(some[free.argmax()])
        from_rock[some] *= -1
    return None


def _cells_of(part: np.ndarray, free: Tile, inside: Inside) -> np.ndarray:
    """Return tetrahedra (n, 4, 3) m that cover what a part shares with the free space, and more of the part.

    A boolean may lose a needle: of one 4 cm long and 0.3 mm wide, all of it in the free space, 0.005 % were left. So
    those of the whole part are there as well if its middle is in the free space.
    """
    hull, found = manifold3d.Manifold.hull_points(part), [np.zeros((0, 4, 3))]
    tiles = free.about(part.min(axis=0), part.max(axis=0))
    pieces = [piece for tile in tiles for piece in (tile.solid ^ hull).decompose()]
    for piece in [*pieces, hull] if inside.are_free(part.mean(axis=0)[None])[0] else pieces:
        mesh = piece.to_mesh64()
        places = np.asarray(mesh.vert_properties)[:, :3]
        sides = places[np.asarray(mesh.tri_verts, np.int64)]
        middle = np.broadcast_to(places.mean(axis=0), (len(sides), 1, 3)) if len(sides) else np.zeros((0, 1, 3))
        found.append(np.concatenate([sides, middle], axis=1))
    return np.concatenate(found)


def _halves(cells: np.ndarray) -> np.ndarray:
    """Return the halves (2 n, 4, 3) of tetrahedra, each cut across its longest edge."""
    first, second = np.triu_indices(4, 1)
    longest = np.linalg.norm(cells[:, first] - cells[:, second], axis=2).argmax(axis=1)
    rows, a, b = np.arange(len(cells)), first[longest], second[longest]
    middle = (cells[rows, a] + cells[rows, b]) / 2
    one, other = cells.copy(), cells.copy()
    one[rows, a], other[rows, b] = middle, middle
    return np.concatenate([one, other])
