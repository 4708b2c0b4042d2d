"""Reader of USD (.usd, .usda, .usdc) by usd-core: meshes in the places that the stage gives them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from minesurveys.errors import InputError
from minesurveys.limits import FILE, reader_limits
from minesurveys.remarks import warn_user
from minesurveys.solids.polygons import triangles_of
from minesurveys.solids.stated_metres import LayerMesh, StatedMeshes

USD = (".usd", ".usda", ".usdc")
_NOT_SHOWN = ("guide", "proxy")
_FORMATS = ("usd", "usda", "usdc")


def read_usd(path: Path, _data: bytes) -> StatedMeshes:
    """Read the meshes of a USD file at its default time, each a layer by its path; instances are placed.

    Metres a unit and the axis that points up are those of the stage. Without them USD's own rule counts centimetres and
    y, with a remark. Nothing outside the file is read: a file that names others is refused.

    Raises
    ------
    InputError
        If usd-core is not installed, the file is no USD, names other files, or has no mesh.

    References
    ----------
    OpenUSD, UsdGeomMesh, UsdGeomPointInstancer, "Encoding Stage UpAxis", "Encoding Stage Linear Units".
    """
    try:
        from pxr import Sdf, Tf, Usd, UsdGeom
    except ImportError as error:
        raise InputError(f"{path}: USD is read by usd-core: pip install 'minexplore-pipeline[export]'") from error
    try:
        layer = Sdf.Layer.FindOrOpen(str(path.resolve()))
        if layer is None or layer.GetFileFormat().formatId not in _FORMATS:
            raise InputError(f"{path}: not a USD file")
        others = sorted(filter(None, layer.GetCompositionAssetDependencies()))  # an empty one is the file itself
        if others:
            raise InputError(
                f"{path}: names other files, the first {others[0][:80]!r}; "
                "`usdcat -f IN -o OUT.usdc` writes one of them all"
            )
        stage = Usd.Stage.Open(layer)
        found, left_out = [], Counter[str]()
        for mesh in _stage_meshes(path, stage, left_out):
            found.append(mesh)
    except Tf.ErrorException as error:
        raise InputError(f"{path}: not a USD file that can be read; it is broken or cut off") from error
    if +left_out:
        listed = ", ".join(f"{count} {name}" for name, count in sorted((+left_out).items()))
        warn_user(f"not read: {listed}", of=path.name)
    metres, up = float(UsdGeom.GetStageMetersPerUnit(stage)), str(UsdGeom.GetStageUpAxis(stage)).lower()
    if up not in ("y", "z"):
        raise InputError(f"{path}: upAxis is {up[:20]!r}; want Y or Z")
    missing = [] if UsdGeom.StageHasAuthoredMetersPerUnit(stage) else ["metersPerUnit: a unit is a centimetre (--unit)"]
    missing += [] if stage.HasAuthoredMetadata("upAxis") else ["upAxis: y is up (--up)"]
    if missing:
        warn_user(f"states no {', no '.join(missing)}, as USD's rule has it", of=path.name)
    return StatedMeshes(found, metres, up)


def _stage_meshes(path: Path, stage: Any, left_out: Counter[str]) -> Iterator[LayerMesh]:
    from pxr import Usd, UsdGeom

    places = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    for prim in _shown(path, stage.GetPseudoRoot(), left_out):
        if prim.IsA(UsdGeom.PointInstancer):
            yield from _instances(path, prim, places, left_out)
        elif prim.IsA(UsdGeom.Mesh):
            yield from _mesh(path, prim, np.array(places.GetLocalToWorldTransform(prim)), left_out)
        elif prim.IsA(UsdGeom.Gprim):
            left_out[str(prim.GetTypeName())] += 1


def _shown(path: Path, root: Any, left_out: Counter[str]) -> Iterator[Any]:
    """Yield a prim and those below it that are shown; nothing below a point instancer, whose prototypes are hidden."""
    from pxr import Usd, UsdGeom

    prims = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies()))
    for number, prim in enumerate(prims):
        if number > reader_limits().shapes:
            raise InputError(f"{path}: more than {reader_limits().shapes:,} prims (shapes in {FILE})")
        shown = UsdGeom.Imageable(prim)
        if shown and shown.ComputeVisibility(Usd.TimeCode.EarliestTime()) == UsdGeom.Tokens.invisible:
            left_out["invisible"] += 1
            prims.PruneChildren()
        elif shown and shown.ComputePurpose() in _NOT_SHOWN:
            left_out[f"of purpose {shown.ComputePurpose()}"] += 1
            prims.PruneChildren()
        else:
            if prim.IsA(UsdGeom.PointInstancer):
                prims.PruneChildren()
            yield prim


def _instances(path: Path, prim: Any, places: Any, left_out: Counter[str]) -> Iterator[LayerMesh]:
    """Yield the meshes of a point instancer's prototypes at each of its places."""
    from pxr import Usd, UsdGeom

    instancer, time = UsdGeom.PointInstancer(prim), Usd.TimeCode.EarliestTime()
    own = np.array(places.GetLocalToWorldTransform(prim))
    moves = instancer.ComputeInstanceTransformsAtTime(time, time, UsdGeom.PointInstancer.IncludeProtoXform)
    kinds = _values(instancer.GetProtoIndicesAttr(), np.int64).tolist()
    mask = list(instancer.ComputeMaskAtTime(time)) or [True] * len(kinds)
    roots = [prim.GetStage().GetPrimAtPath(target) for target in instancer.GetPrototypesRel().GetForwardedTargets()]
    if len(kinds) * len(roots) > reader_limits().shapes:
        raise InputError(f"{path}: {prim.GetPath()} has {len(kinds):,} instances, at most {reader_limits().shapes:,}")
    kinds = [kind for kind, is_shown in zip(kinds, mask, strict=False) if is_shown]  # moves are those of the shown
    if len(moves) != len(kinds) or not all(0 <= kind < len(roots) and roots[kind] for kind in kinds):
        raise InputError(f"{path}: {prim.GetPath()}: its instances, places and prototypes do not fit each other")
    for root in roots:
        for below in _shown(path, root, left_out) if root else ():
            if not below.IsA(UsdGeom.Mesh):
                name = str(below.GetTypeName())
                left_out[f"{name} of an instance"] += below.IsA(UsdGeom.Gprim) or below.IsA(UsdGeom.PointInstancer)
                continue
            local = np.array(places.ComputeRelativeTransform(below, root)[0])
            for kind, move in zip(kinds, moves, strict=True):
                if roots[kind] == root:
                    yield from _mesh(path, below, local @ np.array(move) @ own, left_out)


def _mesh(path: Path, prim: Any, place: np.ndarray, left_out: Counter[str]) -> Iterator[LayerMesh]:
    """Yield a mesh with its place (4, 4), of row vectors as in USD; nothing if it has no faces."""
    from pxr import UsdGeom

    mesh = UsdGeom.Mesh(prim)
    vertices = _values(mesh.GetPointsAttr(), np.float64).reshape(-1, 3)
    sizes = _values(mesh.GetFaceVertexCountsAttr(), np.int64)
    corners = _values(mesh.GetFaceVertexIndicesAttr(), np.int64)
    if not len(sizes):
        return
    if (
        sizes.min() < 0
        or sizes.sum() != len(corners)
        or not 0 <= corners.min(initial=0) <= corners.max(initial=0) < len(vertices)
    ):
        raise InputError(f"{path}: {prim.GetPath()}: its faces and its points do not fit each other")
    holes = _values(mesh.GetHoleIndicesAttr(), np.int64)
    if len(holes):
        shown = ~np.isin(np.arange(len(sizes)), holes)
        corners, sizes = corners[np.repeat(shown, sizes)], sizes[shown]
    scheme = mesh.GetSubdivisionSchemeAttr()
    if scheme.HasAuthoredValue() and scheme.Get() != UsdGeom.Tokens.none:
        left_out[f"subdivision ({scheme.Get()}): the mesh before it is read"] += 1
    faces = triangles_of(vertices, corners, sizes)
    turned = (mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded) != (np.linalg.det(place[:3, :3]) < 0)
    placed = vertices @ place[:3, :3] + place[3, :3]
    yield LayerMesh(str(prim.GetPath()), placed, faces[:, ::-1] if turned else faces)


def _values(attribute: Any, dtype: Any) -> np.ndarray:
    """Return the values of an attribute at the first time that it has, none if it has no value."""
    from pxr import Usd

    found = attribute.Get(Usd.TimeCode.EarliestTime())
    return np.zeros(0, dtype) if found is None else np.array(found, dtype)
