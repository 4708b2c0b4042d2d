"""A level plan built twice: as prisms about its outline, and as the slab over its outline that is built as a volume."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import shapely
from shapely import Polygon

from benchmarks.worlds.small_world import drawn_mine, finish_world
from minexplore.bundle import CELLS, CLEARANCE_GRID, PARTS, VOLUME
from minexplore.floors.volume_arrays import FacetLabel, FloorSpans, Parts, VolumeFacets
from pipeline.compose import compose
from pipeline.geometry.generated.generate import generate_workings
from pipeline.places import COLLISION, EXTENT, SPAWN
from pipeline.store.codecs import decode
from pipeline.store.mine_survey import open_survey
from pipeline.types import ClosedMesh, DriftNetwork, FreeSpace, Occupancy, Survey
from pipeline.volume.areas import slab_of_outline
from pipeline.volume.world.bundle import bundle_volume
from pipeline.volume.world.compile import compile_volume
from stages.contours import trace_free_space

_LIGHT = ["preset=light", "realism.tilt_deg=0"]  # a slab of one plane leans with its world, as a level plan does
_BOX_M = 0.5  # of rock under the floor and over the roof, as a level world has it
_SIZE_M, _WIDTH_M, _RIB_M, _PILLAR_M, _SPACING_M = (50.0, 90.0), (4.0, 6.0), 0.15, 8.0, 24.0  # of generated plans


@dataclass(frozen=True)
class TracedPlan:
    """A plan after stage 2."""

    name: str
    survey: Survey
    free: FreeSpace
    network: DriftNetwork

    @classmethod
    def of_artifacts(cls, folder: Path) -> TracedPlan:
        """Read the default mine as stages 1 and 2 left it."""
        return cls(
            "default",
            open_survey(folder / "survey/mine").survey,
            decode(folder / "contours/free_space.geojson", FreeSpace),
            decode(folder / "contours/topology.json", DriftNetwork),
        )

    @classmethod
    def drawn(cls, name: str, workings: Polygon, entrance_m: tuple[float, float]) -> TracedPlan:
        """Draw workings, m, as a picture, and trace it."""
        mine = drawn_mine(name, workings, entrance_m)
        traced = trace_free_space(compose(_LIGHT).contours, mine)
        return cls(name, mine.survey, traced["free_space"], traced["topology"])

    @classmethod
    def generated(cls, style: str, seed: int) -> TracedPlan:
        """Generate workings in a style, and draw and trace them."""
        rng = np.random.default_rng(seed)
        made = generate_workings(style, rng, _SIZE_M, _WIDTH_M, 0.3, 0.3, _RIB_M, _PILLAR_M, _SPACING_M, 0.5)
        workings = max(shapely.get_parts(made), key=shapely.area)
        inner = workings.buffer(-1.2)
        place = max(shapely.get_parts(inner), key=shapely.area).representative_point()
        return cls.drawn(f"{style}_{seed}", workings, (place.x, place.y))


@dataclass(frozen=True)
class Built:
    """One model of a plan: its parts, corners (k, 3) m each, with their labels, and the folder of its bundle."""

    corners: list[np.ndarray]
    label: np.ndarray
    folder: Path


class Twins:
    """A plan by both models; bundles are written to `folder / "level"` and `folder / "volume"`."""

    def __init__(self, plan: TracedPlan, folder: Path) -> None:
        """Take a plan and a folder that is empty."""
        self.plan, self.folder, self.config = plan, folder, compose(_LIGHT)
        self.outline, self.height_m = plan.free.polygon, self.config.compile3d.height_m

    @cached_property
    def slab(self) -> ClosedMesh:
        """Return the closed mesh of the plan."""
        return slab_of_outline(self.outline, 0.0, self.height_m)

    @cached_property
    def level(self) -> Built:
        """Return the world of prisms, with a box under its floor and one over its roof."""
        plan, folder = self.plan, self.folder / "level"
        traced = {"free_space": plan.free, "topology": plan.network}
        self._rock, _ = finish_world(self.config, plan.survey, traced, folder)
        prisms = self._rock[COLLISION]
        corners = [np.asarray(prisms[k]) for k in range(len(prisms))]
        west, south, east, north = self._rock[EXTENT].world_m
        plan_box = np.array([(west, south), (east, south), (east, north), (west, north)])
        for low, high in ((-_BOX_M, 0.0), (self.height_m, self.height_m + _BOX_M)):
            corners.append(np.concatenate([np.column_stack([plan_box, np.full(4, z)]) for z in (low, high)]))
        label = np.full(len(corners), FacetLabel.WALL)
        label[-2:] = FacetLabel.FLOOR, FacetLabel.ROOF
        return Built(corners, label, folder)

    @cached_property
    def volume(self) -> Built:
        """Return the world that is one volume."""
        start_m = list(self.plan.survey.entrance_m or self.plan.network.main_drift_m[0])
        made = compile_volume(self.config.compile3d, self.slab, start_m)
        folder = self.folder / "compiled"
        _write(folder, made)
        _write(self.folder / "volume", bundle_volume(self.config.realism, self.plan.survey, self.plan.free, folder))
        parts: Parts = decode(folder / PARTS, Parts)
        corners = [parts[k] for k in range(len(parts))]
        return Built(corners, parts.label, self.folder / "volume")

    @property
    def grid(self) -> Occupancy:
        """Return the level world's grid."""
        assert self.level
        grid: Occupancy = self._rock[CLEARANCE_GRID]
        return grid

    @property
    def cells(self) -> FloorSpans:
        """Return the volume's floor spans."""
        found: FloorSpans = decode(self.volume.folder / CELLS, FloorSpans)
        return found

    @property
    def facets(self) -> VolumeFacets:
        """Return the volume's mesh with its labels."""
        found: VolumeFacets = decode(self.volume.folder / VOLUME, VolumeFacets)
        return found

    @property
    def anchor_m(self) -> tuple[float, float]:
        """Return where robots start in the level world."""
        assert self.level
        anchor: tuple[float, float] = self._rock[SPAWN].anchor_m
        return anchor


def _write(folder: Path, files: dict[str, bytes]) -> None:
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


PLANS: tuple[Callable[[], TracedPlan], ...] = (
    lambda: TracedPlan.of_artifacts(Path("artifacts")),
    *(
        lambda style=style, seed=seed: TracedPlan.generated(style, seed)
        for style, seed in (
            ("room_and_pillar", 1),
            ("drift_and_crosscut", 2),
            ("ramp", 3),
            ("cave", 4),
            ("room_and_pillar", 5),
        )
    ),
)
