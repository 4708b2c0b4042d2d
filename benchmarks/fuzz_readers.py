"""The readers under test by `make fuzz`: reader name to the call that reads a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import yaml


def _read_plan(path: Path) -> None:
    from pipeline.params.survey import PlanSurveyParams
    from pipeline.survey.picture import make_ready, read_picture

    scale = {"source": "stated", "px_per_m": 8.0}
    params = PlanSurveyParams.model_validate(
        {"kind": "plan", "name": "m", "image": "data/x", "max_megapixels": 100, "scale": scale}
    )
    make_ready(path, read_picture(path, params), params)


def _read_placed(path: Path) -> None:
    from pipeline.survey.georeference import read_placement

    _read_plan(path)
    read_placement(path)


def _read_map(path: Path) -> None:
    from pipeline.survey.grid import draw_grid

    draw_grid(path, unknown_is_free=False)


def _read_vector_survey(path: Path) -> None:
    from pipeline.survey.detect import detect_survey

    detect_survey(path, {})


def _read_bundle(path: Path) -> None:
    from pipeline.store.verify import verify_world

    verify_world(path.parent)


def _read_section(path: Path) -> None:
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from pydantic import TypeAdapter, ValidationError

    from pipeline.errors import ParamsError
    from pipeline.params.plain_yaml import require_plain_yaml
    from pipeline.params.survey import SurveyParams

    require_plain_yaml(path)
    try:
        values = OmegaConf.to_container(OmegaConf.load(path), resolve=False)
        TypeAdapter(SurveyParams).validate_python(values)
    except (OmegaConfBaseException, yaml.YAMLError, ValidationError, ValueError, TypeError, OSError) as error:
        raise ParamsError(str(error) or type(error).__name__) from error


READERS: dict[str, Callable[[Path], None]] = {
    **dict.fromkeys(("png", "jpeg", "tiff", "pdf"), _read_plan),
    **dict.fromkeys(("geotiff", "world file"), _read_placed),
    **dict.fromkeys(("dxf", "geojson", "geopackage", "shapefile"), _read_vector_survey),
    **dict.fromkeys(("stations", "survex", "compass"), _read_vector_survey),
    "map.yaml": _read_map,
    "bundle": _read_bundle,
    "survey section": _read_section,
}
