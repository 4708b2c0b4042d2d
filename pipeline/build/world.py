"""Run all six stages for one world in its own folder; as with `dvc repro`, only stages that are out of date run."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import yaml

from pipeline.errors import MemoryShortageError, describe_shortage, lacks_memory
from pipeline.memory import give_back
from pipeline.params.config import Config
from pipeline.stage import Stage, check_again, is_fresh, make_artifacts
from pipeline.store.files import recover_folder, write_atomically
from stages.__main__ import load_stages

Progress = Callable[[list[Stage]], Iterable[Stage]]


def make_world(config: Config, root: Path, progress: Progress = iter) -> list[str]:
    """Bring a world's folder up to date.

    Parameters
    ----------
    config : Config
    root : Path
        `artifacts/worlds/NAME`, relative to the project. Its `params.yaml` holds the world's parameters.
    progress : callable, optional
        Iterates over the list of stages and reports progress, as `tqdm` does.

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
    write_atomically(root / "params.yaml", f"# Composed from conf/; do not edit.\n{text}".encode())
    stages, ran, begun = load_stages(), list[str](), None
    after = dict(zip([stage.name for stage in stages], stages[1:], strict=False))
    for stage in progress(stages):
        params: Any = getattr(config, stage.name)
        recover_folder(root / stage.name)
        coming = None
        try:
            if is_fresh(stage, params, root):
                check_again(stage, params, root)
            else:
                following = after.get(stage.name)
                coming = following.begin(getattr(config, following.name), root) if following else None
                make_artifacts(stage, params, root, begun)
                give_back()
                ran.append(stage.name)
        except BaseException as error:
            if coming:
                coming.end()
            if not isinstance(error, Exception) or not lacks_memory(error):
                raise
            raise MemoryShortageError(f"{stage.name}: {describe_shortage(error)}") from error
        finally:
            if begun:
                begun.end()
        begun = coming
    return ran
