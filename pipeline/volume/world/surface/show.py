"""The visible rock of a volume in its bundle: files, and their elements in `mine.xml`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from minexplore.bundle import (
    FITTINGS_BODY,
    MESHES,
    MINE_BODY,
    ROCK_CLASS,
    ROCK_TEXTURE,
    SHADE_MATERIAL,
    SHADE_MESH,
    SURFACE_BODY,
    SURFACE_CLASS,
    WATER_MATERIAL,
    GeomGroup,
    cover_material,
    fitting_geom,
    fitting_material,
    ground_material,
    is_fitting,
    mesh_file,
    mesh_of,
    puddle_geom,
    shade_geom,
    surface_geom,
)
from minexplore.looks import (
    CUT_MATERIAL,
    CUT_RGBA,
    EXTENT_M,
    FURNITURE_LOOKS,
    LOOKS,
    PLAIN,
    SHADE,
    SHADE_LEVELS,
    WATER,
    Look,
    cover_rgba,
)
from pipeline.mjcf.scene import ZoneStrip
from pipeline.places import TEXTURE
from pipeline.store.codecs import Bundle, decode
from pipeline.store.palette_png import encode_texture
from pipeline.types import Image

_MEAN = 0.5  # of the texture's brightness


def rock_files(rock: Path) -> Bundle:
    """Return the files of a bundle that show rock, of the chunks in a folder of stage 4; none if there are none."""
    chunks = {mesh_file(path.stem): path.read_bytes() for path in sorted(rock.glob("*.msh"))}
    if not chunks:
        return {}
    return {**chunks, ROCK_TEXTURE: encode_texture(decode(rock / TEXTURE, Image))}


def rock_names(files: Iterable[str]) -> list[str]:
    """Return the files of a bundle that are visible rock, and no furniture, in their order by name."""
    return [name for name in sorted(files) if name.startswith(MESHES) and not is_fitting(mesh_of(name))]


def chunk_names(files: Iterable[str]) -> list[str]:
    """Return the names of the visible meshes among a bundle's files."""
    return sorted(mesh_of(name) for name in files if name.startswith(MESHES))


def is_bare_floor(mesh: str) -> bool:
    """Return whether a mesh of this name is the floor itself, which water or shade is shown above."""
    return mesh == SHADE_MESH or mesh.startswith(puddle_geom(""))


def is_painted(texcoords: Iterable[np.ndarray]) -> bool:
    """Return whether each piece of rock has a part of the picture: that of a scan's colours, which does not repeat."""
    return all(laid.min(initial=0.0) >= 0 and laid.max(initial=0.0) <= 1 for laid in texcoords)


def show_rock(root: ElementTree.Element, names: Sequence[str], look: str, painted: bool) -> None:
    """Add the visible meshes of these names, and geoms of rock, to a model. Its collision parts look like cut rock.

    Nothing collides with the bodies of the visible meshes. Where the picture is `painted`, floors have none.
    """
    if not names:
        return
    asset, default = _only(root, "asset"), _only(root, "default")
    _dress(root, LOOKS[look], painted)
    asset.insert(0, ElementTree.Element("texture", name="rock", type="2d", file=ROCK_TEXTURE))
    if look != PLAIN:
        cut = {"rgba": _text(CUT_RGBA), "specular": "0", "shininess": "0"}
        ElementTree.SubElement(asset, "material", {"name": CUT_MATERIAL, **cut})
        _only(default, f"default[@class='{ROCK_CLASS}']/geom").set("material", CUT_MATERIAL)
    seen = ElementTree.SubElement(default, "default", {"class": SURFACE_CLASS})
    group = str(GeomGroup.ROUGH_SURFACE.value)
    ElementTree.SubElement(seen, "geom", type="mesh", group=group, material="rock", contype="0", conaffinity="0")
    body = ElementTree.SubElement(_only(root, f"worldbody/body[@name='{MINE_BODY}']"), "body", name=SURFACE_BODY)
    for name in names:
        ElementTree.SubElement(asset, "mesh", name=name, file=mesh_file(name), inertia="shell")
        if not is_fitting(name):
            ElementTree.SubElement(body, "geom", {"name": surface_geom(name), "class": SURFACE_CLASS, "mesh": name})


def show_fittings(
    root: ElementTree.Element, names: Sequence[str], zones: Sequence[ZoneStrip], water_m: float, painted: bool
) -> None:
    """Add geoms of the visible floor and the furniture among these meshes to a model, in a body of their own.

    Bare floors are the floor itself: water stands `water_m` above it, and a stack of clear ones darkens hollows.
    Where the picture is `painted`, muck has none.
    """
    names = [name for name in names if is_fitting(name)]
    if not names:
        return
    asset, mine = _only(root, "asset"), _only(root, f"worldbody/body[@name='{MINE_BODY}']")
    body = ElementTree.SubElement(mine, "body", name=FITTINGS_BODY)
    named = [zone.name for zone in zones]
    bare = {puddle_geom(zone): (puddle_geom(zone), WATER_MATERIAL, water_m) for zone in named}
    bare |= {
        shade_geom(layer): (SHADE_MESH, SHADE_MATERIAL, share * water_m) for layer, share in enumerate(SHADE_LEVELS)
    }
    bare = {geom: shown for geom, shown in bare.items() if shown[0] in names}
    for name in names:
        if not is_bare_floor(name):
            _show(body, fitting_geom(name), name, fitting_material(name, named))
    for geom, (mesh, material, level_m) in bare.items():
        _show(body, geom, mesh, material).set("pos", f"0 0 {level_m:.12g}")
    used = {geom.attrib["material"] for geom in body}
    (water, reflectance), plain = WATER, {"specular": "0", "shininess": "0"}
    looks: dict[str, tuple[Sequence[float], dict[str, str]]] = {
        cover_material(zone.name): (floor_rgba(zone.rgba, painted), _floor_texture(painted) | plain) for zone in zones
    }
    looks |= {
        fitting_material(kind, []): (rgba, {"specular": f"{specular:g}", "shininess": "0.4"})
        for kind, (rgba, specular) in FURNITURE_LOOKS.items()
    }
    looks[SHADE_MATERIAL] = SHADE, plain
    looks[WATER_MATERIAL] = water, {"specular": "0.5", "shininess": "0.9", "reflectance": f"{reflectance:g}"}
    for material, (rgba, look) in looks.items():
        if material in used:
            ElementTree.SubElement(asset, "material", {"name": material, "rgba": _text(rgba), **look})


def floor_rgba(zone_rgba: Sequence[float], painted: bool) -> list[float]:
    """Return the colour of a floor of a zone: that of its texture times this one, or what both would be on average."""
    *rgb, opacity = cover_rgba(zone_rgba)
    return [round(_MEAN * value, 4) if painted else value for value in rgb] + [opacity]


def _floor_texture(painted: bool) -> dict[str, str]:
    return {} if painted else {"texture": "rock"}


def _show(body: ElementTree.Element, geom: str, mesh: str, material: str) -> ElementTree.Element:
    return ElementTree.SubElement(
        body, "geom", {"name": geom, "class": SURFACE_CLASS, "mesh": mesh, "material": material}
    )


def _dress(root: ElementTree.Element, look: Look, painted: bool) -> None:
    """Give a model the haze of a look, its rock the sheen, its floors the texture, its lights their fading."""
    rock = _only(root, "asset/material[@name='rock']")
    del rock.attrib["rgba"]
    for ground in _only(root, "asset").iter("material"):
        if ground.attrib["name"].startswith(ground_material("")):
            shown = floor_rgba([float(value) for value in ground.attrib["rgba"].split()], painted)
            ground.attrib.update(_floor_texture(painted), rgba=_text(shown), emission="0")
    rock.attrib.update(texture="rock", specular=f"{look.specular:g}", shininess=f"{look.shininess:g}")
    for light in root.iter("light"):
        light.attrib.update(castshadow="false", attenuation="1 0 0.004", exponent="8")
    if look.hazy:
        visual, (begin, end) = _only(root, "visual"), look.haze_m
        _only(visual, "map").attrib.update(fogstart=f"{begin / EXTENT_M:g}", fogend=f"{end / EXTENT_M:g}")
        ElementTree.SubElement(visual, "rgba", fog=_text((*look.haze_rgb, 1.0)))


def _text(values: Sequence[float]) -> str:
    return " ".join(f"{value:g}" for value in values)


def _only(element: ElementTree.Element, path: str) -> ElementTree.Element:
    found = element.find(path)
    if found is None:
        raise ValueError(f"mine.xml: no {path}")
    return found
