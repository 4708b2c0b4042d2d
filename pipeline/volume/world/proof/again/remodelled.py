"""The MJCF of a volume's bundle, made again of its other files and compared by element."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from minexplore.bundle import MESHES, MINE_BODY, MODEL, RECORD, mesh_of
from minexplore.sealed.xml import walk_xml
from pipeline.errors import ArtifactError
from pipeline.mjcf.scene import ALONG, SpotLight
from pipeline.proof.rebuilt.lights import remake_lights
from pipeline.schema.rules import numbers_in
from pipeline.volume.world.content import world_box
from pipeline.volume.world.drifts.lamps import lit_lines
from pipeline.volume.world.model import VolumeScene, eye_over, model_tree, part_geoms, part_meshes, part_names
from pipeline.volume.world.proof.certificate import VolumeBundle
from pipeline.volume.world.surface.show import is_painted
from pipeline.volume.world.topology import heading_at

_MARGIN = 1e-9  # relative and absolute: the text of a model has 12 digits
_LIGHT_OFF = 1e-6  # m of a light's place, and of its direction: its distance is a whole number of millimetres
_SHOWN = 60  # characters of a value in a message
_WHERE = {"mesh": ("mujoco", "asset"), "geom": ("mujoco", "worldbody", f"body[{MINE_BODY}]")}  # parts stand in these

_Stated = tuple[str, str, dict[str, str]]  # tag, path and attributes of an element


def require_same_model(folder: Path, world: VolumeBundle, water_m: float) -> None:
    """Compare all elements and attributes of the model with those that the builder writes.

    The compiled model follows from these and from the files that they name. Taken from the model are height, pitch,
    cut-off angle and distance of the lights. All else follows from `world.json`, the network, the mesh and the parts,
    and from how high above the floor water stands, `water_m`.

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
        eye_m=eye_over(world.cells, record.spawn.anchor_m),
        heading_rad=heading_at(world.legs, record.spawn.anchor_m),
        world_m=box,
        offset_m=np.array([-(west + east) / 2, -(south + north) / 2, 0.0]),
        rock=sorted(mesh_of(name) for name in record.files if name.startswith(MESHES)),
        water_m=water_m,
        is_painted=is_painted(mesh.texcoords for mesh in world.rock.values()),
    )
    found = _Elements(scene)
    walk_xml(MODEL, world.model, found)
    path = folder / MODEL
    lights = [_light(path, attributes) for tag, _, attributes in found.kept if tag == "light"]
    if len(lights) != record.lights:
        raise ArtifactError(f"{path}: {len(lights)} lights, {RECORD} has {record.lights}")
    lines = (lit_lines(world.legs, along) for along in ALONG)
    scene = replace(scene, lights=remake_lights(path, lights, lines, _LIGHT_OFF, _LIGHT_OFF))
    differs = found.differs or found.missing or _difference(found.kept, model_tree(scene, ()))
    if differs:
        raise ArtifactError(f"{path}: {differs}, as the builder writes it")


def _light(model: Path, attributes: dict[str, str]) -> SpotLight:
    """Return the light of an element; `ArtifactError` if it lacks a place, a direction or an angle."""
    texts = {name: attributes.get(name, "") for name in ("pos", "dir", "cutoff")}
    place, direction, cutoff = (numbers_in(text) or [] for text in texts.values())
    if (len(place), len(direction), len(cutoff)) != (3, 3, 1):
        raise ArtifactError(f"{model}: light: {texts}, want a place, a direction and an angle")
    (x, y, z), (east, north, up) = place, direction
    return SpotLight((x, y, z), (east, north, up), cutoff[0])


class _Elements:
    """Takes the elements of a model as they come: those of parts are compared, the others kept with their paths.

    A cave has a million elements of parts, so none of them is kept.
    """

    def __init__(self, scene: VolumeScene) -> None:
        self._open, self.kept = list[str](), list[_Stated]()
        self._parts = set(part_names(scene.parts, scene.zones))
        self._wanted = {"mesh": part_meshes(scene), "geom": part_geoms(scene)}
        self.differs: str | None = None

    @property
    def missing(self) -> str | None:
        """Return the first element of a part that did not come."""
        left = next((_of_part(part) for wanted in self._wanted.values() for part in wanted), None)
        return None if left is None else _of_two(None, left)

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Take the begin of an element."""
        at = "/".join([*self._open, _step(tag, attributes)])
        if tag in self._wanted and attributes.get("name") in self._parts:
            wanted = next((_of_part(part) for part in self._wanted[tag]), None)
            self.differs = self.differs or _of_two((tag, at, attributes), wanted)
        else:
            self.kept.append((tag, at, attributes))
        self._open.append(_step(tag, attributes))

    def end(self, tag: str) -> None:
        """Leave an element."""
        self._open.pop()

    def text(self, text: str) -> None:
        """Pass text over: `minexplore` refuses it."""


def _of_part(element: Element) -> _Stated:
    """Return the mesh or the geom of a part with its path in the model."""
    return element.tag, "/".join([*_WHERE[element.tag], _step(element.tag, element.attrib)]), element.attrib


def _difference(found: Iterable[_Stated], root: Element) -> str | None:
    """Return the first element or attribute that differs from those of a tree, with both values, or None."""
    pairs = zip_longest(found, _walk(root))
    return next((differs for one, two in pairs if (differs := _of_two(one, two))), None)


def _of_two(one: _Stated | None, two: _Stated | None) -> str | None:
    """Return how two elements differ, of which one may be missing, or None."""
    if one is None or two is None or one[1] != two[1]:
        at = (one or two)[1]  # type: ignore[index]
        return f"{at}: {'missing' if one is None else 'the builder writes no such element here'}"
    for name in {**two[2], **one[2]}:
        pair = one[2].get(name), two[2].get(name)
        if pair[0] != pair[1] and not _equal(*pair):
            return f"{one[1]}@{name} = {pair[0]!s:.{_SHOWN}}, want {pair[1]!s:.{_SHOWN}}"
    return None


def _walk(element: Element, above: str = "") -> Iterator[_Stated]:
    at = f"{above}{_step(element.tag, element.attrib)}"
    yield element.tag, at, element.attrib
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
