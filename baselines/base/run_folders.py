"""Folders of training runs: what is in one is replaced, so none that holds something else is taken."""

from __future__ import annotations

from pathlib import Path

from baselines.base.errors import BaselineError

SETTINGS = "settings.json"  # of a run; it is written first


def take_run_folder(folder: Path) -> Path:
    """Make the folder of a run, or take that of a run that was begun; return the path of its settings.

    Raises
    ------
    BaselineError
        If the folder holds files and no run: a run replaces files by their names.
    """
    folder.mkdir(parents=True, exist_ok=True)
    settings = folder / SETTINGS
    if not settings.is_file() and (found := sorted(folder.iterdir())):
        raise BaselineError(f"{folder}: holds {found[0].name} and no training run; name a new or an empty folder")
    return settings
