"""The elements of a model by tag and name, and the comparison of their values with a record's."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import zip_longest

import numpy as np

from minexplore.bundle import FITTINGS_BODY, MINE_BODY, MODEL, RECORD, ROCK_CLASS, SURFACE_BODY, BundleError
from minexplore.sealed.sizes import MOST_CORNERS, MOST_VOLUME_PARTS
from pipeline.schema.readers.rules import numbers_in, same
from pipeline.schema.readers.xml import Node


class ModelElements:
    """The elements of a model by tag and name."""

    def __init__(self, root: Node) -> None:
        sections = {node.tag: node for node in root.children}
        self.statistic, self.assets = sections["statistic"], sections["asset"].children
        (self.mine,) = (node for node in sections["worldbody"].children if node.name == MINE_BODY)
        surfaces = [node for node in self.mine.children if node.name == SURFACE_BODY]  # at most one
        self.surface = [geom for surface in surfaces for geom in surface.children]
        self.fittings = next((node for node in self.mine.children if node.name == FITTINGS_BODY), None)
        (self.rock_class,) = (
            node.children[0] for node in sections["default"].children if node.attributes["class"] == ROCK_CLASS
        )
        self.of_mine = {(node.tag, node.name): node for node in self.mine.children}
        self.visual = {node.tag: node for node in sections["visual"].children}
        self.of_assets = {(node.tag, node.name): node for node in self.assets}

    def names(self, tag: str, prefix: str) -> list[str]:
        """Return the names of the mine's elements of a tag that begin with a text, in the model's order."""
        return [name for kind, name in self.of_mine if kind == tag and name.startswith(prefix)]


def numbers_of(node: Node, attribute: str, default: str = "0 0 0") -> list[float]:
    """Return the numbers of an attribute, or those of its default."""
    return numbers_in(node.attributes.get(attribute, default)) or []  # the table of elements has accepted it


def vertices_of(meshes: Iterable[Node]) -> list[np.ndarray]:
    """Return the vertices (n, 3) of each mesh of a collision part, m about its geom's place.

    Raises
    ------
    BundleError
        If all of them have more than `MOST_CORNERS` times `MOST_VOLUME_PARTS` vertices.
    """
    found, most = list[np.ndarray](), MOST_CORNERS * MOST_VOLUME_PARTS
    for mesh in meshes:
        found.append(np.array(numbers_of(mesh, "vertex")).reshape(-1, 3))
        most -= len(found[-1])
        if most < 0:
            raise BundleError(f"{MODEL}: more than {MOST_CORNERS * MOST_VOLUME_PARTS} vertices of collision parts")
    return found


def expect(node: Node, attribute: str, found: Iterable[float], wanted: Iterable[float], margin: float = 0.0) -> None:
    """Refuse numbers that differ from those of the record by more than a margin."""
    found, wanted = list(found), list(wanted)
    if not all(same(one, two) or abs(one - two) <= margin for one, two in zip(found, wanted, strict=True)):
        raise BundleError(
            f"{MODEL}: {node.path}@{attribute}: {' '.join(f'{v:g}' for v in found)}, {RECORD} gives "
            f"{' '.join(f'{v:.9g}' for v in wanted)}"
        )


def expect_names(tag: str, names: list[str], wanted: list[str], field: str) -> None:
    """Refuse names that are not those that a field of the record gives, in order."""
    if names != wanted:
        pairs = zip_longest(names, wanted, fillvalue="none")
        number, (found, want) = next((k, pair) for k, pair in enumerate(pairs, 1) if pair[0] != pair[1])
        raise BundleError(f"{MODEL}: <{tag}> {number}: {found!r}, want {want!r} ({RECORD}: {field})")
