"""The certificate of a volume world without its survey: the legs that the bundle states take the survey's place."""

from __future__ import annotations

import dataclasses

import numpy as np

from pipeline.params.validation import VolumeProofParams
from pipeline.proof.certificate import Certificate
from pipeline.types import ClosedMesh, SurveyedLegs, text_array
from pipeline.volume.world.proof.certificate import VolumeBundle, validate_volume
from pipeline.volume.world.proof.derived_content import follows_floors
from pipeline.volume.world.topology import LegNetwork

_OF_ROCK = "rock."
_OF_SOLID = "solid."  # figures against the file that was read, which nobody has here


def certify_alone(world: VolumeBundle, params: VolumeProofParams) -> Certificate:
    """Measure the bundle of a volume world, which `open_volume` has checked, against the legs that it states.

    A bundle made of a solid, or of drawn areas, has legs that follow its floors, so that no floor is compared with
    them. One without visible rock has no figures of it.

    Raises
    ------
    GeometryError
        If its mesh is not closed.
    """
    stated = survey_alone(world, params)
    found = validate_volume(params, world, _own_mesh(world) if stated is None else stated).certificate
    left_out = (_OF_SOLID,) if world.rock else (_OF_SOLID, _OF_ROCK)
    clauses = {name: clause for name, clause in found.clauses.items() if not name.startswith(left_out)}
    return dataclasses.replace(found, holds=all(clause.holds for clause in clauses.values()), clauses=clauses)


def survey_alone(world: VolumeBundle, params: VolumeProofParams) -> SurveyedLegs | None:
    """Return the legs that a bundle states as its survey; None if they follow the floors of a solid or a drawing."""
    return None if follows_floors(world, params) else stated_legs(world.legs)


def stated_legs(network: LegNetwork) -> SurveyedLegs:
    """Return the legs of a network as a survey; those that follow each other with one section are one chain."""
    names: list[str] = []
    sections: list[tuple[float, float, float, float]] = []
    first = [0]
    for k, leg in enumerate(network.legs):
        before = network.legs[k - 1] if k else None
        if before is None or before.end != leg.start or before.lrud_m[1] != leg.lrud_m[0]:
            first += [len(names)] if names else []
            names.append(leg.start)
            sections.append(leg.lrud_m[0])
        names.append(leg.end)
        sections.append(leg.lrud_m[1])
    return SurveyedLegs(
        positions_m=np.array([network.stations_m[name] for name in names], np.float64).reshape(-1, 3),
        lrud_m=np.array(sections, np.float64).reshape(-1, 4),
        first=np.array([*first, len(names)], np.int32),
        names=text_array(names),
        surveyed_m=network.total_length_m,
        entrances=text_array(network.entrances),
        between=np.isin(names, network.between).astype(np.uint8),
    )


def _own_mesh(world: VolumeBundle) -> ClosedMesh:
    return ClosedMesh(world.mine.vertices, world.mine.faces, world.record.volume.datum_m)
