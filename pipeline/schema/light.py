"""The table of `mine.xml` of a world without visible rock: that of other worlds, less all that shows rock."""

from __future__ import annotations

import dataclasses

from minexplore.bundle import BARE_ROCK_RGBA, SURFACE_BODY, SURFACE_CLASS, VISIBLE_MESH
from pipeline.schema.attributes import Attribute, Element
from pipeline.schema.fittings import BODY, MATERIALS, MESH
from pipeline.schema.model import WORLD
from pipeline.schema.readers.rules import equal_numbers
from pipeline.schema.rough_floor import FIELD, GEOM

_SHOWS = {("texture", "rock"), ("mesh", VISIBLE_MESH), ("body", SURFACE_BODY), ("default", SURFACE_CLASS)}
_SHOWS |= {(element.tag, element.name) for element in (BODY, MESH, FIELD, GEOM, *MATERIALS)}


def _without_visible_rock(element: Element) -> Element:
    """Return an element and its children without what shows rock; the rock's material has a colour, no texture."""
    if (element.tag, element.name) == ("material", "rock"):
        plain = {name: rule for name, rule in element.attributes.items() if name != "texture"}
        return dataclasses.replace(element, attributes={**plain, "rgba": Attribute(equal_numbers(*BARE_ROCK_RGBA))})
    kept = [child for child in element.children if (child.tag, child.name) not in _SHOWS]
    return dataclasses.replace(element, children=tuple(map(_without_visible_rock, kept)))


LIGHT_WORLD = _without_visible_rock(WORLD)
