"""Read YAML without aliases, which can expand beyond memory, and without tags, which can execute code."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from minesurveys.errors import ParamsError
from minesurveys.limits import FILE, reader_limits


def require_plain_yaml(path: Path) -> bytes:
    """Return a file's bytes if it is plain YAML within the limits on size and nesting.

    Raises
    ------
    ParamsError
        The message names the file and the line.
    """
    limits = reader_limits()
    try:
        with path.open("rb") as stream:
            data = stream.read(limits.yaml_bytes + 1)
        if len(data) > limits.yaml_bytes:
            raise ParamsError(f"{path}: more than {limits.yaml_bytes} bytes of YAML (yaml_bytes in {FILE})")
        depth = 0
        for event in yaml.parse(data, Loader=yaml.CSafeLoader):
            line = event.start_mark.line + 1 if event.start_mark is not None else 0
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None) or getattr(event, "tag", None):
                raise ParamsError(f"{path}:{line}: aliases and tags are not allowed")
            if depth > limits.nesting:
                raise ParamsError(f"{path}:{line}: nested more than {limits.nesting} deep (nesting in {FILE})")
    except OSError as error:
        raise ParamsError(f"{path}: cannot be read ({error.strerror})") from error
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        if "nesting depth" in str(getattr(error, "problem", "")):  # its own limit of 1,000, while it looks ahead
            raise ParamsError(f"{path}: nested more than {limits.nesting} deep (nesting in {FILE})") from error
        raise ParamsError(f"{path}: not YAML{_place_of(error)}") from error
    return data


def load_plain_yaml(path: Path) -> Any:
    """Return the content of a plain YAML file.

    Raises
    ------
    ParamsError
        If `require_plain_yaml` refuses it, or a value in it has no meaning.
    """
    data = require_plain_yaml(path)
    try:
        return yaml.load(data, Loader=yaml.CSafeLoader)
    except (yaml.YAMLError, ValueError, OverflowError, RecursionError) as error:
        raise ParamsError(f"{path}: not YAML: a value has no meaning{_place_of(error)}") from error


def _place_of(error: Exception) -> str:
    """Return the line and column at which a parser stopped, if it states them."""
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    return "" if mark is None else f" at line {mark.line + 1}, column {mark.column + 1}"
