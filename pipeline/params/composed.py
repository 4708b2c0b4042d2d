"""Read the composed configuration, without Hydra: only an override has to be composed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from pipeline.errors import ParamsError
from pipeline.params.config import Config

COMPOSED = Path("artifacts/params.yaml")


def composed_section(section: str) -> Any:
    """Return one stage's parameters from `artifacts/params.yaml`.

    Raises
    ------
    ParamsError
        If the file is missing or is not a composed configuration.
    """
    try:
        return getattr(Config.model_validate(yaml.safe_load(COMPOSED.read_text())), section)
    except FileNotFoundError:
        raise ParamsError(f"{COMPOSED}: missing; write it with `python -m pipeline.compose`") from None
    except (yaml.YAMLError, ValidationError) as error:
        raise ParamsError(
            f"{COMPOSED}: not a composed configuration ({error}); run `python -m pipeline.compose`"
        ) from error
