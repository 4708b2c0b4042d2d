"""The worlds in this project: their folders, their metrics, and their differences."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from minesurveys.errors import one_line
from minexplore.bundle import RECORD
from minexplore.unfinished import command_to_end
from pipeline.errors import ArtifactError
from pipeline.metrics.limits import flatten, format_limit, is_time
from pipeline.params.config import Config
from pipeline.params.validation import Limit, ValidationParams
from pipeline.proof.groups import applying_limits
from pipeline.report.results import NO_FIGURE, read_metrics
from pipeline.stage import ARTIFACTS
from pipeline.store.manifest import read_manifest, read_params
from pipeline.store.mine_survey import MineSurvey, open_survey
from pipeline.store.verify import verify_world

WORLDS = ARTIFACTS / "worlds"
DEFAULT = "default"
_NAME = r"[A-Za-z0-9_-]{1,64}"
_COLUMNS: list[tuple[str, tuple[str, ...], str]] = [  # title, the figure of a level mine and of a volume, format
    ("drifts m", ("topology.drift_m", "survey.built_m"), ",.0f"),
    ("floor m2", ("areas.tunnel_m2", "reach.floor_m2"), ",.0f"),
    ("IoU", ("iou.free_space_vs_cleaned", "solid.iou"), ".4f"),
    ("texture", ("texture.published.overall",), ".3f"),
    ("parts", ("collision.parts", "volume.parts"), ",d"),
    ("certificate", ("certificate.holds",), "d"),
]


def world_folder(name: str) -> Path:
    """Return a world's folder: `artifacts` for the default world, `artifacts/worlds/NAME` for others.

    Raises
    ------
    ArtifactError
        If there is no world of this name. The message lists the worlds.
    """
    folder = ARTIFACTS if name == DEFAULT else WORLDS / name
    if not re.fullmatch(_NAME, name) or not (folder / "survey").is_dir():
        existing = ", ".join(world_names())
        hint = f"the worlds are {existing}" if existing else "there are no worlds; `make all` builds one"
        raise ArtifactError(f"world = {name!r}: unknown; {hint}")
    return folder


def world_names() -> list[str]:
    """Return the names of all worlds in this project, finished or not, the default first."""
    folders = WORLDS.iterdir() if WORLDS.is_dir() else ()
    named = sorted(p.name for p in folders if re.fullmatch(_NAME, p.name) and (p / "survey").is_dir())
    return [DEFAULT] * (ARTIFACTS / "survey").is_dir() + named


def env_id(name: str) -> str:
    """Return the Gymnasium id of a world."""
    return "MineXplore/ChileanMine-v0" if name == DEFAULT else f"MineXplore/{name}-v0"


def read_figures(name: str) -> dict[str, Any]:
    """Return a world's metrics as a flat dict with dotted keys."""
    return read_metrics(world_folder(name) / "validation")


def limits_of(name: str) -> dict[str, Limit]:
    """Return the limits that a world's metrics were checked against."""
    params = read_params(world_folder(name) / "validation" / "manifest.json", ValidationParams)
    return applying_limits(params, read_figures(name))


def survey_of(folder: Path) -> MineSurvey:
    """Return the survey that the world of a folder was built of."""
    return open_survey(folder / "survey" / "mine")


def describe_start(folder: Path) -> str:
    """Return where robots start in the world of a folder, as `--start` takes it, and how to change it."""
    how = "`--start` of `new`, or survey.entrance_m, changes it"
    stated = json.loads((folder / "realism" / "world" / RECORD).read_text())
    x, y, *z = stated["spawn"]["anchor_m"]
    return f"{','.join(f'{m:.1f}' for m in (x, y, *(over + stated['volume']['datum_m'] for over in z)))} m; {how}"


def list_worlds() -> str:
    """Return a table of all worlds with their main metrics and env ids."""
    rows = [["name", *(title for title, _, _ in _COLUMNS), "world", "env id"]]
    for name in world_names():
        bundle, reached = world_folder(name) / "realism" / "world", env_id(name)
        command = command_to_end(bundle, ARTIFACTS.absolute())
        try:
            if command is not None:
                raise ArtifactError("unfinished")
            figures = read_figures(name)
            cells = [_cell(figures, keys, form) for _, keys, form in _COLUMNS]
            digest = verify_world(bundle)[:12]
        except (ArtifactError, ValueError, TypeError):  # no figures, or one that is no number
            cells, digest = ["-"] * len(_COLUMNS), "unfinished"
            reached = f"`{command}` ends it" if command else reached
        rows.append([name, *cells, digest, reached])
    return _table(rows)


def _cell(figures: dict[str, Any], keys: tuple[str, ...], form: str) -> str:
    found = [figures[key] for key in keys if key in figures]
    return format(found[0], form) if found else "-"


def show_world(name: str) -> str:
    """Return a table of every metric that has a limit, its limit, and whether the limit holds."""
    figures, limits = read_figures(name), limits_of(name)
    rows = [["figure", "measured", "limit", ""]]
    for key, limit in limits.items():
        value = figures.get(key)
        holds = isinstance(value, int | float) and limit.holds(value)
        rows.append(
            [
                key,
                f"{value:.6g}" if isinstance(value, int | float) else NO_FIGURE if key in figures else "-",
                format_limit(limit),
                "" if holds else "slow here" if is_time(key) else "FAILS",
            ]
        )
    return _table(rows)


def compare_worlds(one: str, other: str) -> str:
    """Return a table of the metrics and parameters that differ between two worlds."""
    first, second = read_figures(one), read_figures(other)
    rows = [["figure", one, other]]
    rows += [
        [key, _format_value(first.get(key)), _format_value(second.get(key))]
        for key in [*first, *(k for k in second if k not in first)]
        if first.get(key) != second.get(key)
    ]
    left, right = world_params(one), world_params(other)
    rows += [
        [key, _format_value(left.get(key)), _format_value(right.get(key))]
        for key in [*left, *(k for k in right if k not in left)]
        if left.get(key) != right.get(key)
    ]
    return _table(rows)


def world_params(name: str) -> dict[str, Any]:
    """Return the parameters that made a world, as a flat dict with dotted keys."""
    params: dict[str, Any] = {}
    for section in Config.model_fields:
        manifest = read_manifest(world_folder(name) / section / "manifest.json")
        params |= flatten({manifest.stage: manifest.params})
    return params


def changed_params(name: str, default: Config) -> dict[str, tuple[Any, Any]]:
    """Return the parameters of a world that differ from the default, as (default value, the world's value).

    What only the default's survey has, as the labels of its plan, is no parameter of this world.
    """
    before, now = flatten(default.model_dump(mode="json")), world_params(name)
    keys = [*now, *(key for key in before if key not in now and not key.startswith("survey."))]
    return {k: (before.get(k, "-"), now.get(k, "-")) for k in keys if before.get(k) != now.get(k)}


def _format_value(value: Any) -> str:
    text = f"{value:.6g}" if isinstance(value, float) else one_line(str(value))
    return text if len(text) <= 40 else text[:37] + "..."


def _table(rows: list[list[str]]) -> str:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )
