"""What the report shows of a world that is one volume, in place of a plan."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import trimesh

from minesurveys.errors import first_few
from minesurveys.frames import Source
from minexplore.bundle import CELLS, TOPOLOGY, VOLUME
from minexplore.floors.volume_arrays import FloorSpans, VolumeFacets
from pipeline.params.compile3d import Compile3dParams
from pipeline.params.validation import ValidationParams
from pipeline.proof.groups import applying_limits
from pipeline.report.chart import ELEVATION, KNOWN_MODES, Chart, ChartGrid, ChartStation
from pipeline.report.figures.known import facets_by_known
from pipeline.report.figures.legs import DrawnLegs, quads_from_above, section_chart
from pipeline.report.figures.scene import walked_page
from pipeline.report.figures.volume import draw_floors, facet_scene, floor_picture
from pipeline.report.page import LegRow, WorldView
from pipeline.report.results import read_metrics
from pipeline.store.codecs import decode
from pipeline.store.manifest import read_params
from pipeline.store.mine_survey import MineSurvey
from pipeline.types import ClosedMesh, SurveyedLegs, lines_of
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.proof.certificate import read_volume_record
from pipeline.volume.world.record import VolumeRecord
from pipeline.volume.world.topology import LegNetwork, LegRecord, mine_network


def volume_view(root: Path, mine: MineSurvey) -> WorldView:
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
    params = read_params(root / "validation/manifest.json", ValidationParams)
    datum_m = record.volume.datum_m
    ends = np.array([[legs.stations_m[leg.start], legs.stations_m[leg.end]] for leg in legs.legs])
    place, grid = mine.survey.georeference, ChartGrid.of(mine.survey.georeference)
    plan = draw_floors(cells.places_m, cells.cell_m, list(ends), record.spawn.anchor_m, datum_m, place)
    surveyed = mine.shape if isinstance(mine.shape, SurveyedLegs) else None
    scanned = mine.shape if isinstance(mine.shape, ClosedMesh) and len(mine.shape.scan_m) else None
    drawn = _drawn_legs(root, legs, surveyed)
    section, bearing = section_chart(drawn, datum_m, grid)
    middle = (volume.vertices.min(axis=0) + volume.vertices.max(axis=0)) / 2
    scan = None if scanned is None else _deviation(volume, scanned)
    way = longest_way(legs) - middle
    scene = walked_page(_scene(volume, scan, drawn), way)
    return WorldView(
        record=record,
        plan=plan,
        scene=scene,
        limits=applying_limits(params, read_metrics(root / "validation")),
        chart=_map(cells, drawn, record, grid),
        width=None if surveyed is None else _width(drawn),
        legs=[_leg_row(leg, known) for leg, known in zip(legs.legs, drawn.known, strict=True) if drawn.is_surveyed],
        loops=legs.loops,
        dead_ends=len(legs.dead_ends),
        volume=_built_of(record, surveyed)
        | {
            "section": section,
            "bearing": bearing,
            "shares": drawn.shares() if drawn.is_surveyed else None,
            "made_of": "scan" if scanned else "solid" if isinstance(mine.shape, ClosedMesh) else "drawing",
        },
    )


def _drawn_legs(root: Path, legs: LegNetwork, surveyed: SurveyedLegs | None) -> DrawnLegs:
    """Return the legs of a world; those that are not `surveyed` follow its floors, and are known by these."""
    ends = np.array([[legs.stations_m[leg.start], legs.stations_m[leg.end]] for leg in legs.legs])
    names = [(leg.start, leg.end) for leg in legs.legs]
    lrud = np.array([leg.lrud_m for leg in legs.legs])
    if surveyed is None:
        step = np.diff(ends, axis=1)[:, :, :2]
        left = step[:, :, ::-1] * [-1.0, 1.0] / np.maximum(np.linalg.norm(step, axis=2, keepdims=True), 1e-9)
        return DrawnLegs(names, ends, np.repeat(left, 2, axis=1), lrud, np.zeros(lrud.shape, np.uint8), False)
    params = read_params(root / "compile3d/manifest.json", Compile3dParams)
    network, _ = mine_network(surveyed, params.height_m, params.volume)
    places = lines_of(surveyed.names)
    unnamed = frozenset(places[k] for k in np.flatnonzero(surveyed.between).tolist())
    return DrawnLegs(names, ends, network.across, lrud, network.known, unnamed=unnamed)


def _scene(volume: VolumeFacets, scan: tuple[np.ndarray, np.ndarray] | None, drawn: DrawnLegs) -> trimesh.Scene:
    corners = volume.vertices[volume.faces]
    known = facets_by_known(corners, volume.label, volume.leg, drawn) if drawn.is_surveyed else None
    return facet_scene(volume.vertices, volume.faces, volume.label, scan, known)


def _map(cells: FloorSpans, drawn: DrawnLegs, record: VolumeRecord, grid: ChartGrid) -> Chart:
    """Return the map: floors by elevation, and legs by how they are known."""
    datum_m = record.volume.datum_m
    quads = quads_from_above(drawn) if drawn.is_surveyed else []
    corners = np.array([quad[:8] for quad in quads]).reshape(-1, 2)
    places = np.concatenate([cells.places_m[:, :2], drawn.ends_m.reshape(-1, 3)[:, :2], corners])
    (west, south), (east, north) = places.min(axis=0).tolist(), places.max(axis=0).tolist()
    x, y, _ = record.spawn.anchor_m
    return Chart(
        (west, south, east, north),
        (ELEVATION, *KNOWN_MODES) if drawn.is_surveyed else (ELEVATION,),
        quads,
        drawn.ends_m[:, :, :2].reshape(-1, 4).round(2).tolist(),
        stations=[
            ChartStation(name, float(at[0]), float(at[1]), text, int(count != 2))
            for name, (at, text, count) in drawn.stations(grid, datum_m).items()
            if drawn.is_surveyed or count != 2
        ],
        grid=grid,
        start=(x, y),
        picture=floor_picture(cells.places_m, cells.cell_m),
    )


def _width(drawn: DrawnLegs) -> tuple[str, str]:
    """Return the headline's width and what it is of: the stations where both walls were measured."""
    widths, count = drawn.widths_m()
    if not len(widths):
        taken = np.median(drawn.lrud_m[:, :, :2].sum(axis=2))
        return "not measured", f"width: at none of {count} stations are both walls measured; {taken:.2f} m are assumed"
    low, middle, high = np.quantile(widths, [0.05, 0.5, 0.95])
    return f"{middle:.2f} m", (
        f"typical width ({low:.2f} to {high:.2f} m) where both walls are measured: at {len(widths)} of {count} "
        f"stations ({100 * len(widths) / count:.0f} %)"
    )


def _leg_row(leg: LegRecord, known: np.ndarray) -> LegRow:
    """Return a row of the page's table of legs."""
    words = [
        ", ".join(
            f"{100 * float((part == how).mean()):.0f} % {how.name.lower()}"
            for how in reversed(Source)
            if (part == how).any()
        )
        for part in (known[:, :2], known[:, 2], known[:, 3])
    ]
    width = " to ".join(f"{sum(section[:2]):.2f}" for section in leg.lrud_m)
    height = " to ".join(f"{sum(section[2:]):.2f}" for section in leg.lrud_m)
    return LegRow(leg.start, leg.end, leg.length_m, width, height, words)


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
