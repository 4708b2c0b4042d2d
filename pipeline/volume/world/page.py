"""What the report shows of a world that is one volume, in place of a plan."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np

from minesurveys.errors import first_few
from minesurveys.frames import Source
from minexplore.bundle import CELLS, TOPOLOGY, VOLUME
from minexplore.floors.volume_arrays import FloorSpans, VolumeFacets
from pipeline.params.compile3d import Compile3dParams
from pipeline.params.validation import ValidationParams
from pipeline.proof.groups import applying_limits
from pipeline.report.chart import ELEVATION, KNOWN_MODES, Chart, ChartGrid, ChartStation
from pipeline.report.figures.scene import walked_page
from pipeline.report.figures.volume import draw_floors, facet_scene, floor_picture
from pipeline.report.page import LegRow, WorldView
from pipeline.report.results import read_metrics
from pipeline.store.codecs import decode
from pipeline.store.manifest import read_params
from pipeline.store.mine_survey import MineSurvey
from pipeline.types import ClosedMesh, SurveyedLegs, lines_of
from pipeline.volume.leg_charts import (
    ShownStations,
    facets_by_known,
    measured_widths_m,
    quads_from_above,
    section_chart,
    shares_known,
    shown_stations,
)
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.proof.alone import stated_legs
from pipeline.volume.world.proof.certificate import read_volume_record
from pipeline.volume.world.record import VolumeRecord
from pipeline.volume.world.topology import LegNetwork, Place, mine_network


def volume_view(root: Path, mine: MineSurvey) -> WorldView:
    """Return what the report of a volume world shows.

    Raises
    ------
    ArtifactError
        If an artifact is missing or broken; the message names it.
    """
    bundle = root / "realism" / "world"
    record = read_volume_record(bundle)
    cells: FloorSpans = decode(bundle / CELLS, FloorSpans)
    volume: VolumeFacets = decode(bundle / VOLUME, VolumeFacets)
    params = read_params(root / "validation/manifest.json", ValidationParams)
    datum_m = record.volume.datum_m
    surveyed = mine.shape if isinstance(mine.shape, SurveyedLegs) else None
    is_surveyed = surveyed is not None
    network = _network(root, surveyed or stated_legs(decode(bundle / TOPOLOGY, LegNetwork)))
    names = lines_of(surveyed.names) if surveyed else []
    unnamed = {names[k] for k in np.flatnonzero(surveyed.between).tolist()} if surveyed else set[str]()
    place, grid = mine.survey.georeference, ChartGrid.of(mine.survey.georeference)
    stations = shown_stations(network, datum_m, grid, unnamed, is_surveyed)
    plan = draw_floors(cells.places_m, cells.cell_m, list(network.ends_m), record.spawn.anchor_m, datum_m, place)
    section, bearing = section_chart(network, datum_m, stations, is_surveyed)
    quads = quads_from_above(network) if is_surveyed else []
    chart = _map(cells, network, quads, stations, grid, record.spawn.anchor_m)
    corners = volume.vertices[volume.faces]
    known = facets_by_known(corners, volume.label, volume.leg, network) if is_surveyed else None
    scanned = mine.shape if isinstance(mine.shape, ClosedMesh) and len(mine.shape.scan_m) else None
    scan = None if scanned is None else _deviation(volume, scanned)
    scene = facet_scene(volume.vertices, volume.faces, volume.label, scan, known)
    middle = (volume.vertices.min(axis=0) + volume.vertices.max(axis=0)) / 2
    return WorldView(
        record=record,
        plan=plan,
        scene=walked_page(scene, longest_way(network) - middle),
        limits=applying_limits(params, read_metrics(root / "validation")),
        chart=chart,
        width=_width(network, unnamed) if is_surveyed else None,
        legs=_leg_rows(network) if is_surveyed else [],
        loops=record.loops,
        dead_ends=int((np.bincount(network.shots.ravel()) == 1).sum()),
        volume=_built_of(record, surveyed)
        | {
            "section": section,
            "bearing": bearing,
            "shares": shares_known(network) if is_surveyed else None,
            "made_of": "scan" if scanned else "solid" if isinstance(mine.shape, ClosedMesh) else "drawing",
        },
    )


def _network(root: Path, surveyed: SurveyedLegs) -> SurveyNetwork:
    """Return the network of a survey in the mine frame, as stage 3 had it."""
    params = read_params(root / "compile3d/manifest.json", Compile3dParams)
    network, offset = mine_network(surveyed, params.height_m, params.volume)
    return replace(network, places_m=network.places_m + offset)


def _map(
    cells: FloorSpans,
    network: SurveyNetwork,
    quads: list[list[float]],
    stations: ShownStations,
    grid: ChartGrid,
    start_m: Place,
) -> Chart:
    """Return the map: floors by elevation, and surveyed legs, which have quads, by how they are known."""
    corners = np.array([quad[:8] for quad in quads]).reshape(-1, 2)
    places = np.concatenate([cells.places_m[:, :2], network.ends_m.reshape(-1, 3)[:, :2], corners])
    (west, south), (east, north) = places.min(axis=0).tolist(), places.max(axis=0).tolist()
    return Chart(
        (west, south, east, north),
        (ELEVATION, *KNOWN_MODES) if quads else (ELEVATION,),
        quads,
        network.ends_m[:, :, :2].reshape(-1, 4).round(2).tolist(),
        stations=[
            ChartStation(name, float(at[0]), float(at[1]), text, int(count != 2))
            for name, (at, text, count) in stations.items()
        ],
        grid=grid,
        start=start_m[:2],
        picture=floor_picture(cells.places_m, cells.cell_m),
    )


def _width(network: SurveyNetwork, unnamed: set[str]) -> tuple[str, str]:
    """Return the headline's width and what it is of: the stations where both walls were measured."""
    widths, count = measured_widths_m(network, unnamed)
    if not len(widths):
        taken = np.median(network.lrud_m[:, :, :2].sum(axis=2))
        return "not measured", f"width: at none of {count} stations are both walls measured; {taken:.2f} m are assumed"
    low, middle, high = np.quantile(widths, [0.05, 0.5, 0.95])
    return f"{middle:.2f} m", (
        f"typical width ({low:.2f} to {high:.2f} m) where both walls are measured: at {len(widths)} of {count} "
        f"stations ({100 * len(widths) / count:.0f} %)"
    )


def _leg_rows(network: SurveyNetwork) -> list[LegRow]:
    """Return the rows of the page's table of legs."""
    rows = []
    for pair, length_m, lrud, known in zip(
        network.shots, network.lengths_m.tolist(), network.lrud_m, network.known, strict=True
    ):
        words = [
            ", ".join(
                f"{100 * float((part == how).mean()):.0f} % {how.name.lower()}"
                for how in reversed(Source)
                if (part == how).any()
            )
            for part in (known[:, :2], known[:, 2], known[:, 3])
        ]
        width, height = (" to ".join(f"{size:.2f}" for size in part.sum(axis=1)) for part in (lrud[:, :2], lrud[:, 2:]))
        start, end = (network.names[k] for k in pair)
        rows.append(LegRow(start, end, length_m, width, height, words))
    return rows


def _deviation(volume: VolumeFacets, solid: ClosedMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return points (n, 3) m of the scan that a volume was made from, and how far they are from it (n,) m."""
    from pipeline.volume.world.proof.scan import measure_scan  # open3d takes a second to load

    found = measure_scan(closed_volume(volume), solid.scan_m, np.random.default_rng(0))
    return found.points_m, found.off_m


def _built_of(record: VolumeRecord, surveyed: SurveyedLegs | None) -> dict[str, Any]:
    """Return what was built of the survey, as the page's table has it."""
    figures = record.volume
    pieces = [] if surveyed is None else zip(lines_of(surveyed.pieces), surveyed.pieces_m, strict=True)
    return {
        "surveyed_m": figures.surveyed_m,
        "piece_m": figures.piece_m,
        "built_m": figures.built_m,
        "low_m": figures.low_m + figures.datum_m,
        "high_m": figures.high_m + figures.datum_m,
        "entrances": [end.station for end in figures.entrances],
        "closed_ends": [end.station for end in figures.closed_ends],
        "others": first_few([f"{m:,.0f} m about {name}" for name, m in pieces]),
    }


def longest_way(network: SurveyNetwork) -> np.ndarray:
    """Return places (n, 3) m, one a metre, on the floors of a long way through the mine, for the headlamp."""
    graph: nx.Graph = nx.Graph()
    graph.add_weighted_edges_from(zip(*network.shots.T.tolist(), network.lengths_m.tolist(), strict=True))
    one = other = int(network.shots[0, 0])
    for _ in range(2):
        far = nx.single_source_dijkstra_path_length(graph, other)
        one, other = other, max(far, key=lambda station: (far[station], station))
    floors = network.places_m.copy()
    floors[network.shots] = network.floors_m
    floor = floors[nx.dijkstra_path(graph, one, other)]
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(floor, axis=0), axis=1))])
    at = np.linspace(0, along[-1], max(2, round(along[-1]) + 1))
    return np.column_stack([np.interp(at, along, floor[:, k]) for k in range(3)])
