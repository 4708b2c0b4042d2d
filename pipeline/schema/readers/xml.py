"""The elements of `mine.xml` as a tree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from minexplore.sealed.xml import BoundedReader, walk_xml


@dataclass(slots=True)
class Node:
    """An element: its tag, attributes, children, and the path of its parent.

    `name` is its name, or the class that a default is for; empty if it has neither. A large cave has a million
    elements, so a node holds neither its own path nor an empty list.
    """

    tag: str
    name: str
    attributes: dict[str, str]
    above: str | None = None
    children: Sequence[Node] = ()

    @property
    def path(self) -> str:
        """Return the path in the file, for example `worldbody/body[mine]`; the root's own name is left out of it."""
        if self.above is None:
            return ""
        step = f"{self.tag[:40]}[{self.name[:60]}]" if self.name else self.tag[:40]
        return f"{self.above}/{step}" if self.above else step


def read_xml(file: str, data: bytes) -> Node:
    """Return the root element of an XML file.

    Raises
    ------
    BundleError
        As `walk_xml` and `BoundedReader`.
    """
    reader = _TreeReader(file)
    walk_xml(file, data, reader)
    return reader.root


class _TreeReader(BoundedReader):
    def __init__(self, file: str) -> None:
        super().__init__(file)
        self.root = Node("", "", {})
        self._open = list[tuple[Node, str]]()

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        super().start(tag, attributes)
        name = attributes.get("name", attributes.get("class", ""))
        parent, above = self._open[-1] if self._open else (None, None)
        node = Node(tag, name, attributes, above)
        if parent is None:
            self.root = node
        elif isinstance(parent.children, list):
            parent.children.append(node)
        else:
            parent.children = [node]
        self._open.append((node, node.path))

    def end(self, tag: str) -> None:
        super().end(tag)
        self._open.pop()
