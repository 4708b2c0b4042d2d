"""Furniture in a volume: along its legs, on its visible rock."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from minexplore.bundle import CELLS, TOPOLOGY
from minexplore.floors.volume_arrays import FloorSpans
from pipeline.mjcf.furniture import LEAST_HEIGHT_M, hang_furniture
from pipeline.params.fittings import FurnitureParams
from pipeline.store.codecs import Bundle, decode
from pipeline.volume.union import STEEPEST
from pipeline.volume.world.drifts.ways import drifts_along, lines_through
from pipeline.volume.world.surface.show import rock_names
from pipeline.volume.world.topology import LegNetwork, LegRecord


def hang_in_volume(params: FurnitureParams, legs: LegNetwork, rough: Bundle, cells: FloorSpans) -> Bundle:
    """Return the furniture's meshes by name as `.msh`, m, mine frame: see `hang_furniture`.

    It follows the drifts of legs that are flat enough to drive on and at least `LEAST_HEIGHT_M` high; pipe and cable go
    straight on through junctions. The duct follows the longest of these lines.
    """
    drifts = drifts_along(legs, is_furnished)
    if not drifts:
        return {}
    through = lines_through(drifts)
    main = max(through, key=lambda line: line.length_m)
    return hang_furniture(
        params, [drift.way for drift in drifts], main.floor_m, rough, cells.heights_over, through=through
    )


def hang_again(folder: Path, files: Iterable[str]) -> Callable[[FurnitureParams], Bundle]:
    """Return what makes the furniture of a bundle again, whose record lists these files, on its own rock."""

    def hang(params: FurnitureParams) -> Bundle:
        rough = {name: (folder / name).read_bytes() for name in rock_names(files)}
        return hang_in_volume(params, decode(folder / TOPOLOGY, LegNetwork), rough, decode(folder / CELLS, FloorSpans))

    return hang


def is_furnished(leg: LegRecord) -> bool:
    """Return whether furniture hangs along a leg: it is flat enough to drive on, and high enough."""
    return leg.headroom_m.min() >= LEAST_HEIGHT_M and leg.grade <= STEEPEST
