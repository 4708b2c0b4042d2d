"""Run all six stages for one world in its own folder; as with `dvc repro`, only stages that are out of date run."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from minesurveys.errors import describe_shortage, lacks_memory
from minesurveys.remarks import hand_on
from minexplore.unfinished import CONTINUE, PARAMS
from pipeline.errors import MemoryShortageError, MineError
from pipeline.params.config import Config
from pipeline.places import CODE_HASHES, COMPOSED
from pipeline.progress import counted
from pipeline.stage import ARTIFACTS, MANIFEST, check_again, is_fresh, make_artifacts, written_by
from pipeline.store.files import recover_folder, write_atomically
from pipeline.store.hashing import read_text_file
from pipeline.store.manifest import REPORT_FILES, read_manifest
from pipeline.store.written import remove_empty, remove_written, written_files
from stages.__main__ import load_stages

REPORT_FOLDER = "report"
_HEAD = "# Composed from conf/; do not edit.\n"


def make_world(config: Config, root: Path, again: str = "") -> list[str]:
    """Bring a world's folder up to date.

    Parameters
    ----------
    config : Config
    root : Path
        `artifacts/worlds/NAME`, relative to the project. Its `params.yaml` holds the world's parameters.
    again : str, optional
        The command that continues the build, for those who find the world unfinished.

    Returns
    -------
    list of str
        The names of the stages that ran.

    Raises
    ------
    MineError
        If a stage fails. The artifacts of earlier stages are kept, and the next run continues from there.
    MemoryShortageError
        If a stage needs more memory than there is.
    """
    text = yaml.safe_dump(config.model_dump(mode="json"), sort_keys=False, width=110)
    note = f"{CONTINUE}{again}\n" if again and again.isprintable() else ""
    write_atomically(root / PARAMS, f"{_HEAD}{note}{text}".encode())
    stages, ran = load_stages(), list[str]()
    for stage in counted(stages, root.name, "stages"):
        params: Any = getattr(config, stage.name)
        recover_folder(root / stage.name)
        with _in_stage(stage.name):
            if is_fresh(stage, params, root):
                hand_on(read_manifest(root / stage.name / MANIFEST).remarks)
                check_again(stage, params, root)
            else:
                make_artifacts(stage, params, root)
                ran.append(stage.name)
    return ran


def remove_default_world() -> None:
    """Remove what `make all` wrote in `artifacts`; the figures that git tracks stay.

    Raises
    ------
    ArtifactError
        If a folder holds anything else; the message names it, and nothing is removed.
    """
    stages = load_stages()
    for name in (*(stage.name for stage in stages), REPORT_FOLDER):
        recover_folder(ARTIFACTS / name)
    ours = {ARTIFACTS / stage.name: written_by(stage, ARTIFACTS) for stage in stages}
    ours[ARTIFACTS / REPORT_FOLDER] = REPORT_FILES
    found = [folder / name for folder, listed in ours.items() for name in written_files(folder, listed)]
    tracked = {artifact.at(ARTIFACTS) for stage in stages for artifact in stage.writes.values() if artifact.in_git}
    for path in (*found, *filter(_is_composed, (COMPOSED, CODE_HASHES))):
        if path not in tracked:
            path.unlink()
    for folder in ours:
        remove_empty(folder)


def _is_composed(path: Path) -> bool:
    """Return whether a file has a key of each section, as those that are composed have."""
    try:
        return set(json.loads(read_text_file(path))) >= set(Config.model_fields)
    except (OSError, MineError, ValueError, TypeError, RecursionError):
        return False


def remove_world(root: Path) -> None:
    """Remove what `make_world` wrote in a world's folder.

    Raises
    ------
    ArtifactError
        If a stage's folder holds anything else; the message names it.
    """
    for stage in load_stages():
        recover_folder(root / stage.name)
        remove_written(root / stage.name, written_by(stage, root))
    params = root / PARAMS
    if params.is_file() and params.read_bytes().startswith(_HEAD.encode()):
        params.unlink()
    remove_empty(root)


@contextmanager
def _in_stage(name: str) -> Iterator[None]:
    """Name the stage where memory ran out."""
    try:
        yield
    except Exception as error:
        if not lacks_memory(error):
            raise
        raise MemoryShortageError(f"{name}: {describe_shortage(error)}") from error
