"""Compose `artifacts/params.json` from `conf/` and the overrides in `params.yaml`: the only user of Hydra.

The command writes the hash of each stage's code beside it: DVC does not follow imports.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any, cast

import yaml
from hydra import compose as hydra_compose
from hydra import initialize_config_dir
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import InterpolationResolutionError, OmegaConfBaseException
from pydantic import ValidationError

from minesurveys.guard.plain_yaml import require_plain_yaml
from minexplore.physics.robot import RobotParams
from pipeline.errors import ParamsError, run_command
from pipeline.params.composed import root_overrides
from pipeline.params.config import Config
from pipeline.params.floor_rules import FloorRules
from pipeline.params.refusals import describe_refusals
from pipeline.places import CODE_HASHES, COMPOSED, CONF, ROOT_PARAMS, require_project
from pipeline.store.files import write_atomically
from pipeline.store.manifest import code_hashes

_MOST_CHARACTERS = 4000  # of an override; Hydra's parser takes 3 s for as many of nested lists
# The robot's dimensions are defined only in the environment; conf/ refers to them as ${robot:radius_m}.
OmegaConf.register_new_resolver("robot", lambda field: getattr(RobotParams(), field), replace=True)
OmegaConf.register_new_resolver("sum", lambda one, other: round(one + other, 6), replace=True)
_REFUSALS = (HydraException, OmegaConfBaseException, yaml.YAMLError)


def compose(overrides: list[str], conf: Path = CONF) -> Config:
    """Compose the configuration in a folder, by default that of the project, and check it.

    Parameters
    ----------
    overrides : list of str
        Hydra overrides: `group=choice` or `section.key=value`.
    conf : Path

    Raises
    ------
    ParamsError
        The message names the override, its value and the valid choices.
    """
    require_project(conf)
    for path in sorted(conf.rglob("*.yaml")):
        require_plain_yaml(path)
    for override in overrides:
        if len(override) > _MOST_CHARACTERS:
            raise ParamsError(
                f"override {override[:60]!r}...: {len(override)} characters, want at most {_MOST_CHARACTERS}; "
                "a long list belongs into a file of conf/"
            )
    try:
        with initialize_config_dir(str(conf.resolve()), version_base="1.3"):
            composed = hydra_compose("config", overrides)
            values = OmegaConf.to_container(composed, resolve=True)
            written = OmegaConf.to_container(composed)
    except RecursionError as error:
        raise ParamsError(f"overrides {overrides}"[:300] + ": brackets are nested too deep") from error
    except (*_REFUSALS, ValueError, TypeError) as error:
        raise ParamsError(_printable(_explain(overrides, error, conf))) from error
    try:
        return Config.model_validate(values)
    except ValidationError as error:
        raise ParamsError(describe_refusals(error, cast(dict[str, Any], written))) from error


def _printable(text: str) -> str:
    """Return the text without control characters: an error of Hydra quotes the override as it is."""
    return "".join(c if c.isprintable() else " " for c in text)


def compose_after_root(more: list[str]) -> Config:
    """Compose the configuration with the overrides in `params.yaml`, then with more.

    Raises
    ------
    ParamsError
        As `compose`; if an override in `params.yaml` is at fault, the message names that file.
    """
    root = root_overrides()
    try:
        return compose(root + more)
    except ParamsError as error:
        if root and (not more or _is_refused(root)):
            raise ParamsError(f"{ROOT_PARAMS}: {error}; correct its overrides, or clear them by `make all`") from error
        raise


def floor_rules_of(overrides: list[str]) -> FloorRules:
    """Return the rules of the floor with what overrides state of them (`survey.flat_step_m=0`).

    Raises
    ------
    ParamsError
        As `compose`.
    """
    names = set(FloorRules.model_fields)
    own = [text for text in overrides if text.partition("=")[0].removeprefix("survey.") in names]
    return FloorRules(**compose(own).survey.model_dump(include=names)) if own else FloorRules()


def _is_refused(overrides: list[str]) -> bool:
    try:
        compose(overrides)
    except ParamsError:
        return True
    return False


def _explain(overrides: list[str], error: Exception, conf: Path) -> str:
    """Return a message that names the override that Hydra refused, and the valid choices."""
    pairs = [(key.lstrip("+~"), value) for key, _, value in (override.partition("=") for override in overrides)]
    groups = [(key, value) for key, value in pairs if key and (conf / key).is_dir()]
    for key, value in groups:  # groups before keys: an invalid group leaves no configuration to look keys up in
        choices = sorted(path.stem for path in (conf / key).glob("*.yaml"))
        if value not in choices:
            return f"{key} = {value}: valid choices are {', '.join(choices)}"
    base = OmegaConf.create({})
    try:
        with initialize_config_dir(str(conf.resolve()), version_base="1.3"):
            base = hydra_compose("config", [f"{key}={value}" for key, value in groups])
    except (*_REFUSALS, ValueError, TypeError):
        return _misspelt(overrides)
    for key, _ in pairs:
        if key and not (conf / key).is_dir() and re.fullmatch(r"[\w.]+", key):
            problem = _unknown_key(base, key, conf)
            if problem:
                return problem
    if isinstance(error, InterpolationResolutionError):
        return f"overrides {overrides}: {error.full_key}: its value refers to a key that the configuration lacks"
    return _misspelt(overrides)


def _misspelt(overrides: list[str]) -> str:
    """Return a message that names the first override that is not of the form that is read, else all."""
    form = "want KEY=VALUE or GROUP=CHOICE: lists as [1,2], sections as {key: 1}, a text with other signs in quotes"
    parser = OverridesParser.create()
    for override in overrides:
        try:
            parser.parse_override(override)
        except HydraException:
            return f"override {override}: {form}"
        if override.startswith("="):
            return f"override {override}: {form}"
    return f"overrides {overrides}: they do not fit together or to the configuration; {form}"


def _unknown_key(config: DictConfig, key: str, conf: Path) -> str | None:
    node: Any = config
    path: list[str] = []
    for part in key.split("."):
        if not isinstance(node, DictConfig):
            return f"{key}: {'.'.join(path)} is a value, not a section"
        if part not in node:
            groups = [] if path else sorted(p.name for p in conf.iterdir() if p.is_dir())
            choices = sorted({*map(str, node), *groups})
            return f"{key}: unknown; {'.'.join(path) or 'the configuration'} has {', '.join(choices)}"
        node = node[part]
        path.append(part)
    return None


def main() -> int:
    """Write the composed configuration and the hashes of the code; if it is invalid, print one message and return 2."""
    return run_command("compose", _write_composed)


def _write_composed() -> None:
    config = compose_after_root([])
    for path, values in (
        (COMPOSED, config.model_dump(mode="json")),
        (CODE_HASHES, code_hashes(Config.model_fields, Path.cwd())),
    ):
        write_atomically(path, f"{json.dumps(values, indent=1)}\n".encode())  # DVC reads YAML a hundred times slower


if __name__ == "__main__":
    sys.exit(main())
