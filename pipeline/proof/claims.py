"""What a bundle states to be made by, held against what the validator allows a mine of its kind."""

from __future__ import annotations

import re
from pathlib import Path

from minexplore.bundle import MADE_BY
from pipeline.errors import ArtifactError
from pipeline.params.made_by import MadeBy
from pipeline.params.validation import ValidationParams
from pipeline.proof.rebuilt.whole_bundle import tolerance_of

_FINER = 4.0  # times that a network may be finer than that of its kind

STATED = {  # what only a bundle says of itself, as `FILE: FIELD`; docs/security.md says what a false one could do
    r"world\.json: zones\.\d+\.(friction|command_scale|speed_noise_mps|rgba.*|name)": "floor zones",
    r"world\.json: rock_friction": "floor zones",
    r"world\.json: gain_m\.entrance_length": "entrance length",
    r"world\.json: spawn\.(centre_m.*|radius_m|clearance_m)": "start region",
    r"world\.json: volume\.(surveyed_m|datum_m)": "survey",
    r"world\.json: (plan_frame|areas)\..*": "plan",
    r"volume\.npz: leg": "leg of a facet",
    r"mine\.xml: light\.cutoff: all .*": "lights",
}


def claim_of(field: str) -> str | None:
    """Return the claim that a field (`FILE: FIELD`) of a bundle is, or None if a false one must be refused."""
    return next((claim for pattern, claim in STATED.items() if re.match(pattern, field)), None)


def allowed_claims(folder: Path, claims: MadeBy, own: ValidationParams) -> ValidationParams:
    """Return the validator's own parameters with what a bundle claims, if its kind allows that.

    Parameters
    ----------
    folder : Path
        The bundle, for the message.
    claims : MadeBy
        What the bundle states; `made_by.json`.
    own : ValidationParams
        What the validator allows a mine of this kind. The limits of the certificate are these, whatever is claimed.

    Raises
    ------
    ArtifactError
        With the claimed value, the limit, and the parameter that overrules it.
    """
    most = {
        "tolerance_m": (tolerance_of(claims), tolerance_of(own)),
        "network_cell_m": (claims.network_cell_m, own.network_cell_m),
        "network_min_leg_m": (claims.network_min_leg_m, own.network_min_leg_m),
        "network_station_spacing_m": (claims.network_station_spacing_m, own.network_station_spacing_m),
    }
    for name, (claimed, limit) in most.items():
        if claimed > limit:
            _refuse(folder, own, f"{name} = {claimed:g}", f"at most {limit:g}", name)
    for name in ("network_cell_m", "network_station_spacing_m"):  # a finer network takes memory without bound
        claimed, least = getattr(claims, name), getattr(own, name) / _FINER
        if claimed < least:
            _refuse(folder, own, f"{name} = {claimed:g}", f"at least {least:g}", name)
    if claims.collision_method != own.collision_method:
        _refuse(folder, own, f"collision_method = {claims.collision_method}", own.collision_method, "collision_method")
    if claims.collision_tile_m not in (None, own.collision_tile_m):
        _refuse(folder, own, f"collision_tile_m = {claims.collision_tile_m}", own.collision_tile_m, "collision_tile_m")
    return own.model_copy(update={name: getattr(claims, name) for name in MadeBy.model_fields})


def require_own_claims(folder: Path, claims: MadeBy, params: ValidationParams) -> None:
    """Refuse a bundle that states to be made by other values than those of the run that judges it."""
    for name in MadeBy.model_fields:
        stated, wanted = getattr(claims, name), getattr(params, name)
        if stated != wanted:
            raise ArtifactError(f"{folder / MADE_BY}: {name} = {stated!s:.80}, validation.{name} is {wanted!s:.80}")


def _refuse(folder: Path, own: ValidationParams, claimed: str, wanted: object, name: str) -> None:
    raise ArtifactError(
        f"{folder / MADE_BY}: {claimed}: a mine of the kind {own.kind} has {wanted}; "
        f"validation.{name}=VALUE overrules this limit"
    )
