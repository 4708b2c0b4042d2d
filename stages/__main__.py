"""Print `dvc.yaml`, made from the stages' declarations: `python -m stages > dvc.yaml` (`make dag`)."""

from __future__ import annotations

import sys
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml

from pipeline.compose import compose
from pipeline.params.config import Config
from pipeline.places import CODE_HASHES, COMPOSED, CONF, WRITTEN_BY_NEW
from pipeline.stage import ARTIFACTS, Stage
from pipeline.store.registry import REGISTRY

CODE = ("minesurveys", "minexplore", "pipeline", "stages")  # the folders of the modules that a stage may import
STAGES = ("survey", "contours", "compile3d", "surface", "realism", "validation")
_HEADER = """\
# The only DAG. Written by `make dag` from the stages' declarations. `compose` hashes the code of each stage, as DVC
# does not follow imports; `persist` keeps earlier artifacts until a stage has written all new ones.
"""
_PLOTS: list[dict[str, Any]] = [
    {"artifacts/contours/evidence/contours.png": None},
    {"artifacts/validation/evidence/agreement.png": None},
    {
        "artifacts/contours/evidence/widths.csv": {
            "x": "easting_m",
            "y": "width_m",
            "template": "scatter",
            "title": "Clear width of the drifts",
        }
    },
]


def load_stages() -> list[Stage]:
    """Return the six stages in the order in which they run."""
    return [import_module(f"stages.{name}").STAGE for name in STAGES]


def render_dag(root: Path) -> str:
    """Return the text of `dvc.yaml` for the project at `root`."""
    compose = {
        "desc": "Compose the parameters from conf/ and the overrides in params.yaml, and hash the code of each stage",
        "cmd": "python -m pipeline.compose",
        "deps": [*_conf_files(root), *CODE],
        "params": ["overrides"],
        "outs": [_persistent(path.as_posix()) for path in (COMPOSED, CODE_HASHES)],
    }
    stages: dict[str, Any] = {"compose": compose}
    for stage in load_stages():
        stages[stage.name] = _stage_entry(stage)
    stages["report"] = {
        "desc": "The report: one page with all the evidence",
        "cmd": "python -m pipeline report",
        "deps": [
            *_conf_files(root),
            "pipeline/report/page.html.j2",
            "pipeline/report/figures/headlamp.js",
            "pipeline/report/figures/chart.js",
            *((ARTIFACTS / name / "manifest.json").as_posix() for name in STAGES),
        ],
        "params": [{CODE_HASHES.as_posix(): ["report"]}],
        # The page shows load times, which differ from run to run, so the lock names the files written with it.
        "outs": [_persistent((ARTIFACTS / "report" / name).as_posix()) for name in ("mine.png", "mine.svg")],
    }
    plots = [next(iter(p)) if next(iter(p.values())) is None else p for p in _PLOTS]
    return _HEADER + yaml.safe_dump({"stages": stages, "plots": plots}, sort_keys=False, width=120)


def _stage_entry(stage: Stage) -> dict[str, Any]:
    doc = sys.modules[f"stages.{stage.name}"].__doc__ or ""
    locked = [a for a in stage.writes.values() if not a.volatile]
    outs = [artifact.at(ARTIFACTS).as_posix() for artifact in locked if not artifact.in_git]
    metrics = [artifact.at(ARTIFACTS).as_posix() for artifact in locked if artifact.in_git]
    inputs = [artifact.at(ARTIFACTS).as_posix() for artifact in stage.reads.values()]
    entry = {
        "desc": doc.splitlines()[0],
        "cmd": f"python -m stages.{stage.name}",
        "deps": _registered_files(stage) + inputs,
        "params": [{path.as_posix(): [stage.name]} for path in (COMPOSED, CODE_HASHES)],
        "outs": [_persistent(p) for p in [*outs, (ARTIFACTS / stage.name / "manifest.json").as_posix()]],
    }
    # DVC's cache is local to a machine. Metrics in git can be compared with any commit (`dvc metrics diff`).
    return {**entry, "metrics": [{p: {"cache": False, "persist": True}} for p in metrics]} if metrics else entry


def _conf_files(root: Path) -> list[str]:
    """List the files that composing reads, without those that `python -m pipeline new` writes for your mines.

    With these, the default world would be out of date after each `new`.
    """
    files = [path for path in sorted((root / CONF).rglob("*.yaml")) if WRITTEN_BY_NEW not in path.read_text()]
    names = [path.relative_to(root) for path in files]
    return [name.as_posix() for name in names if "train" not in name.parts]


@cache
def _default() -> Config:
    return compose([])


def _registered_files(stage: Stage) -> list[str]:
    """List the files below `data/` that a stage reads for the default world, and their registry."""
    files = stage.sources(getattr(_default(), stage.name))
    return [*files, REGISTRY.as_posix()] if files else []


def _persistent(path: str) -> dict[str, Any]:
    return {path: {"persist": True}}


if __name__ == "__main__":
    sys.stdout.write(render_dag(Path.cwd()))
