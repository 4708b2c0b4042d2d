"""Mines whose volume is known: level ones of random plans, and random declines, seams and levels with heights."""

from __future__ import annotations

import json
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import manifold3d
import networkx as nx
import numpy as np
import shapely

from benchmarks.comparisons.volume.cases import GateCase
from benchmarks.worlds.random_levels import random_legs
from minexplore.bundle import TOPOLOGY
from minexplore.splits import STYLES
from pipeline.compose import compose
from pipeline.geometry.generated.generate import generate_workings
from pipeline.params.compile3d import Compile3dParams
from pipeline.types import ClosedMesh
from pipeline.volume.floors import solve_floors
from pipeline.volume.world.compile import compile_volume
from tests.heights import table

_HEIGHT_M = 3.2  # of level mines
_SIZE_M, _WIDTH_M, _RIB_M, _PILLAR_M, _SPACING_M = (40.0, 70.0), (4.0, 6.0), 0.15, 8.0, 24.0  # of their plans
_FLAT_M = 0.001  # of facets that are one, or nearly
_OVER_M = 1.3  # of the scanner over the floor
_VEHICLE_M = 3.5  # from the end of a drift to the middle of a vehicle
_STUB_M = 3.5  # beyond the half width at a junction: a shorter way from it to a dead end is the corner of a room


@dataclass(frozen=True)
class FloorNetwork:
    """The stations (n, 3) m on the floors of a volume, the drifts' headings (n,) and half widths (n,) m there.

    `counts` are the dead ends, the loops and the components of the network; corners of rooms are no ends.
    """

    floors_m: np.ndarray
    heading_deg: np.ndarray
    half_m: np.ndarray
    counts: tuple[int, int, int]

    @property
    def way_m(self) -> np.ndarray:
        """Return the places (n, 3) m of a scanner that is carried along all drifts."""
        return self.floors_m + np.array([0, 0, _OVER_M])


def truth_of(seed: int) -> tuple[str, manifold3d.Manifold]:
    """Return what a mine is, by turns level and with heights, and its volume."""
    if seed % 2:
        kind, legs = random_legs(seed // 2)
        legs.pop("shaft", None)  # no robot drives in it, and the network is of floors
        with tempfile.TemporaryDirectory() as folder:
            network = GateCase(kind, table(legs)).network(Path(folder))
        return kind, solve_floors(network).solid
    style, rng = STYLES[seed // 2 % len(STYLES)], np.random.default_rng(seed)
    workings = generate_workings(style, rng, _SIZE_M, _WIDTH_M, 0.5, 0.3, _RIB_M, _PILLAR_M, _SPACING_M, 0.5)
    plan = max(shapely.get_parts(workings), key=lambda part: part.area).simplify(0.05)
    rings = [np.asarray(ring.coords)[:-1] for ring in (plan.exterior, *plan.interiors)]
    section = manifold3d.CrossSection(rings, manifold3d.FillRule.EvenOdd)
    return f"level {style.replace('_', ' ')}", section.extrude(_HEIGHT_M)


def mesh_of(solid: manifold3d.Manifold) -> ClosedMesh:
    """Return the mesh of a solid, without facets that its shape does not need."""
    mesh = solid.simplify(_FLAT_M).to_mesh64()
    vertices, faces = np.array(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int32)
    return ClosedMesh(vertices, faces, 0.0)


def network_of_floors(mesh: ClosedMesh) -> FloorNetwork:
    """Return the network along the floors of a volume, as stage 3 finds it."""
    found = json.loads(compile_volume(_params(), mesh)[TOPOLOGY])
    stations = {name: np.array(place) for name, place in found["stations_m"].items()}
    floors, heading, half = {}, {}, {}
    for leg in found["legs"]:
        along = stations[leg["end"]] - stations[leg["start"]]
        for name, (left, right, _, down) in zip((leg["start"], leg["end"]), leg["lrud_m"], strict=True):
            floors[name] = stations[name] - [0, 0, down]
            heading[name], half[name] = np.degrees(np.arctan2(along[1], along[0])), min(left, right)
    names = list(floors)
    counts = _long_ends(found, half), found["loops"], found["components"]
    for end in found["dead_ends"]:  # a vehicle would stand in the last wall
        half |= {name: 0.0 for name in names if np.linalg.norm(stations[name] - stations[end]) < _VEHICLE_M}
    return FloorNetwork(
        np.array([floors[name] for name in names]),
        np.array([heading[name] for name in names]),
        np.array([half[name] for name in names]),
        counts,
    )


@cache
def _params() -> Compile3dParams:
    return compose(["preset=light"]).compile3d


def _long_ends(found: dict[str, Any], half: dict[str, float]) -> int:
    """Return how many dead ends remain once shorter stubs are cut off."""
    graph: nx.MultiGraph = nx.MultiGraph()
    for leg in found["legs"]:
        graph.add_edge(leg["start"], leg["end"], length=leg["length_m"])
    while True:
        ends = [node for node, degree in graph.degree() if degree == 1]
        stubs = [way for way in (_stub(graph, end, half) for end in ends) if way is not None]
        if not stubs:
            return len(ends)
        graph.remove_nodes_from(min(stubs, key=lambda way: way[0])[1])


def _stub(graph: nx.MultiGraph, end: str, half: dict[str, float]) -> tuple[float, list[str]] | None:
    """Return the length and the nodes of the way from a dead end to a junction, None if it is long or has none."""
    way, length, before = [end], 0.0, ""
    while length < _STUB_M + max(half.values()):
        near = [node for node in graph.neighbors(way[-1]) if node != before]
        if not near:
            return None
        length += min(edge["length"] for edge in graph.get_edge_data(way[-1], near[0]).values())
        if graph.degree(near[0]) > 2:
            return (length, way) if length < _STUB_M + half[near[0]] else None
        before = way[-1]
        way.append(near[0])
    return None
