"""Whether a bundle is what the builder writes: its files, figures, model and visible rock, all made again."""

from __future__ import annotations

from pathlib import Path

from shapely import Polygon

from pipeline.geometry.outline.fewest_vertices import MOST_RATIO
from pipeline.mjcf.bundle import WorldRecord
from pipeline.params.made_by import MadeBy
from pipeline.proof.rebuilt.fittings import hang_again, lay_level, require_floor, require_furniture
from pipeline.proof.rebuilt.remake import read_free_space, require_remade
from pipeline.proof.rebuilt.same_model import require_same_model
from pipeline.proof.rebuilt.smooth import require_smooth
from pipeline.proof.rebuilt.visible import require_visible
from pipeline.types import FreeSpace, Occupancy


def tolerance_of(params: MadeBy) -> float:
    """Return the largest distance, m, by which simplification may have moved a wall, whatever a bundle states."""
    return MOST_RATIO * params.wall_error_m if params.tolerance_m is None else params.tolerance_m


def require_built(folder: Path, record: WorldRecord, params: MadeBy) -> FreeSpace:
    """Refuse a bundle that the builder does not write for any parameters, and return its free space.

    Parameters
    ----------
    folder : Path
        A bundle that `open_bundle` has opened.
    record : WorldRecord
    params : MadeBy
        How its network is traced, the tolerance of its outline, its steepest floor, and how its rock was decomposed.

    Raises
    ------
    ArtifactError
        With the file, the value and the limit.
    """
    free_space, grid = require_solid(folder, record, params)
    require_rock(folder, record, free_space.polygon, grid, params)
    return free_space


def require_solid(folder: Path, record: WorldRecord, params: MadeBy) -> tuple[FreeSpace, Occupancy]:
    """Refuse a bundle whose outline, maps or model the builder does not write; return free space and clearance grid.

    Parameters and errors as `require_built`. What is seen alone is left to `require_rock`.
    """
    free_space = read_free_space(folder)
    grid = require_remade(folder, record, free_space, params, tolerance_of(params))
    require_same_model(folder, record, free_space.polygon, params.collision_method == "exact", params.collision_tile_m)
    return free_space, grid


def require_rock(folder: Path, record: WorldRecord, free: Polygon, grid: Occupancy, params: MadeBy) -> None:
    """Refuse a bundle whose visible rock, floor or furniture the builder does not write.

    Parameters and errors as `require_built`; `free` and `grid` are by `require_solid`.
    """
    if record.has_visible_rock:
        require_visible(folder, record, free, grid, require_smooth(folder, record, free))
        require_furniture(folder, record.files, params.fittings.furniture, hang_again(folder, record))
        require_floor(folder, record.files, params.fittings.floor, lay_level(folder, record, free))
