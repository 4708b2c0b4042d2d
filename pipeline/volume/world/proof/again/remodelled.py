"""The MJCF of a volume's bundle, made again of its other files and compared by element."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from minexplore.bundle import MESHES, MINE_BODY, MODEL, RECORD, mesh_of
from minexplore.sealed.xml import walk_xml
from pipeline.errors import ArtifactError
from pipeline.schema.readers.rules import numbers_in
from pipeline.volume.world.content import world_box
from pipeline.volume.world.model import VolumeScene, model_tree
from pipeline.volume.world.proof.again.relit import StatedLight, remake_lights
from pipeline.volume.world.proof.certificate import VolumeBundle
from pipeline.volume.world.topology import heading_at

_MARGIN = 1e-9  # relative and absolute: the text of a model has 12 digits
_SHOWN = 60  # characters of a value in a message
_MINE, _LIGHT = f"body[{MINE_BODY}]", "/light["


def require_same_model(folder: Path, world: VolumeBundle) -> None:
    """Compare all elements and attributes of the model, but those of parts, with those that the builder writes.

    The compiled model follows from these and from the files that they name; `pipeline.schema` has compared the parts.
    Taken from the model are height, pitch, cut-off angle and distance of the lights. All else follows from
    `world.json`, the network and the mesh.

    Raises
    ------
    BundleError
        If it is no plain XML.
    ArtifactError
        With the element, the attribute, the value and what it should be.
    """
    record = world.record
    box = world_box(world.mine)
    if box != record.world_m:
        raise ArtifactError(f"{folder / RECORD}: world_m = {list(record.world_m)}, want {list(box)}, as the mesh has")
    west, south, east, north = box
    scene = VolumeScene(
        name=record.name,
        parts=world.parts,
        zones=record.zones,
        rock_friction=record.rock_friction,
        lights=[],
        look=record.look,
        anchor_m=record.spawn.anchor_m,
        heading_rad=heading_at(world.legs, record.spawn.anchor_m),
        world_m=box,
        offset_m=np.array([-(west + east) / 2, -(south + north) / 2, 0.0]),
        rock=sorted(mesh_of(name) for name in record.files if name.startswith(MESHES)),
    )
    found = _Elements()
    walk_xml(MODEL, world.model, found)
    lights = [StatedLight.of(attributes) for at, attributes in found.kept if _LIGHT in at]
    lit = remake_lights(folder / MODEL, lights, world.legs)
    differs = _difference(found, model_tree(replace(scene, lights=lit), ()))
    if differs:
        raise ArtifactError(f"{folder / MODEL}: {differs}, as the builder writes it")


class _Elements:
    """Keeps the elements of a model as they come, but those of parts, each with its path."""

    def __init__(self) -> None:
        self._open, self.kept = list[str](), list[tuple[str, dict[str, str]]]()

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Take the begin of an element."""
        step = _step(tag, attributes)
        of_part = (tag == "geom" and self._open[-1:] == [_MINE]) or (tag == "mesh" and "file" not in attributes)
        if not of_part:
            self.kept.append(("/".join([*self._open, step]), attributes))
        self._open.append(step)

    def end(self, tag: str) -> None:
        """Leave an element."""
        self._open.pop()

    def text(self, text: str) -> None:
        """Pass text over: the schema refuses it."""


def _difference(found: _Elements, wanted: Element) -> str | None:
    """Return the first element or attribute that differs from those of a tree, with both values, or None."""
    for one, two in zip_longest(found.kept, _walk(wanted)):
        if one is None or two is None or one[0] != two[0]:
            at = (one or two)[0]  # type: ignore[index]
            return f"{at}: {'missing' if one is None else 'the builder writes no such element here'}"
        for name in {**two[1], **one[1]}:
            pair = one[1].get(name), two[1].get(name)
            if pair[0] != pair[1] and not _equal(*pair):
                return f"{one[0]}@{name} = {pair[0]!s:.{_SHOWN}}, want {pair[1]!s:.{_SHOWN}}"
    return None


def _walk(element: Element, above: str = "") -> Iterator[tuple[str, dict[str, str]]]:
    at = f"{above}{_step(element.tag, element.attrib)}"
    yield at, element.attrib
    for child in element:
        yield from _walk(child, f"{at}/")


def _step(tag: str, attributes: dict[str, str]) -> str:
    """Return an element in its path, by its name or its class."""
    name = attributes.get("name", attributes.get("class", ""))
    return f"{tag}[{name}]" if name and tag != "mujoco" else tag


def _equal(one: str | None, two: str | None) -> bool:
    """Return whether two texts are the same numbers."""
    if one is None or two is None:
        return False
    pair = numbers_in(one), numbers_in(two)
    return None not in pair and len(pair[0]) == len(pair[1]) and bool(np.allclose(*pair, rtol=_MARGIN, atol=_MARGIN))  # type: ignore[arg-type]
