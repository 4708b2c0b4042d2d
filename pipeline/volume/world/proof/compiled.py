"""The MJCF of a volume world against its parts: meshes as they are written and compiled, and MuJoCo's distances."""

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
from pipeline.mjcf.clearance import add_probe, clearance_to_parts
from pipeline.mjcf.scene import ZoneStrip
from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Volume
from pipeline.volume.world.model import part_names
from pipeline.volume.world.proof.physics import spec_of

_WRITTEN_M = 1e-6  # by which a written corner may differ from its part's
_MIDDLE_M = 1e-4  # by which a geom may be beside the middle of its part: far from it a mesh has less than 0.01 mm

_PLACES = 2000  # where clearance is measured beside the middles of facets, drawn by area
_ROUNDING_M = 1e-5  # clearances this close are equal
_OUTSIDE_M = 0.011  # of rock: a probe has a radius of 1 cm


@dataclass(frozen=True)
class ClearanceError:
    """Largest difference, m, of MuJoCo's distance to the parts from that to the surface; where it is, m; places."""

    error_m: float
    place_m: np.ndarray | None
    places: int


def clearance_error(
    volume: Volume, parts: list[ShellPart], targets: np.ndarray, most_m: float, rng: np.random.Generator
) -> ClearanceError:
    """Measure clearance before the middle of each facet, and before places of all facets drawn by area.

    Places are up to `most_m` from their facets; distances beyond it count as that. `targets` (f,) says which facets
    count.
    """
    chosen = np.flatnonzero(targets)
    size = np.linalg.norm(volume.normals, axis=1)
    chosen = chosen[size[chosen] > 0]
    drawn = rng.choice(chosen, _PLACES, p=size[chosen] / size[chosen].sum())
    share = np.concatenate([np.full((len(chosen), 3), 1 / 3), rng.dirichlet(np.ones(3), _PLACES)])
    facet = np.concatenate([chosen, drawn])
    on_facet = np.einsum("ki,kij->kj", share, volume.vertices[volume.faces[facet]])
    into = -volume.normals[facet] / size[facet][:, None]
    places = on_facet + rng.uniform(_OUTSIDE_M, most_m, len(facet))[:, None] * into
    free_m = volume.inside.distance_m(places)
    places, free_m = places[free_m > _OUTSIDE_M], free_m[free_m > _OUTSIDE_M]
    if not len(places):
        return ClearanceError(0.0, None, 0)
    model = spec_of(parts, add_probe).compile()
    corners = [part.corners for part in parts]
    measured = clearance_to_parts(model, np.arange(len(parts)), corners, np.eye(4), places, most_m)
    error = np.abs(np.minimum(free_m, most_m) - measured)
    doubtful = np.flatnonzero(error > _ROUNDING_M)
    error[doubtful[~volume.inside.are_free(places[doubtful])]] = 0.0  # in rock, where rays along facets miscount
    worst = int(error.argmax())
    return ClearanceError(float(error[worst]), places[worst], len(places))


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
