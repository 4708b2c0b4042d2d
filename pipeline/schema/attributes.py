"""Parts of a table of elements: the rule of an attribute, and an element with its attributes and children."""

from __future__ import annotations

import functools
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from pipeline.schema.readers.rules import Rule, equal_numbers, matching, one_of


@dataclass(frozen=True)
class Attribute:
    """The rule of an attribute, and the text that its absence means; without one it is required."""

    rule: Rule
    default: str | None = None


@dataclass(frozen=True)
class Element:
    """An element: its tag, the pattern of its name, how often it stands in its parent, attributes and children."""

    tag: str
    attributes: dict[str, Attribute] = field(default_factory=dict)
    name: str = ""
    least: int = 1
    most: int = 1
    children: tuple[Element, ...] = ()

    @functools.cached_property
    def required(self) -> tuple[str, ...]:
        """Return the names of the attributes that must be there."""
        return tuple(name for name, attribute in self.attributes.items() if attribute.default is None)

    @functools.cached_property
    def places(self) -> dict[str, list[tuple[int, re.Pattern[str]]]]:
        """Return, for each tag, which children have it, and the patterns of their names."""
        found: dict[str, list[tuple[int, re.Pattern[str]]]] = {}
        for number, child in enumerate(self.children):
            found.setdefault(child.tag, []).append((number, re.compile(child.name, re.ASCII)))
        return found


def required(rule: Rule) -> Attribute:
    """Return an attribute that must be there."""
    return Attribute(rule)


def constant(*values: float, default: str | None = None) -> Attribute:
    """Return an attribute that has these numbers only."""
    return Attribute(equal_numbers(*values), default)


def named(pattern: str) -> dict[str, Attribute]:
    """Return the attribute of a name that matches a pattern as a whole."""
    return {"name": Attribute(matching(pattern, f"a name like {pattern}"))}


def any_of(*values: Sequence[float], default: str | None = None) -> Attribute:
    """Return the rule of an attribute that has one of several groups of numbers; `check_agreement` says which one."""
    return Attribute(one_of(*(equal_numbers(*value) for value in dict.fromkeys(map(tuple, values)))), default)
