"""Run all six stages for one world in its own folder; as with `dvc repro`, only stages that are out of date run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from pipeline.errors import MemoryShortageError, describe_shortage, lacks_memory
from pipeline.memory import give_back
from pipeline.params.config import Config
from pipeline.stage import Stage, begin_artifacts, check_again, is_fresh
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
        If a stage fails. The artifacts of earlier stages are kept, and the next run continues from there. What a stage
        writes later is awaited at the end; if that fails, the error is that of the earlier stage.
    MemoryShortageError
        If a stage needs more memory than there is.
    """
    text = yaml.safe_dump(config.model_dump(mode="json"), sort_keys=False, width=110)
    write_atomically(root / "params.yaml", f"# Composed from conf/; do not edit.\n{text}".encode())
    stages, ran, begun = load_stages(), list[str](), None
    after = dict(zip([stage.name for stage in stages], stages[1:], strict=False))
    unfinished: dict[str, Callable[[], None]] = {}
    try:
        for stage in progress(stages):
            params: Any = getattr(config, stage.name)
            recover_folder(root / stage.name)
            coming = None
            try:
                with _in_stage(stage.name):
                    if is_fresh(stage, params, root):
                        check_again(stage, params, root)
                    else:
                        following = after.get(stage.name)
                        coming = following.begin(getattr(config, following.name), root) if following else None
                        unfinished[stage.name] = begin_artifacts(stage, params, root, begun)
                        give_back()
                        ran.append(stage.name)
            except BaseException:
                if coming:
                    coming.end()
                raise
            finally:
                if begun:
                    begun.end()
            begun = coming
    except Exception:
        _finish(unfinished)
        raise
    _finish(unfinished)
    return ran


def _finish(unfinished: Mapping[str, Callable[[], None]]) -> None:
    """Write what stages write later."""
    for name, finish in unfinished.items():
        with _in_stage(name):
            finish()


@contextmanager
def _in_stage(name: str) -> Iterator[None]:
    """Name the stage where memory ran out."""
    try:
        yield
    except Exception as error:
        if not lacks_memory(error):
            raise
        raise MemoryShortageError(f"{name}: {describe_shortage(error)}") from error
