"""Stage 3: extrude the rock into convex collision parts, and map the space for robots (metres, mine frame)."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from shapely import Polygon

from minexplore.bundle import CLEARANCE_GRID, NAV2_MAP, NAV2_PICTURE, OCTREE
from pipeline.geometry.maps.occupancy import cell_within_bundle, first_anchor, nav2_map, occupancy_grid
from pipeline.geometry.maps.octree import Columns, build_octree, to_bt
from pipeline.geometry.rock.collision import decomposed_hulls, exact_prisms
from pipeline.geometry.rock.partition import Box, rock_around, tiled_rock, world_box
from pipeline.params.compile3d import Compile3dParams
from pipeline.places import COLLISION, EXTENT, SPAWN
from pipeline.stage import Artifact, Stage, by_model, main
from pipeline.store.codecs import Bundle
from pipeline.store.mine_survey import MineSurvey, volume_of
from pipeline.types import ConvexParts, DriftNetwork, FreeSpace, SolidExtent, Survey


def _compile_level(
    params: Compile3dParams, mine: MineSurvey, free_space: FreeSpace, topology: DriftNetwork, traced: Path
) -> dict[str, Any]:
    """Return collision parts, occupancy (grid, octree and Nav2 map), extent and the spawn region."""
    free = free_space.polygon
    world = world_box(free, params.rock_margin_m, free_space.frame.extent_m)
    cell = cell_within_bundle(params.grid_cell_m, world)
    grid = occupancy_grid(free, cell, world)
    columns = Columns.of_cells(np.argwhere(grid.free), grid.origin_m, cell, params.height_m)
    pixels, yaml = nav2_map(grid)
    start = mine.survey.entrance_m or topology.main_drift_m[0]
    compiled = {
        COLLISION: collision_parts(params, rock_around(free, world), world),
        EXTENT: SolidExtent(params.height_m, world),
        CLEARANCE_GRID: grid,
        OCTREE: to_bt(build_octree(columns, cell)),
        NAV2_PICTURE: pixels,
        NAV2_MAP: yaml,
        SPAWN: first_anchor(grid, [start], params.spawn.radius_m, params.spawn.clearance_m),
    }
    return {"compiled": compiled}


def _compile_volume(
    params: Compile3dParams, mine: MineSurvey, free_space: FreeSpace, topology: DriftNetwork, traced: Path
) -> dict[str, Any]:
    """Return the volume's mesh, parts, cells, legs and maps, and where robots start."""
    from pipeline.volume.world.compile import compile_volume  # open3d takes a second to load

    start_m = _start_of_volume(mine.survey, topology)
    return {"compiled": compile_volume(params, volume_of(mine, traced), start_m, mine.source)}


compile_rock = by_model(level=_compile_level, volume=_compile_volume)


def _start_of_volume(survey: Survey, topology: DriftNetwork) -> list[float] | None:
    """Return where robots start: stated, or of a plan with one grade where that begins; None if it is to be chosen."""
    if survey.entrance_m is not None:
        return [*survey.entrance_m, *([] if survey.entrance_z_m is None else [survey.entrance_z_m])]
    if survey.heights is not None and survey.heights.grade is not None:
        return list(topology.main_drift_m[0])
    return None


def collision_parts(params: Compile3dParams, rock: list[Polygon], world_m: Box) -> ConvexParts:
    """Return the collision parts of the rock in a box about a level floor by the configured method."""
    choice = params.collision
    if choice.method == "exact":
        return exact_prisms(tiled_rock(rock, world_m, params.tile_m), params.height_m)
    # Imported here because the decomposers are slow to load and only used for comparison.
    from pipeline.geometry.rock.decompose import DECOMPOSERS

    decompose = DECOMPOSERS[choice.method](params.height_m, **choice.model_dump(exclude={"method", "tiles"}))
    return decomposed_hulls(rock, choice.tiles, decompose)


STAGE = Stage(
    name="compile3d",
    run=compile_rock,
    reads={
        "mine": Artifact("survey/mine", MineSurvey),
        "free_space": Artifact("contours/free_space.geojson", FreeSpace),
        "topology": Artifact("contours/topology.json", DriftNetwork),
        "traced": Artifact("contours/traced", Bundle),
    },
    writes={"compiled": Artifact("compile3d/compiled", Bundle)},
)

if __name__ == "__main__":
    sys.exit(main(STAGE))
