"""Loading and compilation of a world: without copies that MuJoCo would keep, every part where its text places it."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from minexplore.bundle import INERTIAL_QUAT, MINE_BODY, TriangleMesh, encode_msh, line_of
from pipeline.errors import ArtifactError

_MOST_MOVED_M = 1e-5
STAND_IN = TriangleMesh(  # a tetrahedron in the place of a mesh that is not needed
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float),
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32),
    np.zeros((4, 2)),
    np.zeros((0, 3)),
)


def load_model(path: Path) -> mujoco.MjModel:
    """Compile a model file; afterwards only the model stays in memory.

    `MjModel.from_xml_path` keeps the compiled specification for `mj_saveLastXML`, and up to 500 MB of meshes in a
    cache: 1.6 GB for the default world, whose model takes 0.4 GB. Without the cache the peak is 0.5 GB lower.

    Raises
    ------
    ArtifactError
        If MuJoCo refuses the model; the message is MuJoCo's, on one line.
    """
    return compile_spec(read_spec(path), path)


def read_spec(path: Path) -> mujoco.MjSpec:
    """Return the specification that a model file holds.

    Raises
    ------
    ArtifactError
        If MuJoCo refuses it, with MuJoCo's message on one line; or a geom has no mesh, which MuJoCo finds later.
    """
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise ArtifactError(f"{path}: MuJoCo does not read it: {line_of(error)}") from error
    meshes = {mesh.name for mesh in spec.meshes}
    for geom in spec.geoms:
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH and geom.meshname not in meshes:
            raise ArtifactError(f"{path}: geom {geom.name}: mesh {geom.meshname!r} is missing")
    return spec


def compile_spec(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """Return the model of a specification that was made of a model file; MuJoCo caches no meshes.

    Errors as `read_spec`.
    """
    cache = mujoco.mj_getCache()
    capacity = mujoco.mj_getCacheCapacity(cache)
    mujoco.mj_setCacheCapacity(cache, 0)
    try:
        return spec.compile()
    except ValueError as error:
        raise ArtifactError(f"{path}: MuJoCo does not compile it: {line_of(error)}") from error
    finally:
        mujoco.mj_setCacheCapacity(cache, capacity)


def text_of(spec: mujoco.MjSpec, path: Path) -> str:
    """Return the text of a model file's specification, which may be changed as `compile_world` does.

    MuJoCo writes a text only after it compiles, and the text does not depend on what mesh files hold: meanwhile all
    hold a tetrahedron, because MuJoCo copies a whole compiled world to write its text.

    Raises
    ------
    ArtifactError
        If MuJoCo refuses the specification; the message is MuJoCo's, on one line.
    """
    assets, stand_in = dict(spec.assets), encode_msh(STAND_IN)
    spec.assets = {name: stand_in if name.endswith(".msh") else data for name, data in assets.items()}
    compile_world(spec, path)
    text = str(spec.to_xml())
    spec.assets = assets
    return text


def compile_world(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """Compile the specification of a model file; change it first where MuJoCo would move parts of the mine.

    MuJoCo treats two rotations as one if their quaternions differ by less than 1e-6 in each number:
    findings/mujoco-small-turns-are-left-out.sh. In a long straight drift a wall's own axes can be as near as that to
    the axes of inertia of the whole mine. MuJoCo then turns the wall by up to 3e-6 rad, and its end moves by 0.3 mm.
    The mine never moves, so its inertia is free to choose: where a part would move by more than 0.01 mm, the body
    states axes that no part has.

    Raises
    ------
    ArtifactError
        If MuJoCo refuses the specification; the message is MuJoCo's, on one line.
    """
    model = compile_spec(spec, path)
    if most_moved_m(model) <= _MOST_MOVED_M:
        return model
    mine = spec.body(MINE_BODY)
    mine.explicitinertial = True
    mine.mass, mine.inertia, mine.ipos, mine.iquat = 1.0, [1.0] * 3, [0.0] * 3, list(INERTIAL_QUAT)
    return compile_spec(spec, path)


def most_moved_m(model: mujoco.MjModel) -> float:
    """Return the largest distance, m, between the place of a part's corner in the model's text and in MuJoCo."""
    parts = np.flatnonzero((model.geom_bodyid == model.body(MINE_BODY).id) & (model.geom_sameframe != 0))
    parts = parts[model.geom_type[parts] == mujoco.mjtGeom.mjGEOM_MESH]
    if not len(parts):
        return 0.0
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    body, turned, most = data.body(MINE_BODY).xmat.reshape(3, 3), np.zeros(9), 0.0
    for part in parts:
        mujoco.mju_quat2Mat(turned, model.geom_quat[part])
        error = data.geom_xmat[part].reshape(3, 3) - body @ turned.reshape(3, 3)
        most = max(most, float(np.linalg.norm(np.abs(error) @ model.geom_aabb[part, 3:])))
    return most
