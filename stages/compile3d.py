"""Stage 3: extrude the rock into convex collision parts, and map the space for robots (metres, mine frame)."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from shapely import Polygon
from tqdm import tqdm

from pipeline.geometry.maps.occupancy import cell_within_bundle, first_anchor, nav2_map, occupancy_grid
from pipeline.geometry.maps.octree import Columns, build_octree, to_bt
from pipeline.geometry.rock.collision import decomposed_hulls, exact_prisms
from pipeline.geometry.rock.partition import Box, rock_around, tiled_rock, world_box
from pipeline.params.compile3d import Compile3dParams
from pipeline.stage import Artifact, Stage, main
from pipeline.store.codecs import Bundle
from pipeline.types import (
    NO_FLOORS,
    NO_LEGS,
    NO_PICTURE,
    NO_SOLID,
    ClosedMesh,
    ConvexParts,
    DriftNetwork,
    FloorMesh,
    FreeSpace,
    Image,
    Occupancy,
    SolidExtent,
    Spawn,
    Survey,
    SurveyedLegs,
)


def compile_rock(
    params: Compile3dParams,
    free_space: FreeSpace,
    topology: DriftNetwork,
    survey: Survey,
    network: SurveyedLegs = NO_LEGS,
    solid: ClosedMesh = NO_SOLID,
    floors: FloorMesh = NO_FLOORS,
) -> dict[str, Any]:
    """Return collision parts, occupancy (grid, octree and Nav2 map), extent and the spawn region.

    Of a survey that is built as one volume the files of `volume` hold all, and the others hold nothing.
    """
    if len(floors) or len(network) or len(solid):
        from pipeline.volume.world.compile import compile_volume  # open3d takes a second to load

        subject = (survey.sources or [survey.name])[0]
        network = replace(network, start_m=_start_in_plan(survey, topology, network))
        return {**_nothing(params), "volume": compile_volume(params, network, solid, subject, floors)}
    free = free_space.polygon
    world = world_box(free, params.rock_margin_m, free_space.frame.extent_m)
    cell = cell_within_bundle(params.grid_cell_m, world)
    grid = occupancy_grid(free, cell, world)
    columns = Columns.of_cells(np.argwhere(grid.free), grid.origin_m, cell, params.height_m)
    pixels, yaml = nav2_map(grid)
    start = survey.entrance_m or topology.main_drift_m[0]
    return {
        "collision": collision_parts(params, rock_around(free, world), world),
        "extent": SolidExtent(params.height_m, world),
        "occupancy": grid,
        "octree": to_bt(build_octree(columns, cell)),
        "map": pixels,
        "map_yaml": yaml,
        "spawn": first_anchor(grid, [start], params.spawn.radius_m, params.spawn.clearance_m),
        "volume": {"none.txt": b"a level mine: no volume\n"},
    }


def _start_in_plan(survey: Survey, topology: DriftNetwork, network: SurveyedLegs) -> np.ndarray:
    """Return where robots start: stated, or of a plan with one grade where that begins; none if it is to be chosen."""
    if survey.entrance_m is not None:
        return np.array(survey.entrance_m)
    if survey.heights is not None and survey.heights.grade is not None:
        return np.array(topology.main_drift_m[0])
    return network.start_m


def _nothing(params: Compile3dParams) -> dict[str, Any]:
    """Return the artifacts of a level world, empty."""
    box = (0.0, 0.0, 0.0, 0.0)
    return {
        "collision": ConvexParts(np.zeros((0, 3)), np.zeros(1, np.int32)),
        "extent": SolidExtent(params.height_m, box),
        "occupancy": Occupancy(np.zeros((0, 0), bool), np.zeros((0, 0), np.float32), np.zeros(2), params.grid_cell_m),
        "octree": b"",
        "map": NO_PICTURE,
        "map_yaml": "",
        "spawn": Spawn((0.0, 0.0), 0.0, (0.0, 0.0), params.spawn.radius_m, params.spawn.clearance_m),
    }


def collision_parts(params: Compile3dParams, rock: list[Polygon], world_m: Box) -> ConvexParts:
    """Return the collision parts of the rock in a box about a level floor by the configured method."""
    choice = params.collision
    if choice.method == "exact":
        return exact_prisms(tiled_rock(rock, world_m, params.tile_m), params.height_m)
    # Imported here because the decomposers are slow to load and only used for comparison.
    from pipeline.geometry.rock.decompose import DECOMPOSERS

    decompose = DECOMPOSERS[choice.method](params.height_m, **choice.model_dump(exclude={"method", "tiles"}))
    return decomposed_hulls(rock, choice.tiles, decompose, partial(tqdm, desc=choice.method, unit="tile"))


STAGE = Stage(
    name="compile3d",
    run=compile_rock,
    reads={
        "free_space": Artifact("contours/free_space.geojson", FreeSpace),
        "topology": Artifact("contours/topology.json", DriftNetwork),
        "survey": Artifact("survey/survey.json", Survey),
        "network": Artifact("survey/network.npz", SurveyedLegs),
        "solid": Artifact("survey/solid.npz", ClosedMesh),
        "floors": Artifact("contours/floors.npz", FloorMesh),
    },
    writes={
        "collision": Artifact("compile3d/collision.npz", ConvexParts),
        "extent": Artifact("compile3d/extent.json", SolidExtent),
        "occupancy": Artifact("compile3d/occupancy.npz", Occupancy),
        "octree": Artifact("compile3d/free_space.bt", bytes),
        "map": Artifact("compile3d/map.png", Image),
        "map_yaml": Artifact("compile3d/map.yaml", str),
        "spawn": Artifact("compile3d/spawn.json", Spawn),
        "volume": Artifact("compile3d/volume", Bundle),
    },
)

if __name__ == "__main__":
    sys.exit(main(STAGE))
