"""Whether the visible floor and the furniture are what the builder makes of the outline, the network and the rock."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from shapely import Polygon

from minexplore.bundle import (
    FURNITURE,
    MESHES,
    MODEL,
    TOPOLOGY,
    TriangleMesh,
    decode_msh,
    encode_msh,
    is_fitting,
    mesh_file,
    mesh_of,
    puddle_geom,
    shade_geom,
)
from minexplore.looks import SHADE_LEVELS, TEXTURE_PER_M
from pipeline.errors import ArtifactError
from pipeline.mjcf.bundle import WorldRecord
from pipeline.mjcf.floor.cover import cover_floor
from pipeline.mjcf.floor.grid import level_grid
from pipeline.mjcf.furniture import hang_furniture, on_level, ways_of
from pipeline.mjcf.loading import read_spec
from pipeline.params.fittings import FloorParams, FurnitureParams
from pipeline.proof.rebuilt.visible import rough_meshes
from pipeline.store.codecs import Bundle, decode, encode
from pipeline.types import DriftNetwork, Mesh

_APART_M = 2e-3  # of a corner: far from the origin it has millimetres, and another processor may round the other way
_TEXTURED_M = 5e-3
_LEVEL_M = 1e-6


def require_floor(
    folder: Path, files: Iterable[str], params: FloorParams | None, lay: Callable[[FloorParams], Mapping[str, Mesh]]
) -> None:
    """Make the visible floor of a bundle again and compare every face; it may be absent.

    Parameters
    ----------
    folder : Path
    files : iterable of str
        The bundle's, by its record.
    params : FloorParams, optional
    lay : callable
        Makes the meshes of a floor.

    Raises
    ------
    ArtifactError
        With the file, how it differs, and the parameters that would make it.
    """
    names = {name for name in _fittings(files) if not _is_furniture(name)}
    if not names:
        return
    if params is None:
        raise ArtifactError(f"{folder / mesh_file(min(names))}: a visible floor, realism.floor = null says none")
    made = {name: decode_msh(encode(Path("cover.msh"), mesh)) for name, mesh in lay(params).items()}
    differs = _first_difference(folder, names, made)
    if differs:
        raise ArtifactError(f"{differs}, by realism.floor")


def lay_level(folder: Path, record: WorldRecord, free: Polygon) -> Callable[[FloorParams], Mapping[str, Mesh]]:
    """Return what makes the visible floor of a level mine, once the water in its model is as its parameters say."""

    def lay(params: FloorParams) -> Mapping[str, Mesh]:
        _require_water(folder, record, params)
        return cover_floor(params, level_grid(params, free, _network(folder)), record.zones)

    return lay


def _require_water(folder: Path, record: WorldRecord, params: FloorParams) -> None:
    """Compare the level of the water and the zones that it stands on; `require_same_model` has compared the planes."""
    flooded = [zone.name for zone in record.zones if zone.name in params.puddles]
    spec = read_spec(folder / MODEL)
    level = float(spec.geom(shade_geom(0)).pos[2]) / SHADE_LEVELS[0]
    if abs(level - params.water_m) > _LEVEL_M:
        raise ArtifactError(f"{folder / MODEL}: level {level:g} m, want {params.water_m:g} m, realism.floor.water_m")
    geoms = {geom.name for geom in spec.geoms}
    wet = [zone.name for zone in record.zones if puddle_geom(zone.name) in geoms]
    if wet != flooded:
        raise ArtifactError(f"{folder / MODEL}: water stands on {wet}, want {flooded}, realism.floor.puddles")


def require_furniture(
    folder: Path, files: Iterable[str], params: Mapping[str, FurnitureParams], hang: Callable[[FurnitureParams], Bundle]
) -> None:
    """Make the furniture of a bundle again and compare every face; it may be absent.

    It must be all of one kind of `params`. The error names the first difference from the likeliest one.

    Parameters
    ----------
    folder : Path
    files : iterable of str
        The bundle's, by its record.
    params : dict of FurnitureParams
    hang : callable
        Makes the furniture of a kind on the bundle's own rock.

    Raises
    ------
    ArtifactError
        With the file, how it differs, and the parameters that would make it.
    """
    names = {name for name in _fittings(files) if _is_furniture(name)}
    if not names:
        return
    if not params:
        raise ArtifactError(f"{folder / mesh_file(min(names))}: furniture, realism.furniture says none")
    message = ""
    for kind, wanted in sorted(params.items(), key=lambda item: _unlike(names, item[1])):
        differs = _first_difference(folder, names, {name: decode_msh(data) for name, data in hang(wanted).items()})
        if differs is None:
            return
        message = message or f"{differs}, by realism.furniture.{kind}"
    raise ArtifactError(message)


def hang_again(folder: Path, record: WorldRecord) -> Callable[[FurnitureParams], Bundle]:
    """Return what makes the furniture of a level mine on the rock of its bundle, which `visible` checks."""

    def hang(params: FurnitureParams) -> Bundle:
        network = _network(folder)
        rough = {f"{name}.msh": (folder / mesh_file(name)).read_bytes() for name in rough_meshes(_meshes(record.files))}
        return hang_furniture(params, ways_of(network, record.height_m), on_level(network.main_drift_m), rough)

    return hang


def _meshes(files: Iterable[str]) -> list[str]:
    return [mesh_of(name) for name in files if name.startswith(MESHES)]


def _fittings(files: Iterable[str]) -> list[str]:
    return [name for name in _meshes(files) if is_fitting(name)]


def _is_furniture(mesh: str) -> bool:
    return mesh.partition("_")[0] in FURNITURE


def _network(folder: Path) -> DriftNetwork:
    network: DriftNetwork = decode(folder / TOPOLOGY, DriftNetwork)
    return network


def _unlike(names: set[str], params: FurnitureParams) -> int:
    """Return in how many of duct and weld mesh furniture of these names is not of these parameters."""
    shown = [any(name.startswith(f"{kind}_") for name in names) for kind in ("duct", "weldmesh")]
    return sum(has != bool(wanted) for has, wanted in zip(shown, (params.duct, params.weld_mesh), strict=True))


def _first_difference(folder: Path, names: set[str], made: dict[str, TriangleMesh]) -> str | None:
    """Return how the first mesh that differs does so, or None."""
    for name in sorted(names | made.keys()):
        path = folder / mesh_file(name)
        if name not in names:
            return f"{path}: missing"
        if name not in made:
            return f"{path}: want no such mesh"
        differs = _mesh_difference(decode_msh(path.read_bytes()), made[name])
        if differs:
            return f"{path}: {differs}"
    return None


def _mesh_difference(found: TriangleMesh, made: TriangleMesh) -> str | None:
    """Return how a mesh differs from another one in faces, corners, texture or normals, or None."""
    counts = [(len(m.vertices), len(m.faces), len(m.texcoords), len(m.normals)) for m in (found, made)]
    if counts[0] != counts[1]:
        kinds = "vertices, faces, texture coordinates and normals"
        return f"{counts[0]} {kinds}, want {counts[1]}"
    one, two = (m.vertices[m.faces].astype(np.float64) for m in (found, made))
    if encode_msh(found) == encode_msh(made):
        return None
    tree = cKDTree(two.mean(axis=1))
    _, at = tree.query(one.mean(axis=1))
    turned = np.stack([np.roll(one, k, axis=1) for k in range(3)])  # the same face, begun at another corner
    apart = np.linalg.norm(turned - two[at], axis=3).max(axis=2).min(axis=0)
    if not apart.max() <= _APART_M:
        x, y, z = one[int(apart.argmax())].mean(axis=0)
        return f"a face at ({x:.2f}, {y:.2f}, {z:.2f}) m is {apart.max():.3f} m from where it should be"
    _, own = tree.query(two.mean(axis=1))  # two bolts may hang at one place: their equal faces count once
    missing = len(np.unique(own)) - len(np.unique(own[at]))
    if missing:
        return f"{missing} faces twice, and as many missing"
    if len(np.unique(found.faces)) < len(found.vertices):
        return "vertices that belong to no face"
    if len(found.texcoords):
        _, same = cKDTree(made.vertices).query(found.vertices)
        laid = np.abs(found.texcoords - made.texcoords[same]).max() / TEXTURE_PER_M
        if not laid <= _TEXTURED_M:
            return f"a texture that is {laid:g} m away from its place"
    return None
