"""The sources of a Therion project, from the file that configures it (`thconfig`)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from minesurveys.errors import one_line
from minesurveys.formats import is_project
from minesurveys.remarks import warn_user
from minesurveys.therion.lines import TherionLine, therion_lines

_INPUTS_OF_PROJECTS = ".thc"
_NOT_APPLIED = ("select", "unselect", "loop-closure")  # they choose what is exported, and how loops are closed


def project_lines(path: Path, files: list[Path]) -> Iterator[TherionLine]:
    """Yield the lines of a survey's files, from its main file or from the file that configures the project.

    Of a configuration only `source` counts, by name or up to `endsource`, and `input` of other configurations; layouts
    and exports are left out. Remarks say what is not applied.

    Parameters
    ----------
    path : Path
    files : list of Path
        Receives every file that was read.

    Raises
    ------
    InputError
        As `therion_lines`.

    References
    ----------
    The Therion Book, "Configuration file".
    """
    within, unused = False, []
    for line in therion_lines(path, files):
        if not (is_project(line.path) or line.path.suffix.lower() == _INPUTS_OF_PROJECTS):
            yield line
        elif line.words[0] in ("source", "endsource"):
            within = line.words[0] == "source"
        elif within:
            yield line
        elif line.words[0] in _NOT_APPLIED:
            unused.append(one_line(" ".join(line.words), 60))
    for text in dict.fromkeys(unused):
        warn_user(f"`{text}` is not applied; all sources are read", of=path.name)
