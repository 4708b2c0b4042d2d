"""A stage of the pipeline: the files it reads and writes, the pure function it calls, and how it runs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from minesurveys.remarks import record_remarks
from pipeline.errors import ArtifactError, MineError, ParamsError, run_command
from pipeline.params.composed import composed_section, root_overrides
from pipeline.places import ROOT_PARAMS
from pipeline.store.codecs import Bundle, decode, encode
from pipeline.store.files import recover_folder, replace_folder
from pipeline.store.hashing import sha256_bytes, sha256_file
from pipeline.store.locks import hold_lock
from pipeline.store.manifest import UNLISTED, Manifest, code_sha256, new_manifest, read_manifest
from pipeline.store.mine_survey import MineModel, MineSurvey, open_survey, survey_files
from pipeline.store.registry import read_registry, verify_input
from pipeline.store.written import Written

ARTIFACTS = Path("artifacts")
MANIFEST = "manifest.json"


@dataclass(frozen=True)
class Artifact:
    """A file below `artifacts/`, or a folder, and the type that its codec decodes it to.

    A `Bundle` is a folder that holds what the mine has, perhaps nothing: a stage returns its values by the names of
    their files, and gets its path. A `MineSurvey` is a folder, too.

    `in_git` marks a small result of the default world that git stores instead of DVC's cache. `volatile` marks timings,
    which differ from run to run; the manifest and `dvc.yaml` do not name them.
    """

    path: str
    kind: Any
    in_git: bool = False
    volatile: bool = False

    @property
    def is_folder(self) -> bool:
        """Return whether the artifact is a folder."""
        return self.kind in (Bundle, MineSurvey)

    def at(self, root: Path) -> Path:
        """Return the path below a world's folder, `artifacts` or one of `artifacts/worlds`."""
        return root / self.path


@dataclass(frozen=True)
class Stage:
    """One stage of the pipeline.

    `run(params, **inputs)` receives the section of the configuration with the stage's name, and one decoded artifact
    for each entry of `reads`. It returns one value for each entry of `writes`. `sources(params)` lists the registered
    files below `data/` that the stage uses. `check(params, outputs)` may raise `LimitError` after the artifacts are
    written.
    """

    name: str
    run: Callable[..., Mapping[str, Any]]
    reads: dict[str, Artifact]
    writes: dict[str, Artifact]
    sources: Callable[[Any], list[str]] = field(default=lambda params: [])
    check: Callable[[Any, Mapping[str, Any]], None] = field(default=lambda params, outputs: None)


def by_model(level: Callable[..., Any], volume: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that calls the one of the model that a mine is built in; nothing else asks for the model."""
    table = {MineModel.LEVEL: level, MineModel.VOLUME: volume}

    def run(params: Any, mine: MineSurvey, **inputs: Any) -> Any:
        return table[mine.model](params, mine, **inputs)

    return run


def run_stage(stage: Stage, overrides: list[str]) -> None:
    """Run one stage of the default world with the composed parameters, or with overrides.

    Raises
    ------
    MineError
        If the stage fails, or another command is running it; the artifacts are unchanged.
    """
    params = _params(stage, overrides)
    with hold_lock(ARTIFACTS / f".{stage.name}.lock", f"another command is running the stage {stage.name}"):
        recover_folder(ARTIFACTS / stage.name)
        try:
            make_artifacts(stage, params, ARTIFACTS)
        except MineError as error:
            error.args = (f"{error}{_overridden()}", *error.args[1:])
            raise


def _overridden() -> str:
    """Return a note on the overrides in `params.yaml`: an earlier command may have left them."""
    try:
        words = root_overrides()
    except ParamsError:  # the stage's own error is the one to report
        return ""
    return f"; {ROOT_PARAMS} has the overrides {' '.join(words)}" if words else ""


def _params(stage: Stage, overrides: list[str]) -> Any:
    if not overrides:
        return composed_section(stage.name)
    from pipeline.compose import compose_after_root  # with Hydra and MuJoCo, which take long to import

    return getattr(compose_after_root(overrides), stage.name)


def make_artifacts(stage: Stage, params: Any, root: Path) -> None:
    """Run a stage in a world's folder; all outputs and the manifest are replaced at once.

    Raises
    ------
    MineError
        If the stage fails. The artifacts are unchanged, except after a breached limit: then the new ones are kept.
    """
    inputs = _input_hashes(stage, params, root)
    values = {key: _decoded(artifact, root) for key, artifact in stage.reads.items()}
    with record_remarks() as remarks:
        outputs = stage.run(params, **values)
    if set(outputs) != set(stage.writes):
        raise ArtifactError(f"{stage.name}: wrote {sorted(outputs)}, declares {sorted(stage.writes)}")
    files = dict[str, bytes]()
    for key, artifact in stage.writes.items():
        files |= _encoded(stage, artifact, outputs[key])
    manifest = new_manifest(stage.name, params.model_dump(mode="json"), inputs, _hashes(stage, root, files), remarks)
    files[MANIFEST] = encode(Path(MANIFEST), manifest)
    replace_folder(root / stage.name, files, written_by(stage, root))
    stage.check(params, outputs)


def written_by(stage: Stage, root: Path) -> Written:
    """Return what the folder of a stage may hold: what its manifest names, and what no manifest can name.

    Those are the manifest itself, timings, and the default world's figures in git, which keeps their earlier content.
    """
    folder = root / stage.name
    any_content = {Path(name).relative_to(stage.name) for name in UNLISTED if name.startswith(f"{stage.name}/")}
    any_content |= {
        Path(artifact.path).relative_to(stage.name)
        for artifact in stage.writes.values()
        if artifact.volatile or (artifact.in_git and root == ARTIFACTS)
    }
    try:
        manifest = read_manifest(folder / MANIFEST)
    except (ArtifactError, OSError):
        manifest = None
    listed = dict[str, str | None]()
    if manifest is not None and manifest.stage == stage.name:
        listed = {name.removeprefix(f"{folder.as_posix()}/"): digest for name, digest in manifest.outputs.items()}
        any_content.add(Path(MANIFEST))
    folders = [artifact.at(Path()).relative_to(stage.name) for artifact in stage.writes.values() if artifact.is_folder]
    return {**listed, **{name.as_posix(): None for name in any_content}, **{f"{name}/": None for name in folders}}


def is_fresh(stage: Stage, params: Any, root: Path) -> bool:
    """Return whether a world's folder holds this stage's outputs of the same code, parameters and inputs."""
    try:
        manifest = read_manifest(root / stage.name / MANIFEST)
        return (
            _names_all(manifest, stage, root)
            and manifest.code_sha256 == code_sha256(stage.name, Path.cwd())
            and manifest.params == params.model_dump(mode="json")
            and manifest.inputs == _input_hashes(stage, params, root)
            and all(sha256_file(Path(name)) == digest for name, digest in manifest.outputs.items())
            and all(artifact.at(root).is_file() for artifact in stage.writes.values() if artifact.volatile)
        )
    except (MineError, OSError):
        return False


def _names_all(manifest: Manifest, stage: Stage, root: Path) -> bool:
    """Return whether a manifest names each output that is a file, and each folder is there, which may be empty."""
    locked = [artifact for artifact in stage.writes.values() if not artifact.volatile]
    return all(a.at(root).is_dir() if a.is_folder else a.at(root).as_posix() in manifest.outputs for a in locked)


def check_again(stage: Stage, params: Any, root: Path) -> None:
    """Check the figures that a stage wrote earlier against its limits; `LimitError` if one breaches its limit."""
    stage.check(params, {key: decode(a.at(root), a.kind) for key, a in stage.writes.items() if a.kind is dict})


def _input_hashes(stage: Stage, params: Any, root: Path) -> dict[str, str]:
    registry = read_registry()
    hashes = {name: verify_input(Path(name), registry) for name in stage.sources(params)}
    for artifact in stage.reads.values():
        file = artifact.at(root)
        if not file.exists():
            raise ArtifactError(f"{file}: missing; run the stage that writes it (`dvc dag` shows which), or `make all`")
        files = sorted(p for p in file.rglob("*") if p.is_file()) if file.is_dir() else [file]
        hashes |= {p.as_posix(): sha256_file(p) for p in files}
    return hashes


def _hashes(stage: Stage, root: Path, files: Mapping[str, bytes]) -> dict[str, str]:
    """Return the sha256 of files by name, without those that differ from run to run."""
    folder, volatile = root / stage.name, {a.at(root) for a in stage.writes.values() if a.volatile}
    return {
        (folder / name).as_posix(): sha256_bytes(data)
        for name, data in files.items()
        if folder / name not in volatile and not name.endswith("/")
    }


def _encoded(stage: Stage, artifact: Artifact, value: Any) -> dict[str, bytes]:
    """Return an output's files by their paths in the stage's folder."""
    path = Path(artifact.path).relative_to(stage.name)
    if not artifact.is_folder:
        return {path.as_posix(): encode(path, value)}
    files = survey_files(value) if artifact.kind is MineSurvey else value
    found = {(path / name).as_posix(): encode(path / name, part) for name, part in files.items()}
    return found or {f"{path.as_posix()}/": b""}


def _decoded(artifact: Artifact, root: Path) -> Any:
    return (open_survey if artifact.kind is MineSurvey else partial(decode, kind=artifact.kind))(artifact.at(root))


def main(stage: Stage) -> int:
    """Run a stage from the command line; arguments are Hydra overrides. Bad input gives one message and exit code 2."""
    kept = "; earlier artifacts are kept" if (ARTIFACTS / stage.name).is_dir() else ""
    return run_command(stage.name, lambda: run_stage(stage, sys.argv[1:]), f"interrupted{kept}")
