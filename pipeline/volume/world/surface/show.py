"""The visible rock of a volume in its bundle: files, and their elements in `mine.xml`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.etree import ElementTree

from minexplore.bundle import (
    FITTINGS_BODY,
    MESHES,
    MINE_BODY,
    ROCK_CLASS,
    ROCK_TEXTURE,
    SURFACE_BODY,
    SURFACE_CLASS,
    GeomGroup,
    fitting_geom,
    fitting_material,
    ground_material,
    is_fitting,
    mesh_file,
    mesh_of,
    surface_geom,
)
from minexplore.looks import CUT_MATERIAL, CUT_RGBA, EXTENT_M, FURNITURE_LOOKS, LOOKS, PLAIN, Look, cover_rgba
from pipeline.places import TEXTURE
from pipeline.store.codecs import Bundle, decode
from pipeline.store.palette_png import encode_texture
from pipeline.types import Image


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


def show_rock(root: ElementTree.Element, names: Sequence[str], look: str) -> None:
    """Add the visible meshes of these names, and furniture, to a model. Its collision parts get the colour of cut rock.

    Nothing collides with the bodies of the visible meshes.
    """
    if not names:
        return
    asset, default = _only(root, "asset"), _only(root, "default")
    _dress(root, LOOKS[look])
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
    fittings = [name for name in names if is_fitting(name)]
    if fittings:
        _show_fittings(root, fittings)


def _show_fittings(root: ElementTree.Element, names: Sequence[str]) -> None:
    """Add the furniture of these names to a model, in a body of its own."""
    asset, mine = _only(root, "asset"), _only(root, f"worldbody/body[@name='{MINE_BODY}']")
    body = ElementTree.SubElement(mine, "body", name=FITTINGS_BODY)
    for name in names:
        own = {"name": fitting_geom(name), "class": SURFACE_CLASS, "mesh": name, "material": fitting_material(name, [])}
        ElementTree.SubElement(body, "geom", own)
    for kind, (rgba, specular) in FURNITURE_LOOKS.items():
        if any(name.startswith(f"{kind}_") for name in names):
            seen = {"rgba": _text(rgba), "specular": f"{specular:g}", "shininess": "0.4"}
            ElementTree.SubElement(asset, "material", {"name": fitting_material(kind, []), **seen})


def _dress(root: ElementTree.Element, look: Look) -> None:
    """Give a model the haze of a look, its rock the sheen, its floors the texture, its lights their fading."""
    rock = _only(root, "asset/material[@name='rock']")
    del rock.attrib["rgba"]
    for ground in _only(root, "asset").iter("material"):
        if ground.attrib["name"].startswith(ground_material("")):
            shown = cover_rgba([float(value) for value in ground.attrib["rgba"].split()])
            ground.attrib.update(texture="rock", rgba=_text(shown), emission="0")
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
