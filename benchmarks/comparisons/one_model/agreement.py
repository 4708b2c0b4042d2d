"""How two models of one plan agree, prisms and one volume, by code that neither of them uses.

Ranges of beams, areas, reach, pushed discs, and the certificate's local clauses. Decision 29 has the figures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.comparisons.one_model.measures import (
    Beams,
    enclosed_area,
    places_in,
    push,
    reach_by_outline,
    reach_on_grid,
    reach_on_spans,
)
from benchmarks.comparisons.one_model.twins import Built, Twins
from minexplore.floors.volume_arrays import VolumeFacets
from pipeline.volume.enclosure import Enclosure, measure_enclosure
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.parts import collect_labelled
from pipeline.volume.world.proof.certificate import open_volume, validate_volume
from pipeline.volume.world.proof.fronts import fronts_of

_RANGE_M, _AREA_M2 = 1e-6, 1e-6  # by which both models may differ
_END_M, _FAR = 1e-2, 0.02  # of the ends of pushed discs, and the share that may be farther apart
_NUDGE_M, _NUDGED = 3e-4, 1000  # discs of the level model that are pushed again from beside their places
_LOCAL_MM = (2.0, 20.0)  # intrusion and gap of the certificate; discs may be deeper in one model by as much as parts


@dataclass(frozen=True)
class Agreement:
    """How two models of one plan agree; each pair is of the level model and of the volume."""

    name: str
    parts: tuple[int, int]
    range_m: float  # largest difference of a range
    off_m: float  # likewise from the outline, of the volume
    area_m2: tuple[float, float]  # that differs from the outline
    reach_m2: tuple[float, float, float]  # by the outline first
    touch: tuple[int, int]
    far: float  # share of the pushed discs that end over 1 cm apart
    nudged: float  # likewise of the level model twice, from places 0.4 mm apart
    deepest_mm: tuple[float, float]
    enclosure: tuple[Enclosure, Enclosure]

    @property
    def holds(self) -> bool:
        """Return whether the volume is as exact as the level model."""
        intrusion, gap = _LOCAL_MM
        return (
            max(self.range_m, self.off_m) <= _RANGE_M
            and max(self.area_m2) <= _AREA_M2
            and self.far <= _FAR
            and abs(self.deepest_mm[0] - self.deepest_mm[1]) <= intrusion
            and all(1e3 * one.intrusion.depth_m <= intrusion for one in self.enclosure)
            and all(1e3 * one.gap.width_m <= gap for one in self.enclosure)
            and not any(len(one.unbacked) for one in self.enclosure[1:])
        )


def compare(twins: Twins, beams: int, pushes: int, rng: np.random.Generator) -> Agreement:
    """Build both models of a plan and compare them."""
    both, outline, height_m = (twins.level, twins.volume), twins.outline, twins.height_m
    some = Beams.random(outline, height_m, beams, rng)
    ranges = [some.among(one.corners) for one in both]
    areas = [enclosed_area(one.corners, height_m / 2, twins.anchor_m).symmetric_difference(outline) for one in both]
    places, headings = places_in(outline.buffer(-0.36), pushes, rng), rng.uniform(-np.pi, np.pi, pushes)
    pushed = [push(one.corners, places, headings) for one in both]
    again = push(both[0].corners, places[:_NUDGED] + _NUDGE_M, headings[:_NUDGED])
    return Agreement(
        twins.plan.name,
        (len(both[0].corners), len(both[1].corners)),
        float(np.abs(ranges[0] - ranges[1]).max()),
        float(np.abs(ranges[1] - some.in_slab(outline, height_m)).max()),
        (areas[0].area, areas[1].area),
        (
            reach_by_outline(outline, twins.anchor_m),
            reach_on_grid(twins.grid, twins.anchor_m),
            reach_on_spans(twins.cells, twins.anchor_m),
        ),
        (int(pushed[0].touch.sum()), int(pushed[1].touch.sum())),
        _far(pushed[0].ends_m, pushed[1].ends_m),
        _far(pushed[0].ends_m[:_NUDGED], again.ends_m),
        (pushed[0].deepest_mm(outline), pushed[1].deepest_mm(outline)),
        (enclosure_of(twins.facets, both[0]), enclosure_of(twins.facets, both[1])),
    )


def _far(ends_m: np.ndarray, others_m: np.ndarray) -> float:
    """Return the share of ends (n, 2) m that are over 1 cm from the others."""
    return float((np.linalg.norm(ends_m - others_m, axis=1) > _END_M).mean())


def enclosure_of(facets: VolumeFacets, built: Built) -> Enclosure:
    """Measure the parts of either model against the volume's mesh, as the certificate of a volume does."""
    volume = closed_volume(facets)
    fronts = fronts_of(volume, collect_labelled(built.corners, built.label.tolist()))
    return measure_enclosure(volume, fronts.parts, fronts.faces)


def certificate_of(twins: Twins) -> bool:
    """Return whether the volume's certificate holds, robots and balls included."""
    params = twins.config.validation.volume
    return validate_volume(params, open_volume(twins.volume.folder), twins.slab).certificate.holds
