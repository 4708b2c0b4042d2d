"""Read the composed configuration and its overrides, without Hydra: only an override has to be composed."""

from __future__ import annotations

import json
import shlex
from typing import Any

import yaml
from pydantic import ValidationError

from minesurveys.refusals import first_refusal
from pipeline.errors import ParamsError
from pipeline.params.config import Config
from pipeline.places import COMPOSED, ROOT_PARAMS


def composed_section(section: str) -> Any:
    """Return one stage's parameters from `artifacts/params.json`.

    Raises
    ------
    ParamsError
        If the file is missing or is not a composed configuration.
    """
    try:
        return getattr(Config.model_validate(json.loads(COMPOSED.read_bytes())), section)
    except FileNotFoundError:
        raise ParamsError(f"{COMPOSED}: missing; write it with `python -m pipeline.compose`") from None
    except (ValueError, RecursionError) as error:  # a ValidationError is a ValueError
        problem = first_refusal(error) if isinstance(error, ValidationError) else "not JSON"
        raise ParamsError(
            f"{COMPOSED}: not a composed configuration ({problem}); run `python -m pipeline.compose`"
        ) from error


def root_overrides() -> list[str]:
    """Return the overrides in `params.yaml`, split as by a shell.

    Raises
    ------
    ParamsError
        If the file is missing or has no line of overrides.
    """
    try:
        text = yaml.safe_load(ROOT_PARAMS.read_text())["overrides"] or ""
        if not isinstance(text, str):
            raise TypeError
        return shlex.split(text)
    except FileNotFoundError:
        raise ParamsError(f"{ROOT_PARAMS}: missing; run from the project's root") from None
    except (yaml.YAMLError, ValueError, KeyError, TypeError) as error:
        raise ParamsError(f'{ROOT_PARAMS}: want one line `overrides: "..."`, quoted as in a shell') from error
