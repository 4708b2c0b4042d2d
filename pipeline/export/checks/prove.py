"""The proof of an export: what the format's own loader reads of it, held against the compiled bundle."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from minexplore.bundle import MODEL, GeomGroup, is_shade
from pipeline.export.checks.clauses import OF_PHYSICS, certify_parts
from pipeline.export.checks.pieces import PART_GROUPS, LabelMatch, match_labels, pieces_of_model, seen_parts
from pipeline.export.checks.rays import RayMatch, RayTest, cast_at_model, starts_in_plan
from pipeline.export.scene import ExportScene, ReadScene, hull_triangles
from pipeline.mjcf.bundle import OpenedBundle, WorldRecord
from pipeline.mjcf.loading import load_model
from pipeline.params.validation import ValidationParams
from pipeline.proof.certificate import Certificate
from pipeline.proof.rebuilt.remake import read_free_space

SEED = 47
_SAME = 1e-6  # frictions may be of 32 bits
_HIDDEN = GeomGroup.SMOOTH_SURFACE


@dataclass(frozen=True)
class Count:
    """How many the world has, and how many of the file agree."""

    world: int
    file: int


@dataclass(frozen=True)
class Proof:
    """All figures of one export.

    `rays` and `labels` are by what is compared. `not_measured` lists clauses of the certificate that are no property of
    a file. `frictions` and `lights` are None where the format has none.
    """

    rays: dict[str, RayMatch]
    labels: dict[str, LabelMatch]
    certificate: Certificate
    not_measured: list[str]
    frictions: Count | None
    lights: Count | None

    @property
    def holds(self) -> bool:
        """Return whether all figures are within their limits."""
        return not any(self.failures())

    def failures(self) -> Iterator[str]:
        """Yield one line for each figure that is outside its limit."""
        for what, rays in self.rays.items():
            if not rays.holds:
                differ = rays.cast - rays.agree
                yield f"{differ} of {rays.cast} rays at what is {what} differ, by up to {rays.worst_m} m"
        for label, match in self.labels.items():
            if not match.holds:
                yield (
                    f"{label}: {match.file_pieces} pieces of {match.file_area_m2} m2, "
                    f"the world has {match.pieces} of {match.area_m2} m2"
                )
        for name, clause in self.certificate.clauses.items():
            if not clause.holds:
                yield f"certificate: {name} = {clause.value}, limit {clause.limit}"
        for what, count in (("frictions", self.frictions), ("lights", self.lights)):
            if count is not None and count.file != count.world:
                yield f"{what}: {count.file} of the file agree, the world has {count.world}"


def prove(bundle: Path, opened: OpenedBundle, scene: ExportScene, read: ReadScene, params: ValidationParams) -> Proof:
    """Hold what was read back from an export against the bundle.

    Parameters
    ----------
    bundle : Path
    opened : OpenedBundle
        The bundle, opened.
    scene : ExportScene
        What was written; its frictions and lights are compared.
    read : ReadScene
    params : ValidationParams
        The validator's own, with what the bundle claims.
    """
    zones = [zone.name for zone in opened.record.zones]
    model = load_model(bundle / MODEL)
    rays = _cast(bundle, model, opened.record, read)
    pieces = list(pieces_of_model(model, zones))
    labels = match_labels(pieces if opened.record.has_visible_rock else [*pieces, *seen_parts(pieces)], read)
    certificate = certify_parts(bundle, opened, read, params)
    unmeasured = [name for name in params.certificate.limits if name in OF_PHYSICS]
    lights = None if read.lights is None else Count(len(scene.lights), read.lights)
    return Proof(rays, labels, certificate, unmeasured, same_frictions(scene, read), lights)


def _cast(bundle: Path, model: mujoco.MjModel, record: WorldRecord, read: ReadScene) -> dict[str, RayMatch]:
    for geom in range(model.ngeom):
        if is_shade(model.geom(geom).name):
            model.geom_group[geom] = _HIDDEN
    draw, T = starts_in_plan(read_free_space(bundle).polygon), np.array(record.T_world_mine)
    touched = np.concatenate([np.zeros((0, 3, 3)), *map(hull_triangles, read.parts)])
    rays = {"touched": RayTest(draw, cast_at_model(model, T, PART_GROUPS)).compare(touched, SEED)}
    seen = np.concatenate([np.zeros((0, 3, 3)), *(surface.triangles_m for surface in read.surfaces)])
    shown = (GeomGroup.ROUGH_SURFACE,) if record.has_visible_rock else PART_GROUPS
    return rays | {"seen": RayTest(draw, cast_at_model(model, T, shown)).compare(seen, SEED)}


def same_frictions(scene: ExportScene, read: ReadScene) -> Count | None:
    """Return how many parts of the file have the friction that the world states for their names."""
    if any(part.friction is None for part in read.parts):
        return None
    stated = {part.name: part.friction for part in scene.parts}
    same = (abs((part.friction or 0.0) - (stated.get(part.name) or np.inf)) < _SAME for part in read.parts)
    return Count(len(scene.parts), sum(same))
