"""Where robots can be: the occupancy and clearance grid, the spawn region, and the Nav2 map."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.ndimage import binary_erosion
from shapely import Polygon

from minesurveys.remarks import warn_user
from minexplore.bundle import NAV2_PICTURE
from minexplore.sealed.sizes import MOST_CELLS
from pipeline.errors import GeometryError
from pipeline.geometry.maps.nav2 import nav2_files
from pipeline.geometry.rasterize import fill_polygon
from pipeline.geometry.wall_distance import distances_to_walls
from pipeline.types import Frame, Occupancy, Spawn

_BORDER = 0.999  # of the most cells: a grid begins and ends at whole cells, up to two more a row and column
_STEP_M, _COARSEST_M = 0.05, 2  # m, of cells


def cell_within_bundle(wanted_m: float, world_m: tuple[float, float, float, float]) -> float:
    """Return the wanted cell, m, or the least one of whole 5 cm with which a bundle may hold the grid of a box.

    A remark names a cell that is larger than wanted.

    Raises
    ------
    GeometryError
        If the cell is larger than a bundle allows; the message names the spans.
    """
    west, south, east, north = world_m
    most = MOST_CELLS * _BORDER
    if (east - west) * (north - south) <= most * wanted_m**2:
        return wanted_m
    cell = round(math.ceil(math.sqrt((east - west) * (north - south) / most) / _STEP_M) * _STEP_M, 2)
    if cell > _COARSEST_M:
        raise GeometryError(
            f"the workings span {east - west:.0f} x {north - south:.0f} m; the maps of a bundle have at most "
            f"{MOST_CELLS:,} cells of at most {_COARSEST_M} m: build a part of them"
        )
    warn_user(
        f"is the cell of maps, not {wanted_m:g} m: a bundle holds at most {MOST_CELLS:,} cells",
        count=f"{cell:.2f} m",
        option="compile3d.grid_cell_m",
    )
    return cell


def occupancy_grid(free: Polygon, cell_m: float, world_m: tuple[float, float, float, float]) -> Occupancy:
    """Rasterise the free space and measure the exact distance to rock at each free cell's centre.

    Parameters
    ----------
    free : shapely.Polygon, m, mine frame
    cell_m : float
    world_m : (west, south, east, north), m
        The grid covers this box; its south-west corner is a whole number of cells from the origin.

    Returns
    -------
    Occupancy
    """
    _, _, east, north = world_m
    west, south = (float(np.floor(v / cell_m) * cell_m) for v in world_m[:2])
    cols, rows = int(np.ceil((east - west) / cell_m)), int(np.ceil((north - south) / cell_m))
    # Row 0 is in the north for fill_polygon, in the south for the grid.
    frame = Frame(1.0 / cell_m, -west / cell_m, rows + south / cell_m, cols, rows)
    cells = fill_polygon(free, frame)[::-1]
    row, col = np.nonzero(cells)
    centres = np.column_stack([west + (col + 0.5) * cell_m, south + (row + 0.5) * cell_m])
    clearance = np.zeros(cells.shape, dtype=np.float32)
    clearance[row, col] = distances_to_walls(free, centres)
    return Occupancy(cells.copy(), clearance, np.array([west, south]), cell_m)


def first_anchor(
    grid: Occupancy, starts_m: Sequence[tuple[float, float]], radius_m: float, clearance_m: float
) -> Spawn:
    """Choose the spawn anchor at the first place (x, y) m where robots have room; see `entrance_anchor`.

    Raises
    ------
    GeometryError
        If they have room at no place; the message is that of the first.
    """
    refused: list[GeometryError] = []
    for start_m in starts_m:
        try:
            return entrance_anchor(grid, start_m, radius_m, clearance_m)
        except GeometryError as error:
            refused.append(error)
    raise refused[0]


def entrance_anchor(grid: Occupancy, entrance_m: tuple[float, float], radius_m: float, clearance_m: float) -> Spawn:
    """Choose the spawn anchor: the cell with the largest clearance within half the radius, or else the whole radius.

    All cells round the anchor are free.

    Parameters
    ----------
    grid : Occupancy
    entrance_m : (x, y), m, mine frame
    radius_m : float
        Radius of the entrance region.
    clearance_m : float
        Least distance of a spawn pose from rock.

    Raises
    ------
    GeometryError
        If no cell of the region has the clearance.
    """
    inner = binary_erosion(grid.free, np.ones((3, 3), bool))
    row, col = np.nonzero(inner & (grid.clearance_m >= clearance_m))
    centres = grid.origin_m + (np.column_stack([col, row]) + 0.5) * grid.cell_m
    distance = np.linalg.norm(centres - np.asarray(entrance_m), axis=1)
    clearance = grid.clearance_m[row, col]
    for reach in (radius_m / 2, radius_m):
        near = distance <= reach
        if near.any():
            # The nearest of the cells with equal clearance, so that the choice does not depend on the grid's order.
            best = np.lexsort((distance[near], -np.round(clearance[near], 3)))[0]
            x, y = centres[near][best]
            centre = (float(entrance_m[0]), float(entrance_m[1]))
            return Spawn((float(x), float(y)), float(clearance[near][best]), centre, radius_m, clearance_m)
    roomiest = float(grid.clearance_m.max(initial=0.0))
    raise GeometryError(
        f"spawn: within {radius_m:g} m of the entrance ({entrance_m[0]:.1f}, {entrance_m[1]:.1f}) nothing is "
        f"{clearance_m:g} m from rock, in all of the mine at most {roomiest:.2f} m; --start (survey.entrance_m) moves "
        "the entrance, compile3d.spawn.clearance_m states less, compile3d.grid_cell_m=0.05 looks closer, --half-width "
        "widens drifts of lines"
    )


def nav2_map(grid: Occupancy) -> tuple[np.ndarray, str]:
    """Return the grid as a ROS Nav2 map of the plan: pixels (rows, cols), `map.yaml`."""
    return nav2_files(grid.free, grid.origin_m, grid.cell_m, NAV2_PICTURE)
