"""The tables of fittings: the visible floor, its puddles and the furniture, which are seen and never touched."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from minexplore.bundle import (
    COVER_M,
    FITTING_MESH,
    FITTINGS_BODY,
    FURNITURE,
    FURNITURE_ABOVE_M,
    LINES_ABOVE_M,
    MESHES,
    MODEL,
    RECORD,
    SHADE_MATERIAL,
    SHADE_NAMES,
    SURFACE_CLASS,
    WATER_MATERIAL,
    BundleError,
    cover_material,
    fitting_geom,
    fitting_kind,
    fitting_material,
    is_cover,
    is_fitting,
    is_fitting_material,
    mesh_file,
    puddle_geom,
    shade_geom,
)
from minexplore.looks import FURNITURE_LOOKS, PLAIN, SHADE, SHADE_LEVELS, WATER, cover_rgba
from pipeline.schema.attributes import Attribute, Element, any_of, constant, named, required
from pipeline.schema.readers.rules import exactly, matching, numbers, numbers_in, same
from pipeline.schema.readers.xml import Node

_MOST = 100_000
_SLACK_M = 1e-6  # of heights, which are in 32 bits
_KINDS = "|".join(FURNITURE)
_KIND_MATERIAL = fitting_material(f"(?:{_KINDS})", [])
_ZONE = r"[a-z][a-z0-9_]{0,63}"
_RGBA = Attribute(numbers(4, 0, 1), "1 1 1 1")
_NOT_TURNED = constant(1, 0, 0, 0, default="1 0 0 0")

MATERIALS = (
    Element(
        "material",
        {
            **named(cover_material(_ZONE)),
            "texture": required(exactly("rock")),
            "specular": constant(0),
            "shininess": constant(0),
            "rgba": _RGBA,
        },
        name=cover_material(_ZONE),
        least=0,
        most=_MOST,
    ),
    Element(
        "material",
        {
            **named(SHADE_MATERIAL),
            "specular": constant(0),
            "shininess": constant(0),
            "rgba": constant(*SHADE),
        },
        name=SHADE_MATERIAL,
        least=0,
    ),
    Element(
        "material",
        {
            **named(_KIND_MATERIAL),
            "specular": any_of(*((specular,) for _, specular in FURNITURE_LOOKS.values())),
            "shininess": constant(0.4),
            "rgba": any_of(*(rgba for rgba, _ in FURNITURE_LOOKS.values())),
        },
        name=_KIND_MATERIAL,
        least=0,
        most=len(FURNITURE),
    ),
    Element(
        "material",
        {
            **named(WATER_MATERIAL),
            "specular": constant(0.5, default="0.5"),
            "shininess": constant(0.9),
            "reflectance": constant(WATER[1]),
            "rgba": constant(*WATER[0]),
        },
        name=WATER_MATERIAL,
        least=0,
    ),
)
MESH = Element(
    "mesh",
    {
        **named(FITTING_MESH),
        "file": required(matching(rf"{MESHES}{FITTING_MESH}\.msh", mesh_file("NAME"))),
        "content_type": Attribute(exactly("model/vnd.mujoco.msh"), "model/vnd.mujoco.msh"),
        "inertia": required(exactly("shell")),
    },
    name=FITTING_MESH,
    least=0,
    most=_MOST,
)


def _plane(name: str, material: str) -> Element:
    return Element(
        "geom",
        {
            **named(name),
            "class": required(exactly(SURFACE_CLASS)),
            "type": required(exactly("plane")),
            "size": required(numbers(3, 1e-3, 1e6)),
            "pos": required(numbers(3, -1e6, 1e6)),
            "quat": _NOT_TURNED,
            "material": required(exactly(material)),
        },
        name=name,
        least=0,
        most=_MOST,
    )


BODY = Element(
    "body",
    {"name": required(exactly(FITTINGS_BODY))},
    name=FITTINGS_BODY,
    least=0,
    children=(
        Element(
            "geom",
            {
                **named(fitting_geom(FITTING_MESH)),
                "class": required(exactly(SURFACE_CLASS)),
                "pos": Attribute(numbers(3, -1e-6, 1e-6), "0 0 0"),
                "quat": _NOT_TURNED,
                "mesh": required(matching(FITTING_MESH, "a fitting's mesh")),
                "material": required(matching(f"{cover_material(_ZONE)}|{_KIND_MATERIAL}", "a fitting's material")),
            },
            name=fitting_geom(FITTING_MESH),
            most=_MOST,
        ),
        _plane(puddle_geom(_ZONE), WATER_MATERIAL),
        _plane(SHADE_NAMES, SHADE_MATERIAL),
    ),
)


def check_heights(name: str, lowest_m: float, highest_m: float) -> None:
    """Refuse a fitting's mesh that is not where fittings are: under a decimetre, or above every robot.

    Raises
    ------
    BundleError
        Naming the mesh, its heights and the limits.
    """
    kind = name.partition("_")[0]
    least = 0.0 if is_cover(name) else FURNITURE_ABOVE_M if kind == "bolts" else LINES_ABOVE_M
    most = COVER_M if is_cover(name) else float("inf")
    if not (lowest_m >= least - _SLACK_M and highest_m <= most + _SLACK_M):
        wanted = f"{least:g} to {most:g} m" if is_cover(name) else f"{least:g} m or more"
        raise BundleError(
            f"{mesh_file(name)}: from {lowest_m:g} to {highest_m:g} m above the floor, want {wanted}; "
            "it is seen and not touched"
        )


def check_fittings(body: Node | None, assets: Mapping[tuple[str, str], Node], record: Mapping[str, Any]) -> None:
    """Compare the fittings with the record's zones: materials and colours, one geom a mesh, planes over their zones.

    Raises
    ------
    BundleError
        With the path of the first difference.
    """
    meshes = {name for tag, name in assets if tag == "mesh" and is_fitting(name)}
    geoms = {node.name: node for node in body.children} if body else {}
    if (body or meshes) and record["look"] == PLAIN:
        raise BundleError(f"{MODEL}: {FITTINGS_BODY}: a world of the plain look has none")
    planes = {name: node for name, node in geoms.items() if node.attributes.get("type") == "plane"}
    shown = {fitting_geom(name) for name in meshes}
    if shown != geoms.keys() - planes.keys():
        odd = min(shown ^ (geoms.keys() - planes.keys()))
        raise BundleError(f"{MODEL}: {FITTINGS_BODY}: want one geom of each fitting's mesh; see {odd!r}")
    zones = {zone["name"]: zone for zone in record["zones"]}
    names = list(zones)
    for mesh in sorted(meshes):
        node = geoms[fitting_geom(mesh)]
        if is_cover(mesh) and int(mesh.split("_")[1]) >= len(names):
            raise BundleError(f"{MODEL}: {node.path}: {RECORD} has {len(names)} zones")
        wanted = fitting_material(mesh, names)
        if (node.attributes["mesh"], node.attributes["material"]) != (mesh, wanted):
            raise BundleError(f"{MODEL}: {node.path}: want mesh {mesh!r} and material {wanted!r}")
    shades = {shade_geom(layer) for layer in range(len(SHADE_LEVELS))} if any(map(is_cover, meshes)) else set()
    waters = {puddle_geom(zone) for zone in zones} if shades else set()
    if planes.keys() - waters != shades:
        odd = min((planes.keys() - waters) ^ shades)
        raise BundleError(
            f"{MODEL}: {FITTINGS_BODY}: want {len(SHADE_LEVELS)} planes of shade over a visible floor, and water "
            f"on its zones alone; see {odd!r}"
        )
    if shades:
        _check_planes(planes, zones)
    _check_materials(geoms, assets, zones)


def _check_planes(planes: Mapping[str, Node], zones: Mapping[str, Any]) -> None:
    """Check that planes cover a zone or all zones, at heights that follow from the lowest one's."""
    level = (numbers_in(planes[shade_geom(0)].attributes["pos"]) or [0.0] * 3)[2] / SHADE_LEVELS[0]
    wanted = {puddle_geom(name): ([zone], level) for name, zone in zones.items()}
    wanted |= {shade_geom(layer): (list(zones.values()), share * level) for layer, share in enumerate(SHADE_LEVELS)}
    for name, node in planes.items():
        over, height = wanted[name]
        west, south = (min(zone[side] for zone in over) for side in ("west_m", "south_m"))
        east, north = (max(zone[side] for zone in over) for side in ("east_m", "north_m"))
        middle = [(west + east) / 2, (south + north) / 2, height, (east - west) / 2, (north - south) / 2, 1.0]
        found = [*(numbers_in(node.attributes["pos"]) or []), *(numbers_in(node.attributes["size"]) or [])]
        if not (len(found) == len(middle) and all(map(same, found, middle)) and 0 < height <= COVER_M):
            raise BundleError(
                f"{MODEL}: {node.path}: want the size of its zones and a height of {height:g} m, "
                f"as that of {shade_geom(0)} says, between 0 and {COVER_M:g} m"
            )


def _check_materials(
    geoms: Mapping[str, Node], assets: Mapping[tuple[str, str], Node], zones: Mapping[str, Any]
) -> None:
    """Check that materials of fittings are used and have the colours that zones and kinds give."""
    used = {node.attributes["material"] for node in geoms.values()}
    colours: dict[str, Any] = {WATER_MATERIAL: WATER[0], SHADE_MATERIAL: SHADE}
    colours |= {cover_material(name): cover_rgba(zone["rgba"]) for name, zone in zones.items()}
    colours |= {fitting_material(kind, []): rgba for kind, (rgba, _) in FURNITURE_LOOKS.items()}
    there = {name for tag, name in assets if tag == "material" and is_fitting_material(name)}
    if there != used:
        raise BundleError(f"{MODEL}: asset: material {min(there ^ used)!r}: missing, or nothing has it")
    for name in sorted(there):
        node = assets["material", name]
        found = numbers_in(node.attributes.get("rgba", "1 1 1 1")) or []
        if name not in colours or not all(map(same, found, colours[name])):
            raise BundleError(f"{MODEL}: {node.path}@rgba: want {colours.get(name)}")
        kind = fitting_kind(name)
        if kind in FURNITURE_LOOKS:
            specular = numbers_in(node.attributes["specular"]) or [0.0]
            if not same(specular[0], FURNITURE_LOOKS[kind][1]):
                raise BundleError(f"{MODEL}: {node.path}@specular: want {FURNITURE_LOOKS[kind][1]:g}")
