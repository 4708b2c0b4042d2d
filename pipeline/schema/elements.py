"""Compare the elements of a file with a table of what may stand in it."""

from __future__ import annotations

from minexplore.bundle import BundleError
from pipeline.schema.attributes import Element
from pipeline.schema.readers.xml import Node

_SHOWN = 60  # characters of a refused value


def check_elements(file: str, root: Node, table: Element) -> None:
    """Refuse an element tree that a table does not allow.

    Raises
    ------
    BundleError
        With the path of the first element or attribute that is not allowed, missing, or has a wrong value.
    """
    if root.tag != table.tag:
        raise BundleError(f"{file}: <{root.tag[:_SHOWN]}>, want <{table.tag}>")
    _check(file, root, table)


def _check(file: str, node: Node, element: Element) -> None:
    for name, value in node.attributes.items():
        attribute = element.attributes.get(name)
        if attribute is None:
            known = ", ".join(element.attributes) or "none"
            raise BundleError(
                f"{_at(file, node)}@{name[:_SHOWN]}: {_shown(value)} is not allowed; a <{node.tag}> here has {known}"
            )
        if not attribute.rule.accepts(value):
            raise BundleError(f"{_at(file, node)}@{name}: {_shown(value)}, want {attribute.rule.wants}")
    for name in element.required:
        if name not in node.attributes:
            raise BundleError(f"{_at(file, node)}@{name}: missing; want {element.attributes[name].rule.wants}")
    if node.children or element.children:
        _check_children(file, node, element)


def _check_children(file: str, node: Node, element: Element) -> None:
    counts = [0] * len(element.children)
    names: set[tuple[str, str]] = set()
    for child in node.children:
        number = _place_of(child, element)
        if number is None:
            known = ", ".join(dict.fromkeys(f"<{c.tag}>" + (f" {c.name}" if c.name else "") for c in element.children))
            raise BundleError(
                f"{_at(file, child)}: <{child.tag[:_SHOWN]}> is not allowed; here stand {known or 'none'}"
            )
        counts[number] += 1
        if child.name and (child.tag, child.name) in names:
            raise BundleError(f"{_at(file, child)}: a second <{child.tag}> of this name")
        names.add((child.tag, child.name))
        _check(file, child, element.children[number])
    for count, allowed in zip(counts, element.children, strict=True):
        if not allowed.least <= count <= allowed.most:
            what = _describe(allowed)
            raise BundleError(f"{_at(file, node)}: {count} of {what}, want {allowed.least} to {allowed.most}")


def _place_of(child: Node, element: Element) -> int | None:
    """Return which of an element's children a node is, by tag and name."""
    for number, pattern in element.places.get(child.tag, ()):
        if pattern.fullmatch(child.name):
            return number
    return None


def _describe(element: Element) -> str:
    return f"<{element.tag}> {element.name}".rstrip()


def _at(file: str, node: Node) -> str:
    return f"{file}: {node.path or node.tag[:_SHOWN]}"


def _shown(value: str) -> str:
    return repr(value if len(value) <= _SHOWN else value[:_SHOWN] + "...")
