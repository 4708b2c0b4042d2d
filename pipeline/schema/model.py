"""The table of `mine.xml`: each element, where it may stand, how often, and what its attributes may say.

To allow something new, add a line: an `Attribute` to an element, or an `Element` to the children of another. An
attribute with a default may be left out, as MuJoCo's writer does; one without is required.
"""

from __future__ import annotations

from minexplore.bundle import (
    ENTRANCE_CAMERA,
    INERTIAL_QUAT,
    MESHES,
    MINE_BODY,
    OVERVIEW_CAMERA,
    ROCK_CLASS,
    ROCK_NAMES,
    ROCK_TEXTURE,
    ROOF_GEOM,
    SMOOTH_MESHES,
    SPOT_NAMES,
    SURFACE_BODY,
    SURFACE_CLASS,
    VISIBLE_MESH,
    GeomGroup,
    floor_geom,
    ground_material,
    mesh_file,
    surface_geom,
)
from minexplore.looks import CUT_MATERIAL, CUT_RGBA, EXTENT_M, LOOKS
from minexplore.sealed.sizes import MOST_ZONES
from pipeline.schema.attributes import Attribute, Element, any_of, constant, named, required
from pipeline.schema.fittings import BODY, MATERIALS, MESH
from pipeline.schema.readers.rules import exactly, matching, numbers, points, unit_vector
from pipeline.schema.rough_floor import FIELD, GEOM

REACH_M = 1e6  # of any coordinate
MOST_LIGHTS, MOST_PARTS, MOST_MESHES = 10_000, 100_000, 100_000
WORLD_NAME = r"[A-Za-z0-9_-]{1,64}"
ZONE_NAME = r"[a-z][a-z0-9_]{0,63}"


_HAZY = [look for look in LOOKS.values() if look.hazy]
_PLACE = Attribute(numbers(3, -REACH_M, REACH_M), "0 0 0")
_SIZE = required(numbers(3, 1e-3, REACH_M))
_NOT_TURNED = constant(1, 0, 0, 0, default="1 0 0 0")
_TURNED = Attribute(unit_vector(4), "1 0 0 0")
_FRICTION = Attribute(numbers(1, 1e-6, 2), "1")  # MuJoCo writes the sliding friction alone where the rest is default

_ROCK_MESH = Element(
    "mesh",
    {**named(ROCK_NAMES), "vertex": required(points(4, 4096, REACH_M))},
    name=ROCK_NAMES,
    most=MOST_PARTS,
)
_VISIBLE_MESH = Element(
    "mesh",
    {
        **named(VISIBLE_MESH),
        "file": required(matching(rf"{MESHES}{VISIBLE_MESH}\.msh", mesh_file("NAME"))),
        "content_type": Attribute(exactly("model/vnd.mujoco.msh"), "model/vnd.mujoco.msh"),
        "inertia": required(exactly("shell")),
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
                **named("rock"),
                "type": required(exactly("2d")),
                "colorspace": Attribute(exactly("linear"), "linear"),
                "content_type": Attribute(exactly("image/png"), "image/png"),
                "file": required(exactly(ROCK_TEXTURE)),
            },
            name="rock",
        ),
        Element(
            "material",
            {
                **named("rock"),
                "texture": required(exactly("rock")),
                "specular": any_of(*((look.specular,) for look in LOOKS.values())),
                "shininess": any_of(*((look.shininess,) for look in LOOKS.values())),
            },
            name="rock",
        ),
        *MATERIALS,
        Element(
            "material",
            {
                **named(CUT_MATERIAL),
                "specular": constant(0),
                "shininess": constant(0),
                "rgba": constant(*CUT_RGBA),
            },
            name=CUT_MATERIAL,
            least=0,
        ),
        Element(
            "material",
            {
                **named(ground_material(ZONE_NAME)),
                "emission": constant(0.25),
                "specular": constant(0),
                "shininess": constant(0),
                "rgba": Attribute(numbers(4, 0, 1), "1 1 1 1"),
            },
            name=ground_material(ZONE_NAME),
            most=MOST_ZONES,
        ),
        _ROCK_MESH,
        _VISIBLE_MESH,
        MESH,
        FIELD,
    ),
)
_LIGHT = Element(
    "light",
    {
        **named(SPOT_NAMES),
        "castshadow": required(exactly("false")),
        "pos": _PLACE,
        "dir": Attribute(unit_vector(3), "0 0 -1"),
        "attenuation": constant(1, 0, 0.004),
        "cutoff": Attribute(numbers(1, 1e-3, 90), "45"),
        "exponent": constant(8),
        "diffuse": constant(1, 0.93, 0.8),
        "specular": constant(0.1, 0.1, 0.1),
    },
    name=SPOT_NAMES,
    most=MOST_LIGHTS,
)
_SURFACE = Element(
    "body",
    {"name": required(exactly(SURFACE_BODY))},
    name=SURFACE_BODY,
    children=(
        Element(
            "geom",
            {
                **named(surface_geom(VISIBLE_MESH)),
                "class": required(exactly(SURFACE_CLASS)),
                "group": Attribute(
                    exactly(str(GeomGroup.SMOOTH_SURFACE.value), str(GeomGroup.ROUGH_SURFACE.value)),
                    str(GeomGroup.ROUGH_SURFACE.value),
                ),
                "mesh": required(matching(VISIBLE_MESH, "a visible mesh")),
            },
            name=surface_geom(VISIBLE_MESH),
            least=len(SMOOTH_MESHES),
            most=MOST_MESHES,
        ),
    ),
)
_MINE = Element(
    "body",
    {"name": required(exactly(MINE_BODY)), "pos": _PLACE, "quat": _TURNED},
    name=MINE_BODY,
    children=(
        Element(
            "inertial",  # of a body that never moves; `INERTIAL_QUAT` says why a world may have it
            {
                "pos": constant(0, 0, 0),
                "quat": constant(*INERTIAL_QUAT),
                "mass": constant(1),
                "diaginertia": constant(1, 1, 1),
            },
            least=0,
        ),
        Element(
            "geom",
            {
                **named(ROCK_NAMES),
                "class": required(exactly(ROCK_CLASS)),
                "pos": _PLACE,
                "quat": _NOT_TURNED,
                "type": required(exactly("mesh")),
                "mesh": required(matching(ROCK_NAMES, "a collision part's mesh")),
            },
            name=ROCK_NAMES,
            most=MOST_PARTS,
        ),
        Element(
            "geom",
            {
                **named(floor_geom(ZONE_NAME)),
                "size": _SIZE,
                "pos": _PLACE,
                "quat": _NOT_TURNED,
                "type": required(exactly("box")),
                "priority": required(exactly("1")),
                "friction": _FRICTION,
                "material": required(matching(ground_material(ZONE_NAME), "the material of a floor zone")),
            },
            name=floor_geom(ZONE_NAME),
            most=MOST_ZONES,
        ),
        Element(
            "geom",
            {
                "name": required(exactly(ROOF_GEOM)),
                "class": required(exactly(ROCK_CLASS)),
                "size": _SIZE,
                "pos": _PLACE,
                "quat": _NOT_TURNED,
                "type": required(exactly("box")),
                "group": required(exactly(str(GeomGroup.ROOF.value))),
            },
            name=ROOF_GEOM,
        ),
        Element(
            "camera",
            {"name": required(exactly(ENTRANCE_CAMERA)), "quat": _TURNED, "pos": _PLACE, "fovy": constant(70)},
            name=ENTRANCE_CAMERA,
        ),
        Element(
            "camera",
            {"name": required(exactly(OVERVIEW_CAMERA)), "quat": _TURNED, "pos": _PLACE, "fovy": constant(30)},
            name=OVERVIEW_CAMERA,
        ),
        GEOM,
        _LIGHT,
        _SURFACE,
        BODY,
    ),
)
WORLD = Element(
    "mujoco",
    {"model": required(matching(WORLD_NAME, "a name of letters, digits, _ and -"))},
    children=(
        Element("compiler", {"angle": required(exactly("radian"))}),
        Element("statistic", {"extent": constant(10), "center": required(numbers(3, -REACH_M, REACH_M))}),
        Element(
            "visual",
            children=(
                Element("global", {"offwidth": constant(1920), "offheight": constant(1080)}),
                Element(
                    "headlight",
                    {
                        "ambient": any_of(*([look.ambient] * 3 for look in LOOKS.values())),
                        "diffuse": any_of(*([look.diffuse] * 3 for look in LOOKS.values())),
                        "specular": any_of(*([look.glint] * 3 for look in LOOKS.values())),
                    },
                ),
                Element(
                    "map",
                    {
                        "fogstart": any_of(*([look.haze_m[0] / EXTENT_M] for look in _HAZY), default="3"),
                        "fogend": any_of(*([look.haze_m[1] / EXTENT_M] for look in _HAZY), default="10"),
                        "znear": constant(0.005),
                        "zfar": constant(200),
                    },
                ),
                Element("rgba", {"fog": any_of(*((*look.haze_rgb, 1) for look in _HAZY))}, least=0),
            ),
        ),
        Element(
            "default",
            children=(
                Element(
                    "default",
                    {"class": required(exactly(ROCK_CLASS))},
                    name=ROCK_CLASS,
                    children=(
                        Element(
                            "geom",
                            {
                                "group": required(exactly(str(GeomGroup.COLLISION.value))),
                                "friction": _FRICTION,
                                "material": required(exactly("rock", CUT_MATERIAL)),
                            },
                        ),
                    ),
                ),
                Element(
                    "default",
                    {"class": required(exactly(SURFACE_CLASS))},
                    name=SURFACE_CLASS,
                    children=(
                        Element(
                            "geom",
                            {
                                "type": required(exactly("mesh")),
                                "contype": required(exactly("0")),
                                "conaffinity": required(exactly("0")),
                                "group": required(exactly(str(GeomGroup.ROUGH_SURFACE.value))),
                                "material": required(exactly("rock")),
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
