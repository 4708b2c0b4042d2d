"""Read a mine's file as `new` does, and find its workings as stage 2 does; write nothing into the project."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from pipeline.compose import compose, floor_rules_of
from pipeline.errors import GeometryError, MineError
from pipeline.import_mine import draft_import, import_mine
from pipeline.own_mines import DATA
from pipeline.params.compile3d import Compile3dParams
from pipeline.params.config import Config
from pipeline.params.stated import StatedOptions
from pipeline.places import CONF
from pipeline.store.mine_survey import MineSurvey
from pipeline.store.registry import OWN_REGISTRY
from pipeline.survey.load import read_survey
from pipeline.types import Image, Mask, SurveyedLegs


@dataclass(frozen=True)
class DryRun:
    """What was read of a mine: the files, a picture (rows, cols, 3) uint8, the survey, and the workings.

    The picture shows what of a plan's picture was taken for workings, else the plan that was read. `workings` is a mask
    of the plan's pixels; None of a survey that is built as one volume.
    """

    files: list[Path]
    picture: Image
    made: MineSurvey
    workings: Mask | None


def dry_run(name: str, source: Path, stated: StatedOptions, overrides: list[str]) -> DryRun:
    """Detect a file's format, read it, and find its workings. Their walls are not traced, which takes a build's time.

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
        As `new`, as far as stage 2 finds the workings.
    """
    draft = draft_import(name, source, stated, is_kept=False, rules=floor_rules_of(overrides))
    if draft.section is None:
        made, workings = _read(compose([f"survey={name}", *overrides]))
        return DryRun([], made.plan, made, workings)
    copies = {file.absolute(): target for file, target in draft.copies.items()}
    with _scratch_project():
        import_mine(replace(draft, copies=copies), "not stated", "not stated")
        made, workings = _read(compose([f"survey={name}", *overrides]))
    picture = made.plan if draft.picture is None else draft.picture
    return DryRun(list(draft.copies), picture, made, workings)


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


def _read(config: Config) -> tuple[MineSurvey, Mask | None]:
    """Run stage 1 and what stage 2 finds, in memory, and return both; refuse legs that are all too steep."""
    from stages.contours import find_workings

    made = read_survey(config.survey)
    workings = find_workings(config.contours, made)
    if isinstance(made.shape, SurveyedLegs):
        _require_flat_leg(config.compile3d, made.shape, made.source)
    return made, workings


def _require_flat_leg(params: Compile3dParams, legs: SurveyedLegs, subject: str) -> None:
    """Refuse legs that are all too steep, as stage 3 does, with the survey's file."""
    from pipeline.volume.world.topology import mine_network, require_flat_leg

    try:
        require_flat_leg(mine_network(legs, params.height_m, params.volume)[0])
    except MineError as error:
        raise GeometryError(f"{subject}: {error}") from error
