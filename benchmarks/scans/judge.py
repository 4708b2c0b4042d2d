"""Scan mines whose volume is known, find the volume again, and measure how far it is from the truth.

The scans have 20 to 2,000 points a square metre with noise of 2 cm, shadows, a hole of half a metre, and a person and
a vehicle in them.
"""

from __future__ import annotations

import sys
import time

import manifold3d
import numpy as np

from benchmarks.judged_cases import JudgedCases, largest, least
from benchmarks.results import Row
from benchmarks.scans.sample import Scan, scan_of
from benchmarks.scans.truth import FloorNetwork, mesh_of, network_of_floors, truth_of
from minesurveys.clouds.point_blocks import PointBlock
from pipeline.errors import MineError
from pipeline.survey.clouds.thinned import spacing_of, thin
from pipeline.survey.clouds.volume import ScannedVolume, volume_of_cloud
from pipeline.survey.detection.cloud import resolution
from pipeline.survey.solids.read import MOST_FACETS
from pipeline.types import ClosedMesh
from pipeline.volume.world.solid import volume_of_solid

_FLOOR_M, _WALL_M, _IOU = 0.03, 0.05, 0.97  # wanted
_DENSITY = (20.0, 2000.0)  # points a m2
_FINEST_M = 0.025  # as `detect_cloud` reads a small file
_SIMPLIFY_M = 0.03  # the command's own
_SAMPLES = 200_000
_CLEAR_M, _APART_M = 2.0, 8.0  # beside a vehicle, and between it and the person
_AWAY_M = (3.2, 1.0)  # of the scanner from the vehicle, from the person


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
) -> Scan:
    """Return a scan of a mine with a person and a vehicle, which the scanner keeps away from."""
    person, vehicle, heading = _things(network, rng)
    way = network.way_m
    away = [np.linalg.norm(way - thing, axis=1) > far for thing, far in zip((vehicle, person), _AWAY_M, strict=True)]
    return scan_of(truth, way[away[0] & away[1]], rng, per_m2, things=(person, vehicle, heading))


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
    off = volume.inside.distance_m(places)
    floor = normal[facet, 2] < -0.9 * area[facet]
    rms = {
        name: round(float(np.sqrt((off[some] ** 2).mean())), 4)
        for name, some in (("floor_m", floor), ("wall_m", ~floor))
    }
    both, either = (truth ^ volume.solid).volume(), (truth + volume.solid).volume()
    return rms | {"iou": round(both / either, 5)}


def judge(seed: int) -> Row:
    """Scan one mine, find it again, and return the figures."""
    rng = np.random.default_rng(seed)
    kind, truth = truth_of(seed)
    per_m2 = float(np.exp(rng.uniform(*np.log(_DENSITY))))
    network = network_of_floors(mesh_of(truth))
    scan = scan_mine(truth, network, rng, per_m2)
    start = time.perf_counter()
    row: Row = {"kind": kind, "per_m2": round(per_m2), "points": len(scan.points_m)}
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


def holds(row: Row) -> bool:
    """Return whether a scan has all figures that are wanted."""
    return (
        "found" in row
        and row["floor_m"] <= _FLOOR_M
        and row["wall_m"] <= _WALL_M
        and row["iou"] >= _IOU
        and is_same_network(row)
    )


def is_same_network(row: Row) -> bool:
    """Return whether the network was found with the truth's counts."""
    return "found" in row and list(row["network"]) == list(row["found"])


SCANS = JudgedCases(
    name="scans",
    cases=range(1000),
    sample=16,
    judge=judge,
    holds=holds,
    groups=lambda row: [row["kind"]],
    of="mine",
    columns={
        "scans": len,
        "hold": lambda rows: sum(map(holds, rows)),
        "floor, cm RMS": largest("floor_m", ".1f", 100.0),
        "walls, cm RMS": largest("wall_m", ".1f", 100.0),
        "lowest IoU": least("iou", ".3f"),
        "network equal": lambda rows: f"{sum(map(is_same_network, rows))} of {len(rows)}",
        "things found": lambda rows: f"{sum(row.get('things', 0) for row in rows)} of {2 * len(rows)}",
    },
)

if __name__ == "__main__":
    sys.exit(SCANS.run(__doc__))
