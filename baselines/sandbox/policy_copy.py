"""A copy of a stranger's policy, whose hash was compared: what was compared is what runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from baselines.base.errors import BaselineError, RejectedError
from baselines.policies.policy_lookup import checkpoint_sha256
from baselines.policies.policy_source import (
    find_source,
    read_source,
    require_checkpoint,
    source_sha256,
    write_source,
)


@dataclass(frozen=True)
class PolicyCopy:
    """A policy's name, its hash, and its file's name in the folder of the copy, if it is a checkpoint."""

    name: str
    sha256: str
    file: str | None = None

    def name_inside(self, folder: str) -> str:
        """Return the policy's name where the copy lies in `folder`."""
        return self.name if self.file is None else f"{folder}/{self.file}"


def copy_policy(name: str, folder: Path, sha256: str | None = None) -> PolicyCopy:
    """Copy a policy's files into a folder. Nothing of it is run or imported.

    Parameters
    ----------
    name : str
        `module:Class` or a file NAME.safetensors.
    folder : Path
        An empty folder.
    sha256 : str, optional
        The hash that the policy must have.

    Raises
    ------
    RejectedError
        If it has another hash.
    BaselineError
        If there is no such policy, or its files are too large or too many.
    """
    copy = _copy_checkpoint(Path(name), folder) if name.endswith(".safetensors") else _copy_module(name, folder)
    if sha256 is not None and copy.sha256 != sha256:
        raise RejectedError(f"policy {name} is {copy.sha256[:12]} here, not {sha256[:12]}")
    return copy


def _copy_checkpoint(path: Path, folder: Path) -> PolicyCopy:
    content = require_checkpoint(path)
    write_source({path.name: content}, folder)
    return PolicyCopy(str(path), checkpoint_sha256(folder / path.name), path.name)


def _copy_module(name: str, folder: Path) -> PolicyCopy:
    top = name.partition(":")[0].partition(".")[0]
    if top == __name__.partition(".")[0]:
        raise BaselineError(f"policy {name}: a class of this project is driven again by its explorer's name")
    files = read_source(find_source(top))
    write_source(files, folder)
    return PolicyCopy(name, source_sha256(files))
