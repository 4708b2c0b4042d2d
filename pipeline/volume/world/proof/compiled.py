"""The MJCF of a volume world against its parts: every mesh as it is written, and some as MuJoCo compiles them."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree

import mujoco
import numpy as np
from scipy.spatial import cKDTree

from minexplore.bundle import MINE_BODY
from minexplore.floors.volume_arrays import Parts
from pipeline.errors import ArtifactError
from pipeline.mjcf.scene import ZoneStrip
from pipeline.volume.world.model import part_names

_WRITTEN_M = 1e-6  # by which a written corner may differ from its part's


@dataclass(frozen=True)
class Compiled:
    """Parts that the model lacks, has besides or has elsewhere; farthest corner of a compiled hull, mm."""

    unlike: int
    compiled_mm: float


def compare_model(xml: bytes, parts: Parts, zones: list[ZoneStrip], most: int, rng: np.random.Generator) -> Compiled:
    """Compare a model with the parts: all as written, and at most `most` of them as MuJoCo compiles them."""
    try:
        root = ElementTree.fromstring(xml)
    except ElementTree.ParseError as error:
        line, before = error.position
        raise ArtifactError(f"mine.xml: not XML from line {line}, character {before + 1} on") from error
    written = {mesh.get("name"): mesh.get("vertex", "") for mesh in root.iter("mesh") if not mesh.get("file")}
    geoms = {geom.get("name"): geom.get("pos", "0 0 0") for geom in root.iterfind(f".//body[@name='{MINE_BODY}']/geom")}
    names = part_names(parts, zones)
    unlike = len(set(written) ^ set(names)) + len(set(geoms) ^ set(names))
    for number, name in enumerate(names):
        if name in written and name in geoms:
            placed = _numbers(written[name]) + _numbers(geoms[name])
            unlike += not (placed.shape == parts[number].shape and np.abs(placed - parts[number]).max() < _WRITTEN_M)
    shared = [k for k, name in enumerate(names) if name in written and name in geoms]
    chosen = rng.permutation(shared)[:most].tolist()
    return Compiled(unlike, _compiled_mm({k: names[k] for k in chosen}, written, geoms, parts))


def _numbers(text: str) -> np.ndarray:
    return np.array(text.split(), np.float64).reshape(-1, 3)


def _compiled_mm(
    names: dict[int, str], written: dict[str | None, str], geoms: dict[str | None, str], parts: Parts
) -> float:
    """Return the largest distance, mm, between the corners of compiled hulls and those of their parts."""
    if not names:
        return 0.0
    root = ElementTree.Element("mujoco")
    asset, world = ElementTree.SubElement(root, "asset"), ElementTree.SubElement(root, "worldbody")
    for name in names.values():
        ElementTree.SubElement(asset, "mesh", name=name, vertex=written[name], inertia="shell")
        ElementTree.SubElement(world, "geom", name=name, type="mesh", mesh=name, pos=geoms[name])
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
