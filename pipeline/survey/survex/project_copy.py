"""A copy of a Survex project, in which some lines are changed before it is solved."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from pipeline.guard.plain_file import read_text_bytes
from pipeline.survey.solved.project_files import project_files
from pipeline.survey.survex.repeated import flagged_together

_FOLDER = "project"
_LINE_END = re.compile(r"(\r\n|\n\r|\n|\r)")


@dataclass(frozen=True)
class ProjectCopy:
    """The files of a project, all below the main file's folder."""

    path: Path
    files: list[Path]

    def write(self, folder: Path) -> Path:
        """Copy the files into a folder, and return the main one."""
        root = self.path.parent
        for file in self.files:
            copy = folder / _FOLDER / file.relative_to(root)
            copy.parent.mkdir(parents=True, exist_ok=True)
            parts = _LINE_END.split(read_text_bytes(file).decode("latin-1"))  # lines, and what ends each
            parts[::2] = flagged_together(parts[::2])
            copy.write_bytes("".join(parts).encode("latin-1"))
        return folder / _FOLDER / self.path.name

    def origin(self, file: Path, number: int) -> tuple[Path, int]:
        """Return the user's file and line of a line of a copy."""
        return self.path.parent / file.name, number

    def message(self, text: str) -> str:
        """Return a message of Survex as it is."""
        return text

    def names(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Return the stations' names as they are."""
        return names


def project_copy(path: Path) -> ProjectCopy:
    """Return a copy of a `.svx` file and of all files that it includes; `InputError` as `project_files`."""
    return ProjectCopy(path, project_files(path))
