"""Limits on reading a file, from `limits.yaml` beside this module."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from minesurveys.errors import ParamsError
from minesurveys.refusals import first_refusal

FILE = "minesurveys/limits.yaml"
_PATH = Path(__file__).resolve().with_name("limits.yaml")


class ReaderLimits(BaseModel):
    """Named limits; `limits.yaml` explains each."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    memory_bytes: int = Field(ge=500_000_000)
    time_s: float = Field(gt=0)
    cloud_s_per_gb: float = Field(ge=0)
    solver_s: float = Field(ge=0)
    notice_s: float = Field(gt=0)
    output_bytes: int = Field(gt=0)
    file_bytes: int = Field(gt=0)
    text_bytes: int = Field(gt=0)
    yaml_bytes: int = Field(gt=0)
    cloud_bytes: int = Field(gt=0)
    unpacked_bytes: int = Field(gt=0)
    solid_facets: int = Field(gt=0)
    nesting: int = Field(ge=9, le=200)
    megapixels: float = Field(gt=0)
    map_megapixels: float = Field(gt=0)
    decoded_bytes: int = Field(gt=0)
    regions: int = Field(gt=0)
    shapes: int = Field(gt=0)
    points: int = Field(gt=0)
    crossings: int = Field(gt=0)
    dxf_entities: int = Field(gt=0)
    dxf_block_depth: int = Field(gt=0, le=200)
    stations: int = Field(gt=0)
    sweep_rows: int = Field(gt=0)
    survex_shots: int = Field(gt=0)
    survex_files: int = Field(gt=0)
    survex_line_bytes: int = Field(gt=0)
    survex_depth: int = Field(gt=0, le=200)
    solved_items: int = Field(gt=0)
    survex_name_bytes: int = Field(gt=0, le=100_000)
    scratch_bytes: int = Field(gt=0)
    farthest_wall_m: float = Field(gt=0)


@cache
def reader_limits() -> ReaderLimits:
    """Return the limits.

    Raises
    ------
    ParamsError
        If the file is missing or a limit is unknown, missing or out of range.
    """
    try:
        return ReaderLimits.model_validate(yaml.safe_load(_PATH.read_text()))
    except ValidationError as error:
        raise ParamsError(f"{FILE}: {first_refusal(error)}") from error
    except OSError as error:
        raise ParamsError(f"{FILE}: cannot be read ({error.strerror})") from error
    except yaml.YAMLError as error:
        raise ParamsError(f"{FILE}: not YAML") from error
