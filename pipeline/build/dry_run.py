"""Read a mine's file as `new` does, up to the workings that stage 2 traces, and write nothing into the project."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pipeline.compose import CONF, compose
from pipeline.import_mine import DATA, draft_import, import_mine
from pipeline.params.config import Config
from pipeline.params.stated import StatedOptions
from pipeline.store.registry import OWN_REGISTRY
from pipeline.types import Image
from stages.__main__ import load_stages

_READING = 2  # stages: the survey, and its workings; the others build the world


@dataclass(frozen=True)
class DryRun:
    """What was read of a mine: the files, and a picture (rows, cols, 3) uint8.

    It shows what of a plan's picture was taken for workings, else the plan that was read.
    """

    files: list[Path]
    picture: Image


def dry_run(name: str, source: Path, stated: StatedOptions, overrides: list[str]) -> DryRun:
    """Detect a file's format, read it, and trace its workings.

    Parameters
    ----------
    name : str
        The name that the world would have. A survey section of this name is used as it is.
    source : Path
    stated : StatedOptions
    overrides : list of str

    Returns
    -------
    DryRun

    Raises
    ------
    MineError
        As `new`, as far as stage 2.
    """
    draft = draft_import(name, source, stated)
    if draft.section is None:
        return DryRun([], _read(compose([f"survey={name}", *overrides])))
    copies = {file.absolute(): target for file, target in draft.copies.items()}
    with _scratch_project():
        import_mine(replace(draft, copies=copies), "not stated", "not stated")
        plan = _read(compose([f"survey={name}", *overrides]))
    return DryRun(list(draft.copies), plan if draft.picture is None else draft.picture)


@contextmanager
def _scratch_project() -> Iterator[None]:
    """Work in a folder with this project's configuration and inputs, which is removed again."""
    root = Path.cwd()
    with tempfile.TemporaryDirectory(prefix="minexplore-") as folder:
        scratch = Path(folder)
        shutil.copytree(root / CONF, scratch / CONF)
        (scratch / "data").mkdir()
        for entry in (root / "data").iterdir():
            if entry.name not in (DATA.name, OWN_REGISTRY.name) and not entry.name.startswith("."):
                (scratch / "data" / entry.name).symlink_to(entry)
        with chdir(scratch):
            yield


def _read(config: Config) -> Image:
    """Run the stages that read, in memory, and return the plan."""
    made: dict[str, Any] = {}
    for stage in load_stages()[:_READING]:
        inputs = {key: made[artifact.path] for key, artifact in stage.reads.items()}
        outputs = stage.run(getattr(config, stage.name), **inputs)
        made |= {artifact.path: outputs[key] for key, artifact in stage.writes.items()}
    return made["survey/plan.png"]
