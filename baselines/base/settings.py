"""Settings of a training run, composed from `conf/train/` and checked."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import yaml
from hydra import compose, initialize_config_dir
from hydra.errors import HydraException, MissingConfigException
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import BaseModel, ConfigDict, ValidationError

from baselines.base.errors import BaselineError
from baselines.base.refusals import first_refusal

CONF = Path("conf/train")


class Settings(BaseModel):
    """Values that are checked when they are composed, and never changed."""

    model_config = ConfigDict(extra="forbid", frozen=True)


Kind = TypeVar("Kind", bound=Settings)


def compose_checked(name: str, overrides: list[str], kind: type[Kind]) -> Kind:
    """Compose the settings of `conf/train/NAME.yaml`.

    Raises
    ------
    BaselineError
        Naming the override or the value, and what would be valid.
    """
    file = CONF / f"{name}.yaml"
    if not file.is_file():
        raise BaselineError(f"{file}: missing; run from the project's root")
    try:
        with initialize_config_dir(str(CONF.resolve()), version_base="1.3"):
            values = OmegaConf.to_container(compose(name, overrides), resolve=True)
        return kind.model_validate(values)
    except ValidationError as error:
        raise BaselineError(first_refusal(error)) from error
    except MissingConfigException as error:
        choice = str(error.missing_cfg_file).replace("/", "=")
        raise BaselineError(f"{choice}: valid choices are {', '.join(error.options or [])}") from error
    except (HydraException, OmegaConfBaseException, yaml.YAMLError, ValueError, TypeError) as error:
        stated = " ".join(overrides)
        raise BaselineError(f"{stated}: cannot be read; write KEY=VALUE, with keys and values as in {file}") from error
