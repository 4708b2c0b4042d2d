"""The table of `mine.xml` of a world that is one volume."""

from __future__ import annotations

from minexplore.bundle import (
    BARE_ROCK_RGBA,
    ENTRANCE_CAMERA,
    MINE_BODY,
    OVERVIEW_CAMERA,
    ROCK_CLASS,
    ROCK_NAMES,
    SPOT_NAMES,
    GeomGroup,
    floor_geom,
    ground_material,
)
from minexplore.looks import EXTENT_M, LOOKS
from minexplore.sealed.sizes import MOST_VOLUME_PARTS, MOST_ZONES
from minexplore.sealed.volume import MOST_OF_PART
from pipeline.schema.attributes import Attribute, Element, any_of, constant, named, required
from pipeline.schema.model import MOST_LIGHTS, REACH_M, WORLD_NAME, ZONE_NAME
from pipeline.schema.readers.rules import exactly, matching, numbers, points, unit_vector

FLOOR_NAMES = rf"{floor_geom(ZONE_NAME)}_\d{{5,6}}"
_PLACE = required(numbers(3, -REACH_M, REACH_M))
_FRICTION = required(numbers(3, 0, 2))
_DARK = {"specular": constant(0), "shininess": constant(0)}


def _group(*groups: GeomGroup) -> Attribute:
    return required(exactly(*(str(group.value) for group in groups)))


def _camera(name: str, fovy: float) -> Element:
    axes = required(numbers(6, -1, 1))
    return Element(
        "camera", {"name": required(exactly(name)), "pos": _PLACE, "xyaxes": axes, "fovy": constant(fovy)}, name
    )


_VIEW = Element(
    "visual",
    children=(
        Element(
            "headlight",
            {
                "ambient": any_of(*([look.ambient] * 3 for look in LOOKS.values())),
                "diffuse": any_of(*([look.diffuse] * 3 for look in LOOKS.values())),
                "specular": any_of(*([look.glint] * 3 for look in LOOKS.values())),
            },
        ),
        Element("map", {"znear": constant(0.005), "zfar": constant(200)}),
        Element("global", {"offwidth": constant(1920), "offheight": constant(1080)}),
    ),
)
_ROCK = {"group": _group(GeomGroup.COLLISION), "material": required(exactly("rock")), "friction": _FRICTION}
_ASSETS = Element(
    "asset",
    children=(
        Element("material", {"name": required(exactly("rock")), "rgba": constant(*BARE_ROCK_RGBA), **_DARK}, "rock"),
        Element(
            "material",
            {
                **named(ground_material(ZONE_NAME)),
                "rgba": required(numbers(4, 0, 1)),
                "emission": constant(0.25),
                **_DARK,
            },
            name=ground_material(ZONE_NAME),
            most=MOST_ZONES,
        ),
        *(
            Element(
                "mesh",
                {
                    **named(names),
                    "vertex": required(points(4, MOST_OF_PART, REACH_M)),
                    "inertia": required(exactly("shell")),
                },
                name=names,
                most=MOST_VOLUME_PARTS,
            )
            for names in (ROCK_NAMES, FLOOR_NAMES)
        ),
    ),
)
_PART = {"type": required(exactly("mesh")), "pos": _PLACE}
_MINE = Element(
    "body",
    {"name": required(exactly(MINE_BODY)), "pos": _PLACE},
    name=MINE_BODY,
    children=(
        Element(
            "geom",
            {
                **named(ROCK_NAMES),
                **_PART,
                "mesh": required(matching(ROCK_NAMES, "a part's mesh")),
                "class": required(exactly(ROCK_CLASS)),
                "group": _group(GeomGroup.COLLISION, GeomGroup.ROOF),
            },
            name=ROCK_NAMES,
            most=MOST_VOLUME_PARTS,
        ),
        Element(
            "geom",
            {
                **named(FLOOR_NAMES),
                **_PART,
                "mesh": required(matching(FLOOR_NAMES, "a floor part's mesh")),
                "material": required(matching(ground_material(ZONE_NAME), "the material of a floor zone")),
                "priority": required(exactly("1")),
                "friction": _FRICTION,
                "group": _group(GeomGroup.FLOOR),
            },
            name=FLOOR_NAMES,
            most=MOST_VOLUME_PARTS,
        ),
        Element(
            "light",
            {
                **named(SPOT_NAMES),
                "type": required(exactly("spot")),
                "pos": _PLACE,
                "dir": required(unit_vector(3)),
                "cutoff": required(numbers(1, 1e-3, 90)),
                "diffuse": constant(1, 0.93, 0.8),
                "specular": constant(0.1, 0.1, 0.1),
            },
            name=SPOT_NAMES,
            least=0,
            most=MOST_LIGHTS,
        ),
        _camera(ENTRANCE_CAMERA, 70),
        _camera(OVERVIEW_CAMERA, 30),
    ),
)
VOLUME_WORLD = Element(
    "mujoco",
    {"model": required(matching(WORLD_NAME, "a name of letters, digits, _ and -"))},
    children=(
        Element("statistic", {"extent": constant(EXTENT_M), "center": _PLACE}),
        _VIEW,
        Element(
            "default",
            children=(
                Element(
                    "default",
                    {"class": required(exactly(ROCK_CLASS))},
                    name=ROCK_CLASS,
                    children=(Element("geom", _ROCK),),
                ),
            ),
        ),
        _ASSETS,
        Element("worldbody", children=(_MINE,)),
    ),
)
