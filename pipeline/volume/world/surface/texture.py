"""Texture coordinates of a volume's rock: laid along the walls and up, or level where the rock lies level."""

from __future__ import annotations

import numpy as np

from pipeline.surface.mesh.lattice import ROOF
from pipeline.surface.texture.coordinates import relax_texture
from pipeline.volume.world.surface.displace import DisplacedRock

_WAYS = 4  # of the plan that textures of walls run along: a wall is at most 22.5 deg off one of them
_LEVEL = 0.7  # of a normal's height: such rock has the texture of a roof


def texture_groups(rock: DisplacedRock) -> np.ndarray:
    """Return the number (m,) of the way that the texture of each face of the mesh runs along; `_WAYS` is level.

    The way is that of the points before displacement, so that it does not change from block to block.
    """
    mesh = rock.mesh
    inward = rock.fine.direction[mesh.source[mesh.faces]].mean(axis=1)
    level = (mesh.piece == ROOF) & (np.abs(inward[:, 2]) > _LEVEL / 2) | (np.abs(inward[:, 2]) > _LEVEL)
    along = np.arctan2(inward[:, 0], -inward[:, 1])
    way = np.rint(along / (np.pi / _WAYS)).astype(np.int64) % _WAYS
    found: np.ndarray = np.where(level, _WAYS, way)
    return found


def lay_texture(rock: DisplacedRock, group: np.ndarray, tether_m: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Return the coordinates (n, 2, groups) m of the mesh's vertices, and what to add to them (n, 2) m.

    They are those of the places before displacement; what is added lets the texture follow the rock, see
    `relax_texture`.
    """
    mesh = rock.mesh
    places = rock.fine.vertices[mesh.source] + (mesh.vertices - rock.vertices[mesh.source])
    axes = texture_axes()
    laid = np.stack([places @ pair.T for pair in axes], axis=2)
    if tether_m is None:
        return laid, np.zeros((len(places), 2))
    corners = laid[mesh.faces, :, group[:, None]]
    return laid, relax_texture(mesh.vertices, mesh.faces, corners, axes[group], tether_m)


def facing_sides(rock: DisplacedRock, group: np.ndarray) -> np.ndarray:
    """Return which faces (m,) look along the positive side of their group's third axis; opposite walls do not."""
    inward = rock.fine.direction[rock.mesh.source[rock.mesh.faces]].mean(axis=1)
    third = np.cross(*texture_axes().transpose(1, 0, 2))
    return np.asarray(np.einsum("ij,ij->i", inward, third[group]) > 0)


def texture_axes() -> np.ndarray:
    """Return the axes (groups, 2, 3) of each group's texture: along the wall and up, or east and north."""
    angle = np.pi / _WAYS * np.arange(_WAYS)
    walls = [[[np.cos(a), np.sin(a), 0.0], [0.0, 0.0, 1.0]] for a in angle]
    return np.array([*walls, np.eye(3)[:2]])
