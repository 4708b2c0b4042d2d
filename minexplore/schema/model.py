"""The table of `mine.xml`: each element, where it may stand, how often, and what its attributes may say.

To allow something new, add a line: an `Attribute` to an element, or an `Element` to the children of another. An
attribute with a default may be left out, as MuJoCo's writer does; one without is required.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from minexplore.bundle import (
    FLOOR_CHAMFER,
    MINE_BODY,
    ROCK_CLASS,
    ROCK_TEXTURE,
    ROOF,
    ROOF_GEOM,
    SURFACE_BODY,
    SURFACE_CLASS,
    WALLS,
    GeomGroup,
    smooth_mesh,
)
from minexplore.schema.rules import Rule, equal_numbers, exactly, matching, numbers, points, unit_vector

REACH_M = 1e6  # of any coordinate
MOST_ZONES, MOST_LIGHTS, MOST_PARTS, MOST_MESHES = 1000, 10_000, 100_000, 100_000
WORLD_NAME = r"[A-Za-z0-9_-]{1,64}"
ZONE_NAME = r"[a-z][a-z0-9_]{0,63}"
SMOOTH_MESHES = tuple(smooth_mesh(piece) for piece in (FLOOR_CHAMFER, WALLS, ROOF))
ROUGH_MESH = rf"(?:{WALLS}|{ROOF})_\d{{2,4}}_\d{{2,4}}"
VISIBLE_MESH = rf"(?:{ROUGH_MESH}|{'|'.join(SMOOTH_MESHES)})"
_ROCK_NAME = r"rock_\d{4,6}"
_DIGITS_M = 1e-6  # MuJoCo's writer leaves rounding errors of about 1e-11 m in places that are zero


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


def _required(rule: Rule) -> Attribute:
    return Attribute(rule)


def _constant(*values: float, default: str | None = None) -> Attribute:
    return Attribute(equal_numbers(*values), default)


def _named(pattern: str) -> dict[str, Attribute]:
    return {"name": Attribute(matching(pattern, f"a name like {pattern}"))}


_PLACE = Attribute(numbers(3, -REACH_M, REACH_M), "0 0 0")
_SIZE = _required(numbers(3, 1e-3, REACH_M))
_NOT_TURNED = _constant(1, 0, 0, 0, default="1 0 0 0")
_COLOUR = Attribute(numbers(4, 0, 1), "0.5 0.5 0.5 1")
_TURNED = Attribute(unit_vector(4), "1 0 0 0")
_FRICTION = Attribute(numbers(1, 1e-6, 2), "1")  # MuJoCo writes the sliding friction alone where the rest is default

_ROCK_MESH = Element(
    "mesh",
    {**_named(_ROCK_NAME), "vertex": _required(points(4, 4096, REACH_M))},
    name=_ROCK_NAME,
    most=MOST_PARTS,
)
_VISIBLE_MESH = Element(
    "mesh",
    {
        **_named(VISIBLE_MESH),
        "file": _required(matching(rf"meshes/{VISIBLE_MESH}\.msh", "meshes/NAME.msh")),
        "content_type": Attribute(exactly("model/vnd.mujoco.msh"), "model/vnd.mujoco.msh"),
        "inertia": _required(exactly("shell")),
    },
    name=VISIBLE_MESH,
    least=len(SMOOTH_MESHES),
    most=MOST_MESHES,
)
_ASSETS = Element(
    "asset",
    children=(
        Element(
            "texture",
            {
                **_named("rock"),
                "type": _required(exactly("2d")),
                "colorspace": Attribute(exactly("linear"), "linear"),
                "content_type": Attribute(exactly("image/png"), "image/png"),
                "file": _required(exactly(ROCK_TEXTURE)),
            },
            name="rock",
        ),
        Element(
            "material",
            {
                **_named("rock"),
                "texture": _required(exactly("rock")),
                "specular": _constant(0),
                "shininess": _constant(0),
            },
            name="rock",
        ),
        Element(
            "material",
            {
                **_named(f"ground_{ZONE_NAME}"),
                "emission": _constant(0.25),
                "specular": _constant(0),
                "shininess": _constant(0),
                "rgba": Attribute(numbers(4, 0, 1), "1 1 1 1"),
            },
            name=f"ground_{ZONE_NAME}",
            most=MOST_ZONES,
        ),
        _ROCK_MESH,
        _VISIBLE_MESH,
    ),
)
_LIGHT = Element(
    "light",
    {
        **_named(r"spot_\d{2,5}"),
        "castshadow": _required(exactly("false")),
        "pos": _PLACE,
        "dir": Attribute(unit_vector(3), "0 0 -1"),
        "attenuation": _constant(1, 0, 0.004),
        "cutoff": Attribute(numbers(1, 1e-3, 90), "45"),
        "exponent": _constant(8),
        "diffuse": _constant(1, 0.93, 0.8),
        "specular": _constant(0.1, 0.1, 0.1),
    },
    name=r"spot_\d{2,5}",
    most=MOST_LIGHTS,
)
_SURFACE = Element(
    "body",
    {"name": _required(exactly(SURFACE_BODY))},
    name=SURFACE_BODY,
    children=(
        Element(
            "geom",
            {
                **_named(f"surface_{VISIBLE_MESH}"),
                "class": _required(exactly(SURFACE_CLASS)),
                "pos": Attribute(numbers(3, -_DIGITS_M, _DIGITS_M), "0 0 0"),
                "quat": _NOT_TURNED,
                "group": Attribute(
                    exactly(str(GeomGroup.SMOOTH_SURFACE.value), str(GeomGroup.ROUGH_SURFACE.value)),
                    str(GeomGroup.ROUGH_SURFACE.value),
                ),
                "mesh": _required(matching(VISIBLE_MESH, "a visible mesh")),
            },
            name=f"surface_{VISIBLE_MESH}",
            least=len(SMOOTH_MESHES),
            most=MOST_MESHES,
        ),
    ),
)
_MINE = Element(
    "body",
    {"name": _required(exactly(MINE_BODY)), "pos": _PLACE, "quat": _TURNED},
    name=MINE_BODY,
    children=(
        Element(
            "geom",
            {
                **_named(_ROCK_NAME),
                "class": _required(exactly(ROCK_CLASS)),
                "pos": _PLACE,
                "quat": _NOT_TURNED,
                "type": _required(exactly("mesh")),
                "mesh": _required(matching(_ROCK_NAME, "a collision part's mesh")),
            },
            name=_ROCK_NAME,
            most=MOST_PARTS,
        ),
        Element(
            "geom",
            {
                **_named(f"floor_{ZONE_NAME}"),
                "size": _SIZE,
                "pos": _PLACE,
                "quat": _NOT_TURNED,
                "type": _required(exactly("box")),
                "priority": _required(exactly("1")),
                "friction": _FRICTION,
                "material": _required(matching(f"ground_{ZONE_NAME}", "the material of a floor zone")),
            },
            name=f"floor_{ZONE_NAME}",
            most=MOST_ZONES,
        ),
        Element(
            "geom",
            {
                "name": _required(exactly(ROOF_GEOM)),
                "class": _required(exactly(ROCK_CLASS)),
                "size": _SIZE,
                "pos": _PLACE,
                "quat": _NOT_TURNED,
                "type": _required(exactly("box")),
                "group": _required(exactly(str(GeomGroup.ROOF.value))),
            },
            name=ROOF_GEOM,
        ),
        Element(
            "camera",
            {"name": _required(exactly("entrance")), "quat": _TURNED, "pos": _PLACE, "fovy": _constant(70)},
            name="entrance",
        ),
        Element(
            "camera",
            {"name": _required(exactly("overview")), "quat": _TURNED, "pos": _PLACE, "fovy": _constant(30)},
            name="overview",
        ),
        _LIGHT,
        _SURFACE,
    ),
)
WORLD = Element(
    "mujoco",
    {"model": _required(matching(WORLD_NAME, "a name of letters, digits, _ and -"))},
    children=(
        Element("compiler", {"angle": _required(exactly("radian"))}),
        Element("statistic", {"extent": _constant(10), "center": _required(numbers(3, -REACH_M, REACH_M))}),
        Element(
            "visual",
            children=(
                Element("global", {"offwidth": _constant(1920), "offheight": _constant(1080)}),
                Element(
                    "headlight",
                    {
                        "ambient": _constant(0.3, 0.3, 0.3),
                        "diffuse": _constant(0.45, 0.45, 0.45),
                        "specular": _constant(0, 0, 0),
                    },
                ),
                Element("map", {"znear": _constant(0.005), "zfar": _constant(200)}),
            ),
        ),
        Element(
            "default",
            children=(
                Element(
                    "default",
                    {"class": _required(exactly(ROCK_CLASS))},
                    name=ROCK_CLASS,
                    children=(
                        Element(
                            "geom",
                            {
                                "group": _required(exactly(str(GeomGroup.COLLISION.value))),
                                "friction": _FRICTION,
                                "material": _required(exactly("rock")),
                            },
                        ),
                    ),
                ),
                Element(
                    "default",
                    {"class": _required(exactly(SURFACE_CLASS))},
                    name=SURFACE_CLASS,
                    children=(
                        Element(
                            "geom",
                            {
                                "type": _required(exactly("mesh")),
                                "contype": _required(exactly("0")),
                                "conaffinity": _required(exactly("0")),
                                "group": _required(exactly(str(GeomGroup.ROUGH_SURFACE.value))),
                                "material": _required(exactly("rock")),
                            },
                        ),
                    ),
                ),
            ),
        ),
        _ASSETS,
        Element("worldbody", children=(_MINE,)),
    ),
)
