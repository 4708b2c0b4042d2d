"""A stage's manifest: the hashes of its inputs, outputs and code, and its parameters."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from minesurveys.remarks import Remark
from minexplore import __version__
from pipeline.errors import ArtifactError
from pipeline.store.files import adapter_of, describe_field
from pipeline.store.hashing import import_closure, read_text_file, sha256_file, sha256_named

# Files of stages that no manifest names: a target of its own writes the first, the second holds timings.
UNLISTED = {"validation/mutants.json", "validation/timings.json"}
# The report's, made anew each time: load times are on the page.
REPORT_FILES: dict[str, str | None] = dict.fromkeys(("report.html", "mine.svg", "mine.png"))
_REPORT = "pipeline/report/page.py"
_Section = TypeVar("_Section")


@dataclass(frozen=True)
class Manifest:
    """The provenance of one stage's artifacts; file names are relative to the project, hashes are sha256.

    `remarks` are what the stage guessed, dropped or assumed.
    """

    stage: str
    version: str
    code_sha256: str
    params: dict[str, Any]
    inputs: dict[str, str]
    outputs: dict[str, str]
    remarks: list[Remark] = field(default_factory=list)


@functools.cache
def code_sha256(stage: str, root: Path) -> str:
    """Return one hash of the stage's declaration and all project modules that it imports.

    It is that of the first call in a process, which does not load changed modules later either.
    """
    return _closure_sha256(f"stages/{stage}.py", root)


def code_hashes(stages: Iterable[str], root: Path) -> dict[str, str]:
    """Return the hash of the code of each stage, and of the report."""
    return {**{stage: code_sha256(stage, root) for stage in stages}, "report": _closure_sha256(_REPORT, root)}


def _closure_sha256(module: str, root: Path) -> str:
    closure = import_closure(root / module, root)
    return sha256_named({path.as_posix(): _module_sha256(root / path) for path in closure})


_module_sha256 = functools.cache(sha256_file)  # stages share most of their modules


def new_manifest(
    stage: str, params: dict[str, Any], inputs: dict[str, str], outputs: dict[str, str], remarks: Iterable[Remark] = ()
) -> Manifest:
    """Make the manifest of a stage of the project in the working directory."""
    return Manifest(stage, __version__, code_sha256(stage, Path.cwd()), params, inputs, outputs, list(remarks))


def read_manifest(path: Path) -> Manifest:
    """Read a manifest.

    Raises
    ------
    ArtifactError
        If the file is missing or is not a manifest.
    """
    try:
        return adapter_of(Manifest).validate_json(read_text_file(path))
    except FileNotFoundError:
        raise ArtifactError(f"{path}: missing; its stage has not run (`make all`)") from None
    except ValidationError as error:
        raise ArtifactError(f"{path}: not a manifest: {describe_field(error)}; its stage must run again") from error


def read_params(path: Path, kind: type[_Section]) -> _Section:
    """Return the parameters that a manifest states, as their schema.

    Raises
    ------
    ArtifactError
        If the file is missing, is no manifest, or states other parameters than the schema has.
    """
    try:
        return adapter_of(kind).validate_python(read_manifest(path).params)
    except ValidationError as error:
        raise ArtifactError(f"{path}: params: {describe_field(error)}; its stage must run again") from error
