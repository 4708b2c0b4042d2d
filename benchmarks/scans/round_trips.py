"""Write mines as solids in every mesh format, unit and axis, read them again, and measure how far they are off."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from baselines.base.markdown import markdown_table, write_table
from benchmarks.resume import resume
from benchmarks.scans.solid_files import write
from benchmarks.scans.truth import mesh_of, truth_of
from pipeline.errors import MineError
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import SolidSurveyParams
from pipeline.survey.detection.solid import detect_solid
from pipeline.survey.solids.decimate import distances
from pipeline.survey.solids.read import read_solid
from pipeline.survey.vector.shapes import METRES
from pipeline.types import ClosedMesh

RESULTS, TABLE = Path("artifacts/bench/round-trips.jsonl"), Path("docs/evidence/parts/round-trips.md")
MINES = 5
FILES = ("a.obj", "a.stl", "a.ply", "a.glb", "a.dtm", "MESH.dxf", "3DFACE.dxf")
_LARGEST_MM = 1.0
_AWAY_M = (351_230.0, 6_301_110.0, 400.0)  # a place of a national grid
_COLUMNS = ("file", "mines", "the same to 1 mm", "farthest, mm", "volume off, at most")


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
Key = tuple[int, str, str]


@cache
def _mine(seed: int) -> tuple[str, ClosedMesh]:
    kind, truth = truth_of(seed)
    return kind, mesh_of(truth)


def judge(key: Key) -> dict[str, Any]:
    """Write one mine in one way, read it, and return how far its surface and its volume are off."""
    seed, name, wanted = key
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
    row: dict[str, Any] = {"seed": seed, "kind": kind, "file": name, "variant": wanted, "facets": len(faces)}
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


def holds(row: dict[str, Any]) -> bool:
    """Return whether a mine came back the same to a millimetre."""
    return "off_mm" in row and row["off_mm"] <= _LARGEST_MM


def table_of(rows: list[dict[str, Any]]) -> str:
    """Return the results by file as Markdown."""
    lines = []
    for name in (*FILES, None):
        some = [row for row in rows if name in (None, row["file"])]
        done = [row for row in some if "off_mm" in row]
        if done:
            off = max(row["off_mm"] for row in done)
            volume = max(row["volume"] for row in done)
            lines.append((name or "all", len(some), sum(map(holds, some)), f"{off:.3f}", f"{volume:.1e}"))
    return markdown_table(_COLUMNS, lines)


def _rows(keys: Iterable[Key]) -> Iterable[dict[str, Any]]:
    return map(judge, keys)


def _key(row: dict[str, Any]) -> Key:
    return row["seed"], row["file"], row["variant"]


def main() -> int:
    """Judge the mines that have no result yet; exit code 2 if one is not the same."""
    argparse.ArgumentParser(prog="python -m benchmarks round-trips", description=__doc__).parse_args()
    wanted = [(seed, name, one.name) for seed in range(MINES) for name in FILES for one in VARIANTS]
    rows = resume(RESULTS, wanted, _rows, "mine", _key)
    text = table_of(rows)
    write_table(TABLE, text)
    print(text)
    failed = [row for row in rows if not holds(row)]
    for row in failed:
        print(row)
    return 2 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
