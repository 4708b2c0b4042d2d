"""The readers under test by `python -m benchmarks fuzz`: reader name to the call that reads a file."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import chdir
from dataclasses import asdict
from pathlib import Path

import yaml

from benchmarks.fuzzing.clouds import CLOUDS, SCANS
from benchmarks.fuzzing.samples import SAMPLES
from benchmarks.fuzzing.solids import SOLIDS

PICTURES = ("png", "jpeg", "tiff", "pdf")
HEIGHTS = ("height raster", "height grid", "contour lines", "height labels")
FACES = ("dxf faces", "dxf polyface", "dxf mesh")


def _read_mine(path: Path, **stated: float) -> None:
    """Do what `new` does with a file, as far as stage 1: detect, write the section, read the survey."""
    from pydantic import TypeAdapter

    from pipeline.import_mine import require_section, survey_yaml
    from pipeline.params.stated import StatedOptions, state
    from pipeline.params.survey import SurveyParams
    from pipeline.survey.detect import detect_survey
    from pipeline.survey.load import read_survey, sources

    with chdir(path.parent.parent):
        file = Path(path.parent.name) / path.name
        options = state(file, stated)
        text = survey_yaml("fuzz", file, detect_survey(file, options), StatedOptions())
        require_section(text)
        params = TypeAdapter(SurveyParams).validate_python(yaml.safe_load(text)["survey"])
        sources(params)
        read_survey(params)


def _read_body(path: Path) -> None:
    """Read a solid or a scan; libraries are loaded once, and not by each reading process."""
    import ezdxf.filemanagement  # noqa: F401
    import laspy  # noqa: F401

    import pipeline.survey.clouds.read  # noqa: F401

    _read_mine(path)


def _read_picture(path: Path) -> None:
    _read_mine(path, px_per_m=8.0)


def _read_centrelines(path: Path) -> None:
    _read_mine(path, half_width_m=2.0)


def _read_faces(path: Path) -> None:
    import ezdxf.filemanagement  # noqa: F401

    import pipeline.survey.solids.read  # noqa: F401

    _read_mine(path, volume=True)


def _read_heights(path: Path) -> None:
    """Read a plan with the heights of a file beside it, as stage 1 does."""
    from pydantic import TypeAdapter

    from pipeline.params.survey import SurveyParams
    from pipeline.survey.load import read_survey, sources

    with chdir(path.parent.parent):
        folder = path.parent.name
        section = {"kind": "vector", "name": "fuzz", "file": f"{folder}/plan.geojson", "unit": "m"}
        params = TypeAdapter(SurveyParams).validate_python({**section, "heights": f"{folder}/{path.name}"})
        sources(params)
        read_survey(params)


def _read_cloud(path: Path) -> None:
    import laspy  # noqa: F401  imported here, so that not every child does
    import open3d  # noqa: F401
    import trimesh  # noqa: F401

    from minesurveys.guard.reading_process import run_limited
    from pipeline.scans.cloud import CloudLimits, read_here

    limits = asdict(CloudLimits(0.01, (0.5, 50.0), 1_000_000, (1.0, 12.0), 400.0))
    run_limited(read_here, {"path": str(path), "units": "m", "limits": limits}, str(path))


def _read_sweep(path: Path) -> None:
    from pipeline.scans.sweeps import read_sweep

    read_sweep(path, 50.0, 1.0)


def _read_bundle(path: Path) -> None:
    from pipeline.store.verify import verify_world

    verify_world(path.parent)


def _read_section(path: Path) -> None:
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from pydantic import TypeAdapter, ValidationError

    from minesurveys.guard.plain_yaml import require_plain_yaml
    from pipeline.errors import ParamsError
    from pipeline.params.survey import SurveyParams

    require_plain_yaml(path)
    try:
        values = OmegaConf.to_container(OmegaConf.load(path), resolve=False)
        TypeAdapter(SurveyParams).validate_python(values)
    except (OmegaConfBaseException, yaml.YAMLError, ValidationError, ValueError, TypeError, OSError) as error:
        raise ParamsError(f"{path}: not a survey section") from error


def registry_beside(folder: Path) -> None:
    """Write the empty registry that stage 1 needs."""
    (folder / "registry.txt").write_text("# name\tsha256\tbytes\torigin\tlicence\n")


READERS: dict[str, Callable[[Path], None]] = {
    **dict.fromkeys(SAMPLES, _read_mine),
    **dict.fromkeys((*SOLIDS, *SCANS), _read_body),
    **dict.fromkeys(PICTURES, _read_picture),
    "centrelines": _read_centrelines,
    **dict.fromkeys(FACES, _read_faces),
    **dict.fromkeys(HEIGHTS, _read_heights),
    **dict.fromkeys(CLOUDS, _read_cloud),
    "sweep": _read_sweep,
    "bundle": _read_bundle,
    "survey section": _read_section,
}
