"""Mines with known answers, drawn as plans and built into worlds in memory."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import shapely
from shapely import LineString, Polygon

from benchmarks.worlds.small_world import finish_world
from minexplore.bundle import UNSEALED, BundleError, world_sha256
from minexplore.sealed.world import SealedWorld, hash_files, open_files
from pipeline.errors import MineError
from pipeline.geometry.rasterize import fill_polygon
from pipeline.geometry.rock.extrude import section_footprint
from pipeline.mjcf.bundle import read_record
from pipeline.params.config import Config
from pipeline.proof.rebuilt.remake import read_free_space
from pipeline.proof.rebuilt.same_model import require_same_model
from pipeline.schema import check_tables
from pipeline.store.mine_survey import MineSurvey
from pipeline.types import DrawnPlan, DriftNetwork, Frame, FreeSpace, Scale, Survey
from stages.contours import trace_free_space

# Straight drift, ring drift with one island, T-junction: areas, loops and dead ends are known by hand.
STRAIGHT = shapely.box(0, 0, 100, 5)
RING = shapely.box(0, 0, 60, 40).difference(shapely.box(6, 6, 54, 34))
TEE = shapely.union_all([shapely.box(0, 0, 80, 5), shapely.box(38, 5, 43, 40)])
# Visible rock of few facets, and a small picture.
COARSE_ROCK = ["surface.rough.spacing_m=0.3", "surface.rough.roof_spacing_m=0.4", "realism.preview_width_px=64"]


def frame_for(polygon: Polygon, px_per_m: float = 8.0, margin_m: float = 4.0) -> Frame:
    """Return a pixel grid around a polygon, with the mine's origin at a pixel corner."""
    west, south, east, north = polygon.bounds
    left, above = round((margin_m - west) * px_per_m), round((north + margin_m) * px_per_m)
    width, height = left + round((east + margin_m) * px_per_m), above + round((margin_m - south) * px_per_m)
    return Frame(px_per_m, left, above, width, height)


def survey_of(frame: Frame, entrance_m: tuple[float, float]) -> Survey:
    """Return the survey of a plan with a stated scale."""
    return Survey("test", "plan", frame, Scale(frame.px_per_m, "stated"), [], entrance_m, {}, ["plan.png"])


def plan_of(polygon: Polygon, frame: Frame) -> np.ndarray:
    """Return a plan (rows, cols, 3) uint8 of a polygon, dark on white."""
    grey = np.where(fill_polygon(polygon, frame), 40, 255).astype(np.uint8)
    return cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)


class BuiltMine:
    """A mine built by stages 2 to 5 in memory; its bundle is written to a folder."""

    def __init__(self, polygon: Polygon, config: Config, folder: Path, px_per_m: float = 8.0) -> None:
        """Run the functions of the stages, but for stage 4's report (see `unreported`)."""
        self.frame = frame_for(polygon, px_per_m)
        inside = polygon.representative_point()
        self.survey = survey_of(self.frame, (inside.x, inside.y))
        traced = trace_free_space(config.contours, MineSurvey(self.survey, plan_of(polygon, self.frame), DrawnPlan()))
        self.raw, self.cleaned = traced["raw"], traced["cleaned"]
        self.free_space: FreeSpace = traced["free_space"]
        self.network: DriftNetwork = traced["topology"]
        self.bundle = folder
        with unreported():
            self.compiled, self.surface = finish_world(config, self.survey, traced, folder)


@contextmanager
def unreported() -> Iterator[None]:
    """Leave out the figures and pictures of stage 4's report: no world holds them, and they take half of its time.

    Tests that run the stages as commands make the report.
    """
    with pytest.MonkeyPatch.context() as patch:
        figures = "pipeline.report.figures.roughness"
        for name in ("stages.surface.report_roughness", f"{figures}.draw_spectra", f"{figures}.draw_sections"):
            patch.setattr(name, lambda *arguments: None)
        yield


def random_mine(rng: np.random.Generator, drifts: int) -> Polygon:
    """Return connected workings: drifts of random width, each from an end of an earlier one."""
    points = [np.array([0.0, 0.0])]
    shapes = []
    for _ in range(drifts):
        start = points[rng.integers(len(points))]
        heading = rng.uniform(-np.pi, np.pi)
        end = start + rng.uniform(12, 30) * np.array([np.cos(heading), np.sin(heading)])
        shapes.append(LineString([start, end]).buffer(rng.uniform(1.5, 3.0)))
        points.append(end)
    return shapely.union_all(shapes)


def sealed(files: dict[str, bytes], **fields: Any) -> dict[str, bytes]:
    """Return the files with changed fields of the record and the hashes that belong to them."""
    record = {**json.loads(files["world.json"]), **fields}
    sealed_files = {name: data for name, data in files.items() if name not in UNSEALED}
    record["files"] = {name: hashlib.sha256(data).hexdigest() for name, data in sealed_files.items()}
    record["world_sha256"] = world_sha256(record)
    return {**files, "world.json": json.dumps(record).encode()}


def put(place: Any, value: Any) -> Any:
    """Return a change of one number of an array."""

    def change(array: np.ndarray) -> np.ndarray:
        array[place] = value
        return array

    return change


def require_allowed(folder: Path | str, files: dict[str, bytes]) -> SealedWorld:
    """Open a bundle of these files as `minexplore` does, then apply the tables, as `certify` does."""
    return check_tables(Path(folder), open_files(Path(folder), files, hash_files(files)))


def model_refusal(folder: Path, files: dict[str, bytes]) -> str:
    """Write a level world with its hashes and return the message with which its model is refused."""
    for name, data in sealed(files).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    with pytest.raises(MineError) as caught:
        require_same_model(folder, read_record(folder), read_free_space(folder).polygon)
    assert str(caught.value).isprintable()
    return str(caught.value)


def refusal(files: dict[str, bytes], **fields: Any) -> str:
    """Return the message with which `certify`'s tables refuse these files, sealed anew."""
    changed = sealed(files, **fields)
    with pytest.raises(BundleError) as caught:
        require_allowed("w", changed)
    return str(caught.value)


def end_build(root: Path) -> None:
    """Mark a bundle that a test put into `artifacts` as finished, by the manifest of stage 6 as far as it is read."""
    digest = hashlib.sha256((root / "realism/world/world.json").read_bytes()).hexdigest()
    manifest = {"stage": "validation", "inputs": {f"artifacts/worlds/{root.name}/realism/world/world.json": digest}}
    (root / "validation").mkdir()
    (root / "validation" / "manifest.json").write_text(json.dumps(manifest))


def footprint_errors(parts, free, world):
    """Return the area of free space that convex parts (n, 2 or 3) m cover, and that of rock that none covers, m2."""
    covered = shapely.union_all([section_footprint(part) for part in parts])
    return float(covered.intersection(free).area), float(world.difference(free).difference(covered).area)
