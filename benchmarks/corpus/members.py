"""The worlds of the corpus, and how each is built in a copy of the project."""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from benchmarks.worlds.random_levels import random_legs
from minexplore.bundle import RECORD
from minexplore.extra.corpus import BUNDLE, WORLDS
from minexplore.splits import STYLES, light_folder, mine_name, parse_name
from minexplore.unfinished import command_to_end
from pipeline.build.family import FAMILIES
from pipeline.errors import ArtifactError
from pipeline.report.page import FOLDER, PAGE, write_page
from tests.heights import table
from tests.project import ROOT, Project

SPLIT = "test"
PROJECT_LICENCE = "Apache-2.0"
_HEIGHTS = "heights-"
_FOLDER_MODE = 0o755  # a temporary folder is its owner's alone
_EVIDENCE = ("validation/certificate.json", "validation/metrics.json", f"{FOLDER}/{PAGE}", f"{FOLDER}/mine.png")


@dataclass(frozen=True)
class CorpusMember:
    """One world of the corpus.

    Attributes
    ----------
    name : str
    kind : str
        "surveyed", a style of generated mines, or a kind of mines with heights.
    about : str
        One sentence.
    licence : str
        SPDX identifier.
    source : str
        Who surveyed it.
    words : tuple of str
        Of `python -m pipeline new NAME`; empty if it is built otherwise.
    """

    name: str
    kind: str
    about: str
    licence: str
    source: str
    words: tuple[str, ...] = ()


DEFAULT = CorpusMember(
    "chilean-mine",
    "surveyed",
    "The embedded survey of a Chilean copper mine, with visible rock.",
    PROJECT_LICENCE,
    "measured by this project from the plan published with doi 10.1177/0278364916679497",
)
CASES = (
    CorpusMember(
        "wheal-pell",
        "surveyed",
        "The longer piece of Wheal Pell, a mine in Cornwall, whole, with visible rock.",
        "MIT",
        "Ari Cooper-Davis and others",
        ("--from", "data/wheal_pell/pell.3d"),
    ),
)


def generated(each: int) -> list[CorpusMember]:
    """Return the first mines of the split `test`, so many of each style, which take turns."""
    return [
        CorpusMember(
            mine_name(SPLIT, number),
            STYLES[number % len(STYLES)],
            f"Generated mine of the style {STYLES[number % len(STYLES)]}, light; mine {number} of the split {SPLIT}.",
            PROJECT_LICENCE,
            "this project",
        )
        for number in range(each * len(STYLES))
    ]


def with_heights(count: int) -> list[CorpusMember]:
    """Return generated mines with heights; their kinds take turns."""
    members = []
    for seed in range(count):
        kind, _ = random_legs(seed)
        name = f"{_HEIGHTS}{seed:04d}"
        words = ("--from", f"data/{name}.csv", "preset=light")
        about = f"Generated {kind} with heights, light."
        members.append(CorpusMember(name, kind, about, PROJECT_LICENCE, "this project", words))
    return members


class Workshop:
    """A copy of the project in which worlds are built as a user builds them; the project's own worlds stay."""

    def __init__(self, folder: Path, generated: int) -> None:
        """Copy the project; the corpus has so many mines of the split."""
        self._project, self._generated = Project(folder, tiny=False), generated

    def build(self, member: CorpusMember) -> Path:
        """Build a member; return its folder with the artifacts of all stages and the report.

        Raises
        ------
        ArtifactError
            If the pipeline refuses it or a limit is breached; the message is the pipeline's.
        """
        if member == DEFAULT:
            return ROOT / "artifacts"
        if not member.words:
            return self._build_generated(member)
        folder = self._project.folder
        if member.name.startswith(_HEIGHTS):
            _, legs = random_legs(int(member.name.removeprefix(_HEIGHTS)))
            (folder / "data" / f"{member.name}.csv").write_text(table(legs))
        self._run("new", member.name, *member.words, "--licence", member.licence, "--origin", member.source)
        return folder / "artifacts" / "worlds" / member.name

    def _build_generated(self, member: CorpusMember) -> Path:
        place = light_folder(*parse_name(member.name))
        self._run("worlds", "--light", "--split", SPLIT, "--count", str(self._generated), "--piece", place.as_posix())
        folder = self._project.folder / FAMILIES / place
        write_page(folder, f"MineXplore/corpus:{member.name}-v0", {})
        return folder

    def _run(self, *words: str) -> None:
        done = self._project.run(sys.executable, "-m", "pipeline", *words)
        if done.returncode:
            raise ArtifactError(f"corpus: pipeline {' '.join(words)}: {done.stderr.strip()}")


def copy_evidence(built: Path, target: Path) -> None:
    """Copy a world's bundle, certificate, metrics, report and plan into a folder that does not exist.

    Raises
    ------
    ArtifactError
        If there is something else at its place, or the world's last stage has not ended.
    """
    command = command_to_end(built / "realism" / "world", built)
    if command is not None:
        raise ArtifactError(f"{built}: unfinished; `{command}` ends it")
    if os.path.lexists(target):
        raise ArtifactError(f"{target}: is no whole world of a corpus; move it away and run again")
    target.parent.mkdir(parents=True, exist_ok=True)
    fresh = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    try:
        shutil.copytree(built / "realism" / "world", fresh / "world")
        for name in evidence_of(built):
            shutil.copy2(built / name, fresh / Path(name).name)
        fresh.chmod(_FOLDER_MODE)
        fresh.rename(target)
    except BaseException:
        shutil.rmtree(fresh, ignore_errors=True)  # nobody else knows its name
        raise


def evidence_of(built: Path) -> Iterator[str]:
    """Yield the evidence that a world's folder has; a light world has no views of its rock."""
    yield from _EVIDENCE
    for picture in ("validation/evidence/views.png", "contours/evidence/contours.png"):
        if (built / picture).is_file():
            yield picture


@cache
def _workshop(generated: int) -> Workshop:
    """Return the workshop of this process, which is removed when the process ends."""
    folder = tempfile.mkdtemp(prefix="corpus-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Workshop(Path(folder) / "project", generated)


def folder_of(corpus: Path, member: CorpusMember) -> Path:
    """Return a member's folder in a corpus."""
    return corpus / WORLDS / member.name


def build_member(corpus: Path, generated: int, member: CorpusMember) -> None:
    """Build one member and copy what the corpus has of it."""
    if not (folder_of(corpus, member) / BUNDLE / RECORD).is_file():
        copy_evidence(_workshop(generated).build(member), folder_of(corpus, member))
