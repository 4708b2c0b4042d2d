"""What the report shows of a world that is one volume, in place of a plan."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np

from minexplore.bundle import CELLS, TOPOLOGY, VOLUME
from minexplore.floors.volume_arrays import FloorSpans, VolumeFacets
from pipeline.errors import first_few
from pipeline.params.validation import ValidationParams
from pipeline.proof.groups import applying_limits
from pipeline.report.figures.mine import to_svg
from pipeline.report.figures.scene import walked_page
from pipeline.report.figures.volume import draw_floors, draw_section, facet_scene
from pipeline.report.page import WorldView
from pipeline.report.results import read_metrics
from pipeline.store.codecs import decode
from pipeline.store.manifest import read_params
from pipeline.types import ClosedMesh, SurveyedLegs, lines_of
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.proof.certificate import read_volume_record
from pipeline.volume.world.record import VolumeRecord
from pipeline.volume.world.topology import LegNetwork

_NAMED = 10  # stations that the page lists


def volume_view(root: Path) -> WorldView:
    """Return what the report of a volume world shows.

    Raises
    ------
    ArtifactError
        If an artifact is missing or broken; the message names it.
    """
    bundle = root / "realism" / "world"
    record = read_volume_record(bundle)
    legs: LegNetwork = decode(bundle / TOPOLOGY, LegNetwork)
    cells: FloorSpans = decode(bundle / CELLS, FloorSpans)
    volume: VolumeFacets = decode(bundle / VOLUME, VolumeFacets)
    surveyed: SurveyedLegs = decode(root / "survey/network.npz", SurveyedLegs)
    params = read_params(root / "validation/manifest.json", ValidationParams)
    datum_m = record.volume.datum_m
    ends = np.array([[legs.stations_m[leg.start], legs.stations_m[leg.end]] for leg in legs.legs])
    lrud = np.array([leg.lrud_m for leg in legs.legs])
    floors, roofs = ends.copy(), ends.copy()
    floors[:, :, 2] -= lrud[:, :, 3]
    roofs[:, :, 2] += lrud[:, :, 2]
    plan = draw_floors(cells.places_m, cells.cell_m, list(ends), record.spawn.anchor_m, datum_m)
    section = to_svg(draw_section(floors, roofs, datum_m))
    middle = (volume.vertices.min(axis=0) + volume.vertices.max(axis=0)) / 2
    scan = _deviation(volume, decode(root / "survey/solid.npz", ClosedMesh))
    way = longest_way(legs) - middle
    scene = walked_page(facet_scene(volume.vertices, volume.faces, volume.label, scan), way)
    return WorldView(
        record=record,
        plan=plan,
        scene=scene,
        limits=applying_limits(params, read_metrics(root / "validation")),
        volume=_built_of(record, surveyed) | {"section": section[section.index(b"<svg") :].decode()},
    )


def _deviation(volume: VolumeFacets, solid: ClosedMesh) -> tuple[np.ndarray, np.ndarray] | None:
    """Return points (n, 3) m of the scan that a volume was made from, and how far they are from it (n,) m."""
    if not len(solid.scan_m):
        return None
    from pipeline.volume.world.proof.scan import measure_scan  # open3d takes a second to load

    found = measure_scan(closed_volume(volume), solid.scan_m, np.random.default_rng(0))
    return found.points_m, found.off_m


def _built_of(record: VolumeRecord, surveyed: SurveyedLegs) -> dict[str, Any]:
    """Return what was built of the survey, as the page's table has it."""
    figures = record.volume
    return {
        "surveyed_m": figures.surveyed_m,
        "piece_m": figures.piece_m,
        "built_m": figures.built_m,
        "low_m": figures.low_m + figures.datum_m,
        "high_m": figures.high_m + figures.datum_m,
        "entrances": first_few([end.station for end in figures.entrances], _NAMED),
        "closed_ends": first_few([end.station for end in figures.closed_ends], _NAMED),
        "others": first_few(
            [f"{m:,.0f} m about {name}" for name, m in zip(lines_of(surveyed.pieces), surveyed.pieces_m, strict=True)],
            _NAMED,
        ),
    }


def longest_way(legs: LegNetwork) -> np.ndarray:
    """Return places (n, 3) m, one a metre, on the floors of a long way through the mine, for the headlamp."""
    graph: nx.Graph = nx.Graph()
    for leg in legs.legs:
        graph.add_edge(leg.start, leg.end, length=leg.length_m)
    one = other = legs.legs[0].start
    for _ in range(2):
        far = nx.single_source_dijkstra_path_length(graph, other, weight="length")
        one, other = other, max(far, key=lambda name: (far[name], name))
    way: list[str] = nx.dijkstra_path(graph, one, other, weight="length")
    down = {name: 0.0 for name in legs.stations_m}
    for leg in legs.legs:
        down |= {leg.start: leg.lrud_m[0][3], leg.end: leg.lrud_m[1][3]}
    floor = np.array([np.array(legs.stations_m[name]) - [0, 0, down[name]] for name in way])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(floor, axis=0), axis=1))])
    at = np.linspace(0, along[-1], max(2, round(along[-1]) + 1))
    return np.column_stack([np.interp(at, along, floor[:, k]) for k in range(3)])
