"""What each stage of a world of a mine's file costs. The processes that are measured do not load this module."""

from __future__ import annotations

import contextlib
from pathlib import Path

from benchmarks.speed.stage_costs import Costs, measure
from pipeline.import_mine import draft_import, import_mine
from pipeline.params.stated import StatedOptions
from tests.project import Project


def measure_file(file: str, text: str, stated: StatedOptions, project: Project) -> tuple[Costs, Path]:
    """Build a mine's file in a copy of the project, as `new ... preset=light` does, and drive in it.

    Parameters
    ----------
    file : str
        The file's name; that of the world is its stem.
    text : str
        Its content.
    stated : StatedOptions
        What the options of `new` state.
    project : Project

    Returns
    -------
    Costs
    Path
        The world's folder.

    Raises
    ------
    MineError, RuntimeError
        If the file is refused, or a stage fails.
    """
    name = Path(file).stem
    with contextlib.chdir(project.folder):
        Path(file).write_text(text)
        import_mine(draft_import(name, Path(file), stated), "generated", "CC0-1.0")
    root = Path("artifacts/worlds") / name
    return measure([f"survey={name}", "preset=light"], root, project.folder), project.folder / root
