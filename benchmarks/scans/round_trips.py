"""Write mines as solids in every mesh format, unit and axis, read them again, and measure how far they are off."""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.judged_cases import JudgedCases, largest
from benchmarks.results import Row
from benchmarks.scans.solid_files import write
from benchmarks.scans.truth import mesh_of, truth_of
from minesurveys.frames import METRES
from pipeline.errors import MineError
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import SolidSurveyParams
from pipeline.survey.detection.solid import detect_solid
from pipeline.survey.solids.decimate import distances
from pipeline.survey.solids.read import read_solid
from pipeline.types import ClosedMesh

MINES = 5
FILES = ("a.obj", "a.stl", "a.ply", "a.glb", "a.dtm", "MESH.dxf", "3DFACE.dxf")
_LARGEST_MM = 1.0
_AWAY_M = (351_230.0, 6_301_110.0, 400.0)  # a place of a national grid


@dataclass(frozen=True)
class Variant:
    """How a mine is written: in which unit, with y up or z, with normals into it or out of it, and how far away."""

    name: str
    unit: str
    up: str
    inwards: bool
    away_m: tuple[float, float, float]


NOWHERE = (0.0, 0.0, 0.0)
VARIANTS = (
    Variant("m", "m", "z", False, NOWHERE),
    Variant("mm, y up, normals inwards", "mm", "y", True, NOWHERE),
    Variant("ft, in a national grid", "ft", "z", False, _AWAY_M),
)
_SINGLE = (".stl", ".ply", ".glb")  # corners of 32 bits: 3 cm apart in a national grid
_STATES_UNIT = (".glb", ".dxf")  # in which these files are metres, and GLB has y up by its rule


@cache
def _mine(seed: int) -> tuple[str, ClosedMesh]:
    kind, truth = truth_of(seed)
    return kind, mesh_of(truth)


def judge(case: tuple[int, str, str]) -> Row:
    """Write one mine in one way, read it, and return how far its surface and its volume are off."""
    seed, name, wanted = case
    variant = next(one for one in VARIANTS if one.name == wanted)
    kind, mesh = _mine(seed)
    suffix = Path(name).suffix
    unit = "m" if suffix in _STATES_UNIT else variant.unit
    away = np.zeros(3) if suffix in _SINGLE else np.array(variant.away_m)
    written = (mesh.vertices + away) / METRES[unit]
    up = "z" if suffix == ".glb" else variant.up
    if up == "y":
        written = written[:, [0, 2, 1]] * [1, 1, -1]
    faces = mesh.faces[:, ::-1] if variant.inwards else mesh.faces
    row: Row = {"kind": kind, "file": name, "facets": len(faces)}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        write(path, written, faces.astype(np.int64), path.stem)
        try:
            stated = StatedOptions.model_validate(
                ({} if suffix in _STATES_UNIT else {"unit": unit}) | ({"up": "y"} if up == "y" else {})
            )
            values = detect_solid(path, stated).values | {"name": "a", "heights": None, "file": "data/x"}
            params = SolidSurveyParams.model_validate(values).model_copy(update={"file": path.as_posix()})
            found = read_solid(params)
        except MineError as error:
            return row | {"problem": str(error)}
    metres = found.georeference.metres_per_unit
    shift = np.array([*found.georeference.origin, found.solid.datum_m / metres]) * metres - away
    again = found.solid.vertices + shift
    off = [
        distances(mesh.vertices, again, found.solid.faces.astype(np.int64)),
        distances(again, mesh.vertices, mesh.faces.astype(np.int64)),
    ]
    far_mm = 1e3 * float(np.concatenate(off).max())
    volumes = [_volume_m3(mesh.vertices, mesh.faces), _volume_m3(again, found.solid.faces)]
    return row | {"off_mm": round(far_mm, 4), "volume": round(abs(volumes[1] / volumes[0] - 1), 8)}


def _volume_m3(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = np.moveaxis(vertices[faces] - vertices.mean(axis=0), 1, 0)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def holds(row: Row) -> bool:
    """Return whether a mine came back the same to a millimetre."""
    return "off_mm" in row and row["off_mm"] <= _LARGEST_MM


ROUND_TRIPS = JudgedCases(
    name="round-trips",
    cases=[(seed, name, one.name) for seed in range(MINES) for name in FILES for one in VARIANTS],
    judge=judge,
    holds=holds,
    groups=lambda row: [row["file"]],
    of="file",
    columns={
        "mines": len,
        "the same to 1 mm": lambda rows: sum(map(holds, rows)),
        "farthest, mm": largest("off_mm", ".3f"),
        "volume off, at most": largest("volume", ".1e"),
    },
)

if __name__ == "__main__":
    sys.exit(ROUND_TRIPS.run(__doc__))
