"""The command that writes a world in another format."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from minexplore.bundle import RECORD
from pipeline.commands.proofs import limits_of_kind

_NOT_STATED = "not stated"


def export_(name: str, to: str, out: Path | None, licence: str | None, overrides: list[str]) -> None:
    """Write a world as USD, SDF, glTF or OBJ, read it back and prove it. Nothing is written if a figure fails."""
    from pipeline.export.exporter import export_world
    from pipeline.mjcf.bundle import read_made_by
    from pipeline.proof.claims import allowed_claims

    bundle, stated = _find(name)
    claims = read_made_by(bundle)
    params = allowed_claims(bundle, claims, limits_of_kind(claims.kind, overrides))
    export = export_world(bundle, to, out, stated if licence is None else licence, params)
    proof = export.proof
    for what, rays in proof.rays.items():
        print(f"{what}: {rays.agree} of {rays.cast} rays within {rays.limit_m} m, worst {rays.worst_m} m")
    print(f"certificate: {len(proof.certificate.clauses)} clauses hold; labels: {len(proof.labels)} agree")
    print(export.folder)


def _find(name: str) -> tuple[Path, str]:
    """Return the bundle that a folder or a world of this project is, and the licences of what that was made from."""
    from pipeline.places import require_project
    from pipeline.worlds import survey_of, world_folder

    if (Path(name) / RECORD).is_file():
        return Path(name), _NOT_STATED
    require_project()
    folder = world_folder(name)
    licences = survey_of(folder).survey.licences
    return folder / "realism" / "world", "; ".join(sorted(set(licences.values()))) or _NOT_STATED


def add_to(commands: Any) -> None:
    """Declare the command."""
    parser = commands.add_parser("export", help=export_.__doc__)
    parser.add_argument("name", help="a world of this project, or the folder of a bundle")
    parser.add_argument("--to", choices=["usd", "sdf", "gltf", "obj"], required=True)
    parser.add_argument("--out", type=Path, help="default: artifacts/export/NAME-FORMAT")
    parser.add_argument("--licence", help="default: the licences of the survey's files, or 'not stated'")
    parser.add_argument("overrides", nargs="*", help="for example validation.certificate.limits.missing_mm.max=20")
    parser.set_defaults(run=lambda a: export_(a.name, a.to, a.out, a.licence, a.overrides), anywhere=True)
