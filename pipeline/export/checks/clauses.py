"""The certificate's clauses of collision parts that were read back: the code of `certify`, on a model made of them."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

import mujoco
import numpy as np

from minexplore.bundle import MINE_BODY, MODEL, GeomGroup
from minexplore.rotations import quaternion
from pipeline.export.labels import group_of
from pipeline.export.scene import ConvexPart, ReadScene, hull_of
from pipeline.mjcf.bundle import OpenedBundle
from pipeline.mjcf.loading import compile_world
from pipeline.params.validation import CertificateParams, ValidationParams
from pipeline.proof.certificate import Certificate, certify, measure_containment
from pipeline.proof.rebuilt.remake import read_free_space

OF_PHYSICS = ("contacts", "escapes", "deepest_m")  # of robots that MuJoCo steps


def certify_parts(bundle: Path, opened: OpenedBundle, read: ReadScene, params: ValidationParams) -> Certificate:
    """Measure the clauses of the certificate that are about geometry on parts read back from a file.

    Parameters
    ----------
    bundle : Path
        The bundle that was exported; it states the workings and the floor.
    opened : OpenedBundle
        The same, opened.
    read : ReadScene
    params : ValidationParams
        The validator's own, with what the bundle claims (`allowed_claims`).

    Raises
    ------
    ArtifactError
        If MuJoCo refuses the parts.
    """
    settings = of_geometry(params.certificate)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        model = _write_model(folder, read.parts, np.array(opened.record.T_world_mine))
        world = dataclasses.replace(opened, model=model)
        tracing = params.network_cell_m, params.network_min_leg_m
        figures = measure_containment(folder, world, read_free_space(bundle), settings, tracing)
    return certify(opened.record.world_sha256, figures, settings.limits)


def of_geometry(params: CertificateParams) -> CertificateParams:
    """Return the parameters without the clauses of robots, whose steps depend on the simulator and not on a file."""
    limits = {name: limit for name, limit in params.limits.items() if name not in OF_PHYSICS}
    return params.model_copy(update={"limits": limits, "contacts": 0})


def _write_model(folder: Path, parts: list[ConvexPart], T_world_mine: np.ndarray) -> mujoco.MjModel:
    """Write the parts as a model in a folder, and return it compiled."""
    spec = mujoco.MjSpec()
    spec.compiler.savecompiled = False  # the text has the given values with all digits
    mine = spec.worldbody.add_body(name=MINE_BODY, pos=T_world_mine[:3, 3], quat=quaternion(T_world_mine[:3, :3]))
    for part in parts:
        _add_part(spec, mine, part, group_of(part.label))
    model = compile_world(spec, folder / MODEL)
    (folder / MODEL).write_text(spec.to_xml())
    return model


def _add_part(spec: mujoco.MjSpec, mine: mujoco.MjsBody, part: ConvexPart, group: GeomGroup) -> None:
    if part.is_box:
        box = mujoco.mjtGeom.mjGEOM_BOX
        mine.add_geom(name=part.name, type=box, size=part.half_m, pos=part.centre_m, group=group)
        return
    corners, _ = hull_of(part)
    spec.add_mesh(name=part.name, uservert=corners.ravel().tolist())
    mesh = mujoco.mjtGeom.mjGEOM_MESH
    mine.add_geom(name=part.name, type=mesh, meshname=part.name, pos=part.centre_m, group=group)
