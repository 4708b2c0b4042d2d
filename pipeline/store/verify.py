"""Check the chain of manifests from the survey to the world; name the first link that fails."""

from __future__ import annotations

import json
from pathlib import Path

import yaml

from minexplore.bundle import BundleError
from pipeline.errors import ArtifactError
from pipeline.places import COMPOSED
from pipeline.schema import check_world
from pipeline.store.hashing import absence_of, read_text_file, sha256_file
from pipeline.store.manifest import UNLISTED, Manifest, code_sha256, read_manifest
from pipeline.store.registry import read_registry, verify_input

_DEFAULT = COMPOSED.parent  # the folder of the default world


def verify_chain(root: Path, folder: Path = _DEFAULT, composed: Path = COMPOSED) -> int:
    """Check every link: inputs, parameters, code, the outputs that later stages read, and the hashes of the bundle.

    Parameters
    ----------
    root : Path
        The project's folder; its `dvc.yaml` lists what each stage reads.
    folder, composed : Path
        The stages' folder of a world, and its parameters, below the project's; by default those of the default world.

    Returns
    -------
    int
        The number of checked files.

    Raises
    ------
    ArtifactError, InputError
        The message names the first link that fails.
    """
    stages, artifacts = _read_sections(root / "dvc.yaml")["stages"], root / folder
    registry, params = read_registry(), _read_sections(root / composed)
    produced: dict[str, str] = {}
    for stage in (name for name in stages if name not in ("compose", "report")):
        manifest = read_manifest(artifacts / stage / "manifest.json")
        where = f"{artifacts / stage / 'manifest.json'}"
        if manifest.stage != stage:
            raise ArtifactError(f"{where}: written by stage {manifest.stage!r}")
        if manifest.params != params.get(stage):
            raise ArtifactError(f"{where}: made with other params than those in {root / composed}")
        if manifest.code_sha256 != code_sha256(stage, root):
            renews = "make all" if folder == _DEFAULT else f"python -m pipeline new {folder.name}"
            raise ArtifactError(f"{where}: made by other code than the project's (`{renews}` renews it)")
        below = f"{_DEFAULT.as_posix()}/"
        reads = [f"{folder.as_posix()}/{dep[len(below) :]}" for dep in stages[stage]["deps"] if dep.startswith(below)]
        for dep in reads:
            if not any(name == dep or name.startswith(f"{dep}/") for name in manifest.inputs):
                raise ArtifactError(f"{where}: names no input from {dep}, which {stage} reads")
        for name, digest in manifest.inputs.items():
            if name.startswith("data/"):
                _expect(name, verify_input(Path(name), registry), digest, f"the manifest of {stage}")
            elif name not in produced:
                raise ArtifactError(f"{name}: {stage} reads it, but no earlier stage wrote it")
            else:
                _expect(name, produced[name], digest, f"the inputs of {stage}")
        produced |= _verify_outputs(manifest, root, folder)
    verify_certificate(artifacts / "validation" / "certificate.json", verify_world(artifacts / "realism" / "world"))
    return len(produced)


def verify_certificate(path: Path, world: str) -> None:
    """Compare the world that a certificate names with the hash of the world that lies in the project.

    Raises
    ------
    ArtifactError
        If it is no certificate, names another world, or does not hold.
    """
    try:
        certificate = json.loads(read_text_file(path))
        stated, holds = certificate["world_sha256"], certificate["holds"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise ArtifactError(f"{path}: not a certificate; it is no JSON object with world_sha256 and holds") from error
    if stated != world:
        raise ArtifactError(f"{path}: world_sha256 = {str(stated)[:80]}, the certified world must be {world}")
    if holds is not True:
        raise ArtifactError(f"{path}: holds = {str(holds)[:80]}, want true")


def _read_sections(path: Path) -> dict:
    try:
        data = read_text_file(path)
        content = json.loads(data) if path.suffix == ".json" else yaml.load(data, yaml.CSafeLoader)
    except FileNotFoundError:
        raise ArtifactError(f"{path}: missing; run `make all` in the project's root") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ArtifactError(f"{path}: not {path.suffix[1:].upper()}") from error
    if not isinstance(content, dict):
        raise ArtifactError(f"{path}: want a mapping of sections")
    return content


def _verify_outputs(manifest: Manifest, root: Path, folder: Path) -> dict[str, str]:
    for name, digest in manifest.outputs.items():
        path = root / name
        if not path.is_file():
            raise ArtifactError(f"{name}: {absence_of(path)}, but {manifest.stage} wrote it")
        _expect(name, sha256_file(path), digest, f"the manifest of {manifest.stage}")
    unlisted = {*UNLISTED, f"{manifest.stage}/manifest.json"}
    expected = {*manifest.outputs, *((folder / name).as_posix() for name in unlisted)}
    for path in sorted(p for p in (root / folder / manifest.stage).rglob("*") if p.is_file()):
        name = path.relative_to(root).as_posix()
        if name not in expected:
            raise ArtifactError(f"{name}: no stage wrote it")
    return manifest.outputs


def _expect(name: str, digest: str, wanted: str, source: str) -> None:
    if digest != wanted:
        raise ArtifactError(f"{name}: sha256 {digest} differs from {wanted} in {source}")


def verify_world(bundle: Path) -> str:
    """Check that a world bundle holds only what a world may, with the hashes of `world.json`; return the world's hash.

    Raises
    ------
    ArtifactError
        If a file is missing, changed, not listed or not allowed; the message names it and the place in it.
    """
    try:
        return str(check_world(bundle).record["world_sha256"])
    except BundleError as error:
        raise ArtifactError(str(error)) from error
