"""Reader of Open Mining Format (.omf) of version 1 by its own library: the triangulated surfaces of a project."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from minesurveys.coordinates.map_axes import metres_of_unit
from minesurveys.errors import InputError, one_line
from minesurveys.remarks import warn_user
from minesurveys.solids.stated_metres import LayerMesh, StatedMeshes

OMF = ".omf"


def read_omf(path: Path, _data: bytes) -> StatedMeshes:
    """Read the triangulated surfaces of an OMF project, each a layer by its name.

    Places are counted from the origins of the project and of the surface. Points, lines, grids and block models are
    listed.

    Raises
    ------
    InputError
        If `omf` is not installed, the file is no OMF of version 1, has no surface, or states an unknown unit.

    References
    ----------
    Global Mining Guidelines Group, Open Mining Format 1.0.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # omf 1.0.1 is of 2019, before numpy 2
            import omf
    except ImportError as error:
        raise InputError(f"{path}: OMF is read by omf: pip install 'minexplore-pipeline[omf]'") from error
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            project = omf.OMFReader(str(path)).get_project()
            origin = np.array(project.origin, np.float64)
            read = [one for one in project.elements if isinstance(getattr(one, "geometry", None), omf.SurfaceGeometry)]
            found = [_mesh(element, origin) for element in read]
    except Exception as error:  # the library raises what its parsers raise
        raise InputError(f"{path}: not an OMF file of version 1; it is of version 2, broken or cut off") from error
    others = sorted(
        {type(one.geometry).__name__.removesuffix("Geometry") for one in project.elements if one not in read}
    )
    if not found:
        raise InputError(
            f"{path}: has no triangulated surface, only {', '.join(others) or 'nothing'}; export the solid as a surface"
        )
    if others:
        warn_user(f"its triangulated surfaces are read; {', '.join(others)} are not", of=path.name)
    stated = str(project.units or "").strip()
    metres = metres_of_unit(stated)
    if stated and metres is None:
        raise InputError(
            f"{path}: its unit is {one_line(stated, 40)!r}, which is none of length; want m, cm, mm, ft, in"
        )
    return StatedMeshes(found, metres)


def _mesh(element: Any, origin: np.ndarray) -> LayerMesh:
    """Return a surface's mesh; `origin` (3,) is the project's."""
    geometry, name = element.geometry, str(element.name or "surface")[:200]
    place = origin + np.array(geometry.origin, np.float64)
    vertices, faces = np.array(geometry.vertices.array, np.float64), np.array(geometry.triangles.array, np.int64)
    return LayerMesh(name, vertices + place, faces)
