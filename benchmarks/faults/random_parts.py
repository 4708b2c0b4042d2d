"""Random faults in the collision parts of a volume world; each must break a clause of the certificate, or be harmless.

`python -m benchmarks.faults.random_parts BUNDLE --count 300`. What is changed at random: a cube of 1 cm3 or a plate of
0.3 mm more anywhere in the free space, a hole of 5 cm through a part, a part left out, moved 1 cm into the free space,
or 1 cm thick. A fault is harmless if all figures stay within their limits, as a hole behind a facet that is narrower
than the limit on gaps. Files are not changed, so that these clauses alone decide: `certify` refuses such a bundle
first, as its model is no longer that of its parts.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import manifold3d
import numpy as np
from tqdm import tqdm

from minexplore.floors.volume_arrays import FacetLabel, FloorSpans, Parts
from pipeline.commands.proofs import limits_of_kind
from pipeline.export.scene import box_corners
from pipeline.mjcf.bundle import read_made_by
from pipeline.volume.enclosure import measure_enclosure
from pipeline.volume.rock.faces import ON_PLANE_M, across
from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Volume
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.parts import collect_labelled
from pipeline.volume.world.proof.certificate import open_volume
from pipeline.volume.world.proof.fronts import Fronts, fronts_of

_CUBE_M, _PLATE_M, _HOLE_M, _SHIFT_M, _THIN_M = 0.01, (0.5, 0.5, 0.0003), 0.05, 0.01, 0.01
_CLAUSES = ("intrusion_mm", "gap_mm", "thin_mm", "unbacked")
Fault = Callable[["_World", np.random.Generator], list[np.ndarray]]


class _World:
    """A volume's parts, its cells, and the faces of its parts."""

    def __init__(self, volume: Volume, parts: Parts, cells: FloorSpans) -> None:
        self.volume, self.cells = volume, cells
        self.corners = [parts[k] for k in range(len(parts))]
        self.fronts: Fronts = fronts_of(volume, parts)

    def place(self, rng: np.random.Generator) -> np.ndarray:
        """Return a place (3,) m in the free space, at any height over some floor."""
        k = int(rng.integers(len(self.cells.places_m)))
        place = self.cells.places_m[k].copy()
        place[2] += rng.uniform(0, max(float(self.cells.headroom_m[k]) - _CUBE_M, 0.0)) + _CUBE_M / 2
        return place

    def part(self, rng: np.random.Generator) -> tuple[int, ShellPart]:
        """Return a part, drawn by the area of its face."""
        area = np.array([part.area_m2 for part in self.fronts.parts])
        k = int(rng.choice(len(area), p=area / area.sum()))
        return k, self.fronts.parts[k]

    def into_rock(self, part: ShellPart) -> np.ndarray:
        """Return the unit vector (3,) from a part's facet into the rock."""
        normal = self.volume.normals[part.facets[0]]
        return np.asarray(normal / np.linalg.norm(normal))

    def but(self, number: int, *instead: np.ndarray) -> list[np.ndarray]:
        """Return the corners of all parts but one, and some instead of it."""
        return [*self.corners[:number], *instead, *self.corners[number + 1 :]]


def _added(half_m: np.ndarray) -> Fault:
    def fault(world: _World, rng: np.random.Generator) -> list[np.ndarray]:
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        return [*world.corners, world.place(rng) + box_corners(half_m) @ turn]

    return fault


def _hole(world: _World, rng: np.random.Generator) -> list[np.ndarray]:
    """Return the parts with a square hole through one, about a place on its face."""
    number, part = world.part(rng)
    normal = world.into_rock(part)
    corners = world.corners[number]
    depth = corners @ normal
    face = corners[depth < depth.min() + ON_PLANE_M]
    place, ways = rng.dirichlet(np.ones(len(face))) @ face, across(normal[None])[0]
    rest, pieces = manifold3d.Manifold.hull_points(corners), []
    for way in (ways[0], -ways[0], ways[1], -ways[1]):
        level = float(way @ place) + _HOLE_M / 2
        pieces.append(rest.trim_by_plane(way.tolist(), level))
        rest = rest.trim_by_plane((-way).tolist(), -level)
    return world.but(
        number, *(np.asarray(one.to_mesh64().vert_properties)[:, :3] for one in pieces if one.volume() > 0)
    )


def _left_out(world: _World, rng: np.random.Generator) -> list[np.ndarray]:
    return world.but(world.part(rng)[0])


def _moved(world: _World, rng: np.random.Generator) -> list[np.ndarray]:
    number, part = world.part(rng)
    return world.but(number, world.corners[number] - _SHIFT_M * world.into_rock(part))


def _thinned(world: _World, rng: np.random.Generator) -> list[np.ndarray]:
    number, part = world.part(rng)
    normal = world.into_rock(part)
    level = float(normal @ world.volume.vertices[world.volume.faces[part.facets[0], 0]]) + _THIN_M
    body = manifold3d.Manifold.hull_points(world.corners[number]).trim_by_plane((-normal).tolist(), -level)
    return world.but(number, np.asarray(body.to_mesh64().vert_properties)[:, :3])


FAULTS: dict[str, Fault] = {
    "a cube of 1 cm3 more": _added(np.full(3, _CUBE_M / 2)),
    "a plate of 0.3 mm more": _added(np.array(_PLATE_M) / 2),
    "a hole of 5 cm": _hole,
    "a part left out": _left_out,
    "a part moved by 1 cm": _moved,
    "a part of 1 cm": _thinned,
}


def judge(world: _World, limits: dict[str, Any], seed: int) -> tuple[str, str, dict[str, float]]:
    """Return a fault, the clauses that it breaks, and the figures."""
    rng = np.random.default_rng(seed)
    name = list(FAULTS)[seed % len(FAULTS)]
    corners = FAULTS[name](world, rng)
    parts = collect_labelled(corners, [int(FacetLabel.WALL)] * len(corners))
    fronts = fronts_of(world.volume, parts)
    found = measure_enclosure(world.volume, fronts.parts, fronts.faces).figures
    figures = {clause: found[clause] for clause in _CLAUSES}
    broken = [clause for clause, value in figures.items() if not limits[f"enclosure.{clause}"].holds(value)]
    return name, ", ".join(broken), figures


def main() -> int:
    """Judge faults of one world; print how many of each are found, and the figures of those within all limits."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.faults.random_parts", description=__doc__)
    parser.add_argument("bundle", type=Path)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--first-seed", type=int, default=0)
    arguments = parser.parse_args()
    bundle = open_volume(arguments.bundle)
    world = _World(closed_volume(bundle.mine), bundle.parts, bundle.cells)
    limits = limits_of_kind(read_made_by(arguments.bundle).kind, []).volume.limits
    outcomes: Counter[tuple[str, bool]] = Counter()
    for seed in tqdm(range(arguments.first_seed, arguments.first_seed + arguments.count), unit="fault", disable=None):
        name, broken, figures = judge(world, limits, seed)
        outcomes[name, bool(broken)] += 1
        if not broken:
            tqdm.write(f"within limits: {name} (seed {seed}): {figures}")
    for name in FAULTS:
        print(f"{name}: {outcomes[name, True]} found, {outcomes[name, False]} within all limits")
    return 0


if __name__ == "__main__":
    sys.exit(main())
