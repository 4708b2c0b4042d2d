"""Scan mines whose volume is known, find the volume again, and measure how far it is from the truth.

The scans have 20 to 2,000 points a square metre with noise of 2 cm, shadows, a hole of half a metre, and a person and
a vehicle in them. With another noise the results are a file of their own, and the table of the evidence stays.
"""

from __future__ import annotations

import argparse
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import manifold3d
import numpy as np

from baselines.base.markdown import markdown_table, write_table
from benchmarks.resume import resume
from benchmarks.scans.sample import NOISE_M, Scan, scan_of
from benchmarks.scans.truth import FloorNetwork, mesh_of, network_of_floors, truth_of
from pipeline.errors import MineError
from pipeline.scans.point_blocks import PointBlock
from pipeline.survey.clouds.thinned import spacing_of, thin
from pipeline.survey.clouds.volume import ScannedVolume, volume_of_cloud
from pipeline.survey.detection.cloud import resolution
from pipeline.survey.solids.read import MOST_FACETS
from pipeline.types import ClosedMesh
from pipeline.volume.rock.inside import Inside
from pipeline.volume.world.solid import volume_of_solid

RESULTS, TABLE = Path("artifacts/bench/scans.jsonl"), Path("docs/evidence/parts/scans.md")
_FLOOR_M, _WALL_M, _IOU = 0.03, 0.05, 0.97  # wanted
_DENSITY = (20.0, 2000.0)  # points a m2
_FINEST_M = 0.025  # as `detect_cloud` reads a small file
_SIMPLIFY_M = 0.03  # the command's own
_SAMPLES = 200_000
_CLEAR_M, _APART_M = 2.0, 8.0  # beside a vehicle, and between it and the person
_AWAY_M = (3.2, 1.0)  # of the scanner from the vehicle, from the person
_COLUMNS = ("mine", "scans", "hold", "floor, cm RMS", "walls, cm RMS", "lowest IoU", "network equal", "things found")


def _things(network: FloorNetwork, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float]:
    """Return where a person and a vehicle stand, and the vehicle's heading."""
    wide = np.flatnonzero(network.half_m >= min(_CLEAR_M, network.half_m.max()))
    one = int(rng.choice(wide))
    far = np.linalg.norm(network.floors_m - network.floors_m[one], axis=1)
    other = int(rng.choice(np.flatnonzero(far >= min(_APART_M, far.max()))))
    return network.floors_m[other], network.floors_m[one], float(network.heading_deg[one])


def scan_mine(
    truth: manifold3d.Manifold,
    network: FloorNetwork,
    rng: np.random.Generator,
    per_m2: float,
    noise_m: float = NOISE_M,
) -> Scan:
    """Return a scan of a mine with a person and a vehicle, which the scanner keeps away from."""
    person, vehicle, heading = _things(network, rng)
    way = network.way_m
    away = [np.linalg.norm(way - thing, axis=1) > far for thing, far in zip((vehicle, person), _AWAY_M, strict=True)]
    return scan_of(truth, way[away[0] & away[1]], rng, per_m2, things=(person, vehicle, heading), noise_m=noise_m)


def found_again(points_m: np.ndarray) -> ScannedVolume:
    """Return the volume of a scan as the command finds it."""
    fine = thin(iter([PointBlock(points_m)]), _FINEST_M, len(points_m))
    voxel_m = resolution(fine.points_m, spacing_of(fine.points_m))
    cloud = thin(iter([PointBlock(points_m)]), voxel_m / 2, len(points_m))
    return volume_of_cloud(cloud, voxel_m, _SIMPLIFY_M, MOST_FACETS)


def compare(truth: manifold3d.Manifold, found: ScannedVolume, rng: np.random.Generator) -> dict[str, float]:
    """Return the distances of places of the true surface from the one that was found, RMS, m, and the IoU."""
    mesh = ClosedMesh(found.vertices, found.faces.astype(np.int32), 0.0)
    volume, wanted = volume_of_solid(mesh, 0.36), mesh_of(truth)
    corners = wanted.vertices[wanted.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    facet = rng.choice(len(area), _SAMPLES, p=area / area.sum())
    places = np.einsum("ki,kij->kj", rng.dirichlet(np.ones(3), _SAMPLES), corners[facet])
    off = Inside(volume).distance_m(places)
    floor = normal[facet, 2] < -0.9 * area[facet]
    rms = {
        name: round(float(np.sqrt((off[some] ** 2).mean())), 4)
        for name, some in (("floor_m", floor), ("wall_m", ~floor))
    }
    both, either = (truth ^ volume.solid).volume(), (truth + volume.solid).volume()
    return rms | {"iou": round(both / either, 5)}


def judge(seed: int, noise_m: float = NOISE_M) -> dict[str, Any]:
    """Scan one mine, find it again, and return the figures."""
    rng = np.random.default_rng(seed)
    kind, truth = truth_of(seed)
    per_m2 = float(np.exp(rng.uniform(*np.log(_DENSITY))))
    network = network_of_floors(mesh_of(truth))
    scan = scan_mine(truth, network, rng, per_m2, noise_m)
    start = time.perf_counter()
    row: dict[str, Any] = {"seed": seed, "kind": kind, "per_m2": round(per_m2), "points": len(scan.points_m)}
    try:
        found = found_again(scan.points_m)
        row |= {"seconds": round(time.perf_counter() - start, 1), "facets": len(found.faces)}
        row |= compare(truth, found, rng)
        places = np.array([thing.middle_m for thing in found.things]).reshape(-1, 3)
        near = [
            len(places) and np.linalg.norm(places[:, :2] - thing[:2], axis=1).min() < 1.0 for thing in scan.things_m
        ]
        again = network_of_floors(ClosedMesh(found.vertices, found.faces.astype(np.int32), 0.0))
    except MineError as error:
        return row | {"problem": str(error)}
    return row | {"things": int(sum(map(bool, near))), "network": network.counts, "found": again.counts}


def holds(row: dict[str, Any]) -> bool:
    """Return whether a scan has all figures that are wanted."""
    return (
        "found" in row
        and row["floor_m"] <= _FLOOR_M
        and row["wall_m"] <= _WALL_M
        and row["iou"] >= _IOU
        and list(row["network"]) == list(row["found"])
    )


def table_of(rows: list[dict[str, Any]]) -> str:
    """Return the results by kind of mine as Markdown: the worst of each."""
    lines = []
    for kind in (*sorted({row["kind"] for row in rows}), None):
        some = [row for row in rows if kind in (None, row["kind"])]
        done = [row for row in some if "found" in row]
        if not done:
            continue
        equal = sum(list(row["network"]) == list(row["found"]) for row in done)
        worst = [f"{100 * max(row[key] for row in done):.1f}" for key in ("floor_m", "wall_m")]
        iou, things = min(row["iou"] for row in done), sum(row["things"] for row in done)
        lines.append(
            (
                kind or "all",
                len(some),
                sum(map(holds, some)),
                *worst,
                f"{iou:.3f}",
                f"{equal} of {len(some)}",
                f"{things} of {2 * len(some)}",
            )
        )
    return markdown_table(_COLUMNS, lines)


def main() -> int:
    """Judge the scans that have no result yet; exit code 2 if one does not hold."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks scans", description=__doc__)
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--noise", type=float, default=NOISE_M, metavar="M", help="of the ranges, m (0.02)")
    arguments = parser.parse_args()
    noise_m, results = arguments.noise, RESULTS
    if noise_m != NOISE_M:
        results = RESULTS.with_stem(f"{RESULTS.stem}-{1e3 * noise_m:g}mm")
    rows = resume(results, range(arguments.seeds), partial(map, partial(judge, noise_m=noise_m)), "scan")
    text = table_of(rows)
    if noise_m == NOISE_M:
        write_table(TABLE, text)
    print(text)
    failed = [row for row in sorted(rows, key=lambda r: r["seed"]) if not holds(row)]
    for row in failed:
        print(row)
    return 2 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
