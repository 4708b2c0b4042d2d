"""Compare the elements of a file with a table of what may stand in it."""

from __future__ import annotations

import functools
import re
from collections import Counter

from minexplore.bundle import BundleError
from minexplore.schema.attributes import Attribute, Element
from minexplore.schema.xml import Node

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
        _check_value(file, node, name, value, attribute)
    for name, attribute in element.attributes.items():
        if attribute.default is None and name not in node.attributes:
            raise BundleError(f"{_at(file, node)}@{name}: missing; want {attribute.rule.wants}")
    counts: Counter[int] = Counter()
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
    for number, child_element in enumerate(element.children):
        if not child_element.least <= counts[number] <= child_element.most:
            what = _describe(child_element)
            raise BundleError(
                f"{_at(file, node)}: {counts[number]} of {what}, want {child_element.least} to {child_element.most}"
            )


def _check_value(file: str, node: Node, name: str, value: str, attribute: Attribute) -> None:
    if not attribute.rule.accepts(value):
        raise BundleError(f"{_at(file, node)}@{name}: {_shown(value)}, want {attribute.rule.wants}")


def _place_of(child: Node, element: Element) -> int | None:
    """Return which of an element's children a node is, by tag and name."""
    for number, allowed in enumerate(element.children):
        if child.tag == allowed.tag and _compiled(allowed.name).fullmatch(child.name):
            return number
    return None


@functools.cache
def _compiled(pattern: str) -> re.Pattern[str]:
    return re.compile(pattern, re.ASCII)


def _describe(element: Element) -> str:
    return f"<{element.tag}> {element.name}".rstrip()


def _at(file: str, node: Node) -> str:
    return f"{file}: {node.path or node.tag[:_SHOWN]}"


def _shown(value: str) -> str:
    return repr(value if len(value) <= _SHOWN else value[:_SHOWN] + "...")
