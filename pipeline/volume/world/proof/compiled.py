"""The MJCF of a volume world against its parts: every mesh as it is written, and some as MuJoCo compiles them."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree

import mujoco
import numpy as np
from scipy.spatial import cKDTree

from minexplore.bundle import MINE_BODY, MODEL
from minexplore.floors.volume_arrays import Parts
from minexplore.sealed.xml import walk_xml
from pipeline.errors import ArtifactError
from pipeline.mjcf.scene import ZoneStrip
from pipeline.volume.world.model import part_names

_WRITTEN_M = 1e-6  # by which a written corner may differ from its part's
_MIDDLE_M = 1e-4  # by which a geom may be beside the middle of its part: far from it a mesh has less than 0.01 mm


@dataclass(frozen=True)
class Compiled:
    """Parts that the model lacks, has besides or has elsewhere; farthest corner of a compiled hull, mm."""

    unlike: int
    compiled_mm: float


def compare_model(xml: bytes, parts: Parts, zones: list[ZoneStrip], most: int, rng: np.random.Generator) -> Compiled:
    """Compare a model with the parts: all as written, and at most `most` of them as MuJoCo compiles them.

    Raises
    ------
    BundleError
        If it is no plain XML.
    ArtifactError
        If MuJoCo refuses a part.
    """
    names = part_names(parts, zones)
    written = _WrittenParts(parts, names, rng.permutation(len(names))[:most].tolist())
    walk_xml(MODEL, xml, written)
    kept = {k: names[k] for k in written.kept if k in written.vertices and k in written.places}
    return Compiled(written.unlike, _compiled_mm(kept, written.vertices, written.places, parts))


class _WrittenParts:
    """Takes the meshes and geoms of parts as they come; the text of some, `kept`, is kept.

    A part is where it should be if its mesh and its place give its corners, so of each mesh only the least and the
    greatest distance of the part's corners from the mesh's are kept.
    """

    def __init__(self, parts: Parts, names: list[str], kept: list[int]) -> None:
        self._parts, self._numbers, self.kept = parts, {name: k for k, name in enumerate(names)}, kept
        self._some, self._open, self._others = set(kept), list[str](), 0
        self._off, self._place = np.full((2, len(names), 3), np.nan), np.full((len(names), 3), np.nan)
        self.vertices, self.places = dict[int, str](), dict[int, str]()

    @property
    def unlike(self) -> int:
        """Return how many parts are missing or elsewhere, and how many meshes and geoms are of no part."""
        off = np.abs(self._off - self._place).max(axis=(0, 2))
        aside = np.abs(self._place - np.mean(self._parts.boxes_m, axis=0)).max(axis=1)
        return self._others + int((~((off < _WRITTEN_M) & (aside < _MIDDLE_M))).sum())  # what is missing is no number

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Take a mesh without a file, or a geom of the mine's own body."""
        if tag == "mesh" and "file" not in attributes:
            number = self._numbers.get(attributes.get("name", ""))
            self._others += number is None
            if number is not None:
                self._take_mesh(number, attributes.get("vertex", ""))
        elif tag == "geom" and self._open and self._open[-1] == MINE_BODY:
            number = self._numbers.get(attributes.get("name", ""))
            self._others += number is None
            if number is not None:
                self._take_place(number, attributes.get("pos", "0 0 0"))
        self._open.append(attributes.get("name", "") if tag == "body" else "")

    def end(self, tag: str) -> None:
        """Leave an element."""
        self._open.pop()

    def text(self, text: str) -> None:
        """Pass text over: `minexplore` refuses it."""

    def _take_mesh(self, number: int, vertices: str) -> None:
        corners, own = _numbers(vertices), self._parts[number]
        if corners.shape == own.shape:
            self._off[:, number] = (own - corners).min(axis=0), (own - corners).max(axis=0)
        if number in self._some:
            self.vertices[number] = vertices

    def _take_place(self, number: int, place: str) -> None:
        self._place[number] = _numbers(place)
        if number in self._some:
            self.places[number] = place


def _numbers(text: str) -> np.ndarray:
    return np.array(text.split(), np.float64).reshape(-1, 3)


def _compiled_mm(names: dict[int, str], vertices: dict[int, str], places: dict[int, str], parts: Parts) -> float:
    """Return the largest distance, mm, between the corners of compiled hulls and those of their parts."""
    if not names:
        return 0.0
    root = ElementTree.Element("mujoco")
    asset, world = ElementTree.SubElement(root, "asset"), ElementTree.SubElement(root, "worldbody")
    for number, name in names.items():
        ElementTree.SubElement(asset, "mesh", name=name, vertex=vertices[number], inertia="shell")
        ElementTree.SubElement(world, "geom", name=name, type="mesh", mesh=name, pos=places[number])
    try:
        model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root).decode())
    except ValueError as error:
        raise ArtifactError(f"mine.xml: MuJoCo refuses a part: {' '.join(str(error).split())}") from error
    data, worst = mujoco.MjData(model), 0.0
    mujoco.mj_kinematics(model, data)
    for number, name in names.items():
        geom = model.geom(name).id
        mesh = model.geom_dataid[geom]
        start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        own = model.mesh_vert[start : start + count] @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        far = [cKDTree(a).query(b)[0].max() for a, b in ((own, parts[number]), (parts[number], own))]
        worst = max(worst, *map(float, far))
    return 1e3 * worst
