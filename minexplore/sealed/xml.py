"""Walk through MJCF text: plain elements and attributes, nothing that two parsers could read differently."""

from __future__ import annotations

import re
from typing import Protocol
from xml.parsers import expat

from minexplore.bundle import BundleError
from minexplore.sealed.sizes import MOST_VOLUME_PARTS

MOST_ELEMENTS = 2 * MOST_VOLUME_PARTS + 100_000  # a mesh and a geom of each part
MOST_ATTRIBUTES = 6 * MOST_ELEMENTS  # a geom has eight, a mesh three; each takes more memory than its text
_MOST_OF_ELEMENT = 1 << 20  # bytes; a mesh of 4,096 corners has 160,000
_DEEPEST = 12
_LONG_ELEMENT = re.compile(rb"<[^<]{%d}" % _MOST_OF_ELEMENT)
# A document type, an entity, a comment, CDATA, a processing instruction or a declaration of another encoding begins
# with one of these. MuJoCo writes none of them.
_REFUSED = (b"&", b"<!", b"<?")


class ElementReader(Protocol):
    """Takes elements as they come: `walk_xml` keeps none of them."""

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Take the begin of an element."""

    def end(self, tag: str) -> None:
        """Take its end."""

    def text(self, text: str) -> None:
        """Take text in it."""


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


class BoundedReader:
    """Counts elements as they come, and knows where in the file the present one stands.

    Raises `BundleError` of too many elements or attributes, of too deep ones, and of text.
    """

    def __init__(self, file: str) -> None:
        """Take the file's name, for messages."""
        self.file, self._steps = file, list[tuple[str, dict[str, str]]]()
        self._elements = self._attributes = 0

    @property
    def path(self) -> str:
        """Return the place in the file, for example `worldbody/body[mine]`; the root's own name is left out of it."""
        names = [_shown(*step) for step in self._steps]
        return "/".join(names[1:]) or names[0]

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Count an element."""
        self._elements += 1
        self._attributes += len(attributes)
        if self._attributes > MOST_ATTRIBUTES:
            raise BundleError(f"{self.file}: more than {MOST_ATTRIBUTES} attributes")
        if self._elements > MOST_ELEMENTS or len(self._steps) >= _DEEPEST:
            raise BundleError(
                f"{self.file}: more than {MOST_ELEMENTS} elements, or more than {_DEEPEST} within another"
            )
        self._steps.append((tag, attributes))

    def end(self, tag: str) -> None:
        """Leave an element."""
        self._steps.pop()

    def text(self, text: str) -> None:
        """Refuse all text but blanks."""
        if text.strip(" \t\r\n"):
            raise BundleError(f"{self.file}: {self.path}: text {text.strip()[:40]!r}; a world has none")


def _shown(tag: str, attributes: dict[str, str]) -> str:
    """Return an element as messages have it, with its name or class."""
    name = attributes.get("name", attributes.get("class", ""))
    return f"{tag[:40]}[{name[:60]}]" if name else tag[:40]
