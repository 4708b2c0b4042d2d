"""Export of a world: write the format's files, read them back, prove them, and only then put them in place."""

from __future__ import annotations

import dataclasses
import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from minexplore import __version__
from minexplore.bundle import MODEL, RECORD, BundleError
from minexplore.world import World
from pipeline.errors import ArtifactError, InputError, LimitError
from pipeline.export.checks.prove import Proof, prove
from pipeline.export.checks.prove_volume import prove_volume
from pipeline.export.extract import load_checked, read_scene
from pipeline.export.extract_volume import arrays_of, read_volume_scene
from pipeline.export.formats.table import require_format
from pipeline.export.scene import ExportScene, ReadScene
from pipeline.mjcf.bundle import open_bundle
from pipeline.params.validation import ValidationParams
from pipeline.stage import ARTIFACTS
from pipeline.store.codecs import encode
from pipeline.store.files import replace_folder, write_atomically
from pipeline.store.hashing import read_text_file, sha256_bytes
from pipeline.store.written import Written, written_files

EXPORT_RECORD = "export.json"
EXPORT_FORMAT = "minexplore-export/1"
_MOST_LICENCE = 200  # characters


@dataclass(frozen=True)
class Export:
    """A finished export: its folder and its proof."""

    folder: Path
    proof: Proof


def export_world(bundle: Path, to: str, out: Path | None, licence: str, params: ValidationParams) -> Export:
    """Write a bundle in another format to a folder, after a proof of what the format's own loader reads.

    Parameters
    ----------
    bundle : Path
        A sealed bundle; nothing else is read.
    to : str
        A key of `FORMATS`.
    out : Path, optional
        The folder; an earlier export there is replaced, a folder with any other file is refused. Default:
        `artifacts/export/NAME-FORMAT`.
    licence : str
        Written into each file; bundles state none.
    params : ValidationParams
        The validator's own, with what the bundle claims (`allowed_claims`).

    Raises
    ------
    InputError
        If the folder, the licence or the format's package does not do.
    ArtifactError
        If the bundle may not be loaded.
    LimitError
        If a figure is outside its limit; nothing is written.
    """
    chosen = require_format(to)
    if not licence.isprintable() or not 0 < len(licence) <= _MOST_LICENCE:
        raise InputError(f"--licence {licence[:80]!r}: want 1 to {_MOST_LICENCE} printable characters")
    world = load_checked(bundle)
    folder = out or ARTIFACTS / "export" / f"{world.record['name']}-{to}"
    _require_place(folder)
    scene, proof_of = (_volume if world.volume is not None else _plan)(bundle, world, licence, params)
    lacking = {surface.material for surface in scene.surfaces} - scene.materials.keys()
    if lacking:
        raise ArtifactError(f"{bundle / MODEL}: material {min(lacking)!r} is missing")
    files = chosen.write(scene)
    with tempfile.TemporaryDirectory() as name:
        for file, data in files.items():
            write_atomically(Path(name) / file, data)
        proof = proof_of(chosen.read(Path(name), scene.facts))
    if not proof.holds:
        raise LimitError(f"{bundle}: {to}: nothing is written: {'; '.join(proof.failures())}")
    files = {**files, RECORD: encode(Path(RECORD), world.record)}
    stated = {
        "format": EXPORT_FORMAT,
        "to": to,
        "written_by": f"MineXplore {__version__}",
        "read_by": chosen.loader,
        "world": scene.facts.to_json(),
        "files": {file: sha256_bytes(data) for file, data in sorted(files.items())},
        "proof": {"holds": proof.holds, **dataclasses.asdict(proof)},
    }
    replace_folder(folder, {**files, EXPORT_RECORD: encode(Path(EXPORT_RECORD), stated)}, _earlier_export(folder))
    return Export(folder, proof)


def _earlier_export(folder: Path) -> Written:
    """Return the files of the export that a folder holds, by its record; none if it holds no export."""
    try:
        stated = json.loads(read_text_file(folder / EXPORT_RECORD))
        if stated["format"] != EXPORT_FORMAT:
            return {}
        return {EXPORT_RECORD: None, **{str(name): str(digest) for name, digest in stated["files"].items()}}
    except (OSError, ArtifactError, ValueError, TypeError, LookupError, AttributeError, RecursionError):
        return {}


def _plan(
    bundle: Path, world: World, licence: str, params: ValidationParams
) -> tuple[ExportScene, Callable[[ReadScene], Proof]]:
    """Return the scene of a world that is drawn in plan, and what proves what was read back of it."""
    opened = open_bundle(bundle)
    if world.record["world_sha256"] != opened.record.world_sha256:
        raise ArtifactError(f"{bundle}: changed while it was read")
    scene = read_scene(opened.record, world, licence)
    return scene, lambda read: prove(bundle, opened, scene, read, params)


def _volume(
    bundle: Path, world: World, licence: str, params: ValidationParams
) -> tuple[ExportScene, Callable[[ReadScene], Proof]]:
    """Return the same of a world that is one volume."""
    try:
        scene = read_volume_scene(world, licence)
    except BundleError as error:
        raise ArtifactError(str(error)) from error
    return scene, lambda read: prove_volume(arrays_of(world), scene, read, params.volume)


def _require_place(out: Path) -> None:
    """Refuse a place that holds anything but an earlier export, before the world is read."""
    try:
        written_files(out, _earlier_export(out))
    except ArtifactError as error:
        raise InputError(f"--out {out}: {error}; an export replaces only an earlier one") from error
