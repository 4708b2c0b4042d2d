"""A strict reader of MJCF text: plain elements and attributes, nothing that two parsers could read differently."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol
from xml.parsers import expat

from minexplore.bundle import BundleError
from minexplore.schema.sizes import MOST_VOLUME_PARTS

_MOST_ELEMENTS = 2 * MOST_VOLUME_PARTS + 100_000  # a mesh and a geom of each part
_MOST_ATTRIBUTES = 6 * _MOST_ELEMENTS  # a geom has eight, a mesh three; each takes more memory than its text
_MOST_OF_ELEMENT = 1 << 20  # bytes; a mesh of 4,096 corners has 160,000
_DEEPEST = 12
_LONG_ELEMENT = re.compile(rb"<[^<]{%d}" % _MOST_OF_ELEMENT)
# A document type, an entity, a comment, CDATA, a processing instruction or a declaration of another encoding begins
# with one of these. MuJoCo writes none of them.
_REFUSED = (b"&", b"<!", b"<?")


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


class ElementReader(Protocol):
    """Takes elements as they come: `walk_xml` keeps none of them."""

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Take the begin of an element."""

    def end(self, tag: str) -> None:
        """Take its end."""

    def text(self, text: str) -> None:
        """Take text in it."""


def read_xml(file: str, data: bytes) -> Node:
    """Return the root element of an XML file. `require_size` has its limit.

    Raises
    ------
    BundleError
        As `walk_xml`, and if the file has too many elements or attributes, or too deep ones, or holds text.
    """
    reader = _XmlReader(file)
    walk_xml(file, data, reader)
    return reader.root


def walk_xml(file: str, data: bytes, reader: ElementReader) -> None:
    """Hand the elements of an XML file to a reader, one by one.

    Raises
    ------
    BundleError
        If an element of the file is too long, or it is not plain ASCII XML, or it holds a document type, an entity, a
        comment or a processing instruction.
    """
    for mark in _REFUSED:
        if mark in data:
            line = data[: data.index(mark)].count(b"\n") + 1
            raise BundleError(f"{file}: line {line}: {mark.decode()!r} is not allowed; a world has plain elements only")
    if not data.isascii() or b"\0" in data:
        raise BundleError(f"{file}: a byte that is not ASCII; a world has plain ASCII only")
    # The parser makes all attributes of an element before the reader counts them.
    if long := _LONG_ELEMENT.search(data):
        line = data.count(b"\n", 0, long.start()) + 1
        raise BundleError(f"{file}: line {line}: an element of more than {_MOST_OF_ELEMENT} bytes")
    parser = expat.ParserCreate("us-ascii")
    parser.buffer_text = True
    parser.StartElementHandler = reader.start
    parser.EndElementHandler = reader.end
    parser.CharacterDataHandler = reader.text
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise BundleError(f"{file}: not XML from line {error.lineno}, character {error.offset + 1} on") from error


class _XmlReader:
    def __init__(self, file: str) -> None:
        self.file, self.open, self.count, self.attributes = file, [], 0, 0
        self.root = Node("", "", {})

    open: list[tuple[Node, str]]

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        self.count += 1
        self.attributes += len(attributes)
        if self.attributes > _MOST_ATTRIBUTES:
            raise BundleError(f"{self.file}: more than {_MOST_ATTRIBUTES} attributes")
        if self.count > _MOST_ELEMENTS or len(self.open) >= _DEEPEST:
            raise BundleError(
                f"{self.file}: more than {_MOST_ELEMENTS} elements, or more than {_DEEPEST} within another"
            )
        name = attributes.get("name", attributes.get("class", ""))
        parent, above = self.open[-1] if self.open else (None, None)
        node = Node(tag, name, attributes, above)
        if parent is None:
            self.root = node
        elif isinstance(parent.children, list):
            parent.children.append(node)
        else:
            parent.children = [node]
        self.open.append((node, node.path))

    def end(self, tag: str) -> None:
        self.open.pop()

    def text(self, text: str) -> None:
        if text.strip(" \t\r\n"):
            raise BundleError(f"{self.file}: {self.open[-1][1]}: text {text.strip()[:40]!r}; a world has none")
