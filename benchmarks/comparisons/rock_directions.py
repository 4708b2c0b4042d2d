"""Measure the default rock in straight, level drifts of several directions and widths: how far its figures scatter."""

from __future__ import annotations

import sys
from itertools import product
from pathlib import Path

import numpy as np
import shapely
from shapely import Polygon, affinity
from tqdm import tqdm

from baselines.base.markdown import markdown_table, write_table
from pipeline.compose import compose
from pipeline.geometry.network.skeleton import trace_network
from pipeline.metrics.rock.texture import published_score
from pipeline.params.config import Config
from pipeline.proof.surface import drifts_of, relief_of
from pipeline.proof.texture import measure_texture
from pipeline.surface.build import build_rough_surface, lay_rough_lattice
from pipeline.surface.mesh.lattice import ROOF, WALL
from pipeline.surface.reference import measure_sources
from pipeline.surface.relief_source import choose_relief

TABLE = Path("docs/evidence/parts/rock-directions.md")
_LENGTH_M, _HEIGHT_M, _PLACED_M = 80.0, 3.5, 200.0
_WIDTHS_M, _DIRECTIONS_DEG = (1.5, 3.0, 4.4), range(0, 180, 15)
_BANDS = ("from_0_cm_to_50_cm", "from_50_cm_to_150_cm")
_FIGURES = (
    *("steep, 20", "steep, 40", "foot, 20", "foot, 40", "middle, 20", "middle, 40"),
    *("slope at 1.0 m", "slope at 1.5 m", "cut / wall", "roof axis", "jaggedness axis"),
)


def measure(free: Polygon, config: Config) -> list[float | None]:
    """Build the rock of workings, and return its figures in the order of the table."""
    surface, texture, traced = config.surface, config.validation.texture, config.contours.network
    network = trace_network(free, traced.cell_m, traced.min_leg_m, traced.station_spacing_m)
    lattice = lay_rough_lattice(surface, free, network, _HEIGHT_M)
    rough = build_rough_surface(surface, lattice, choose_relief(surface, measure_sources(surface), lattice))
    walls, roof = (rough.mesh.vertices[rough.mesh.faces[rough.mesh.piece == piece]] for piece in (WALL, ROOF))
    drifts = drifts_of(free, network)
    relief = relief_of(walls, roof, drifts, texture.stretches)
    axes = published_score(measure_texture(walls, roof, drifts, texture).as_paper).axes
    cuts = relief.cut.values()
    return [
        *relief.steep_share.values(),
        *(share for band in _BANDS for share in relief.steep_share_by_height[band].values()),
        *(cut.slope["from_100_cm_to_200_cm"] for cut in cuts),
        max(cut.length_ratio for cut in cuts),
        axes["roof_irregularity_m"],
        axes["wall_jaggedness_deg"],
    ]


def drift(width_m: float, direction_deg: int) -> Polygon:
    """Return a straight drift somewhere in the plan, m."""
    place = np.random.default_rng(direction_deg).uniform(-_PLACED_M, _PLACED_M, 2)
    box = shapely.box(0, -width_m / 2, _LENGTH_M, width_m / 2)
    turned = affinity.rotate(box, direction_deg, origin=(0, 0))
    return shapely.set_precision(affinity.translate(turned, *place), 1e-3)


def main() -> int:
    """Measure all drifts and write the table."""
    config = compose(["+mine=own"])
    todo = list(product(_WIDTHS_M, _DIRECTIONS_DEG))
    found = [measure(drift(*one), config) for one in tqdm(todo, unit="drift", disable=None)]
    figures = np.array(found, dtype=float).reshape(len(_WIDTHS_M), len(_DIRECTIONS_DEG), -1)
    cells = (
        [f"{width:g}", *(" / ".join(f"{np.nanquantile(c, q):.2f}" for q in (0, 0.5, 1)) for c in of_width.T)]
        for width, of_width in zip(_WIDTHS_M, figures, strict=True)
    )
    table = markdown_table(["width of the drift, m", *_FIGURES], cells)
    write_table(TABLE, table)
    print(table, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
