"""Small worlds, built in memory: a ring of drifts around a pillar with a dead end, or other workings."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import shapely
from shapely import Polygon

from pipeline.compose import compose
from pipeline.geometry.rasterize import fill_polygon
from pipeline.params.config import Config
from pipeline.store.codecs import encode
from pipeline.store.mine_survey import MineSurvey
from pipeline.types import DrawnPlan, Frame, Scale, Survey
from stages.compile3d import compile_rock
from stages.contours import trace_free_space
from stages.realism import write_world
from stages.surface import model_surface

WORKINGS = shapely.box(0, 0, 26, 14).difference(shapely.box(5, 4.5, 21, 9.5)).union(shapely.box(26, 0, 40, 4))
_PX_PER_M, _MARGIN_M = 8.0, 4.0
_COARSE = [
    "surface.rough.spacing_m=0.3",
    "surface.rough.roof_spacing_m=0.4",
    "surface.texture.size_px=32",
    "realism.preview_width_px=64",
    "realism.lights.spacing_m=8",  # several lights: each must agree with the others
]


def build_small_world(folder: Path) -> None:
    """Build the ring with a coarse surface and write its bundle to a folder."""
    build_world(folder, WORKINGS, (2.0, 2.0), _COARSE)


def build_world(folder: Path, workings: Polygon, entrance_m: tuple[float, float], overrides: list[str]) -> None:
    """Run stages 2 to 5 in memory on a plan drawn from workings (m) and write the bundle to a folder."""
    config, mine = compose(overrides), drawn_mine("small", workings, entrance_m)
    finish_world(config, mine.survey, trace_free_space(config.contours, mine), folder)


def drawn_mine(name: str, workings: Polygon, entrance_m: tuple[float, float]) -> MineSurvey:
    """Return the survey of a plan that is drawn from workings, m."""
    west, south, east, north = (round(_PX_PER_M * side) for side in workings.buffer(_MARGIN_M).bounds)
    frame = Frame(_PX_PER_M, -west, north, east - west, north - south)
    survey = Survey(name, "plan", frame, Scale(_PX_PER_M, "stated"), [], entrance_m, {}, ["plan.png"])
    grey = np.where(fill_polygon(workings, frame), 40, 255).astype(np.uint8)
    return MineSurvey(survey, cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), DrawnPlan())


def finish_world(
    config: Config, survey: Survey, traced: dict[str, Any], folder: Path
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Run stages 3 to 5 in memory on what stage 2 returned for a level mine, and write the bundle to a folder.

    Returns
    -------
    dict, dict
        The files of stages 3 and 4, and their values by name.
    """
    # No stage after the second looks at the picture of a plan.
    mine = MineSurvey(survey, np.zeros((1, 1, 3), np.uint8), DrawnPlan())
    seen = {"free_space": traced["free_space"], "topology": traced["topology"]}
    with tempfile.TemporaryDirectory() as scratch:
        compiled, visible = Path(scratch) / "compiled", Path(scratch) / "rock"
        rock = compile_rock(config.compile3d, mine, **seen, traced=Path(scratch))["compiled"]
        _write(compiled, rock)
        surface = model_surface(config.surface, mine, **seen, compiled=compiled)["rock"]
        _write(visible, surface)
        _write(folder, write_world(config.realism, mine, **seen, compiled=compiled, rock=visible)["world"])
    return rock, surface


def _write(folder: Path, files: Mapping[str, Any]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, value in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(encode(folder / name, value))
