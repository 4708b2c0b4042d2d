"""The figures of the report's page: their values, meanings, limits and places."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import Any

from pipeline.metrics.limits import format_limit, is_time
from pipeline.params.validation import Limit
from pipeline.report.chart import ChartPlace
from pipeline.report.meanings import FigureGroup, group_of, meaning_of
from pipeline.report.results import NO_FIGURE, flat_walls_note

_PLACE = re.compile(r"\((-?[\d.]+), (-?[\d.]+), (-?[\d.]+)\)")  # in the mine frame, m


@dataclass(frozen=True)
class FigureLine:
    """A text of a figure, its number on the map, and its place there, m; empty if it has none."""

    text: str
    number: str = ""
    at: str = ""


@dataclass(frozen=True)
class FigureRow:
    """One measured figure with its meaning and its limit; `holds` is None if it has no limit, or is a time.

    A figure that is text has `lines` in place of a value.
    """

    name: str
    meaning: str
    value: str
    limit: str
    holds: bool | None
    lines: list[FigureLine] = field(default_factory=list)


def figures_of(metrics: dict[str, Any], limits: dict[str, Limit]) -> list[tuple[FigureGroup, list[FigureRow]]]:
    """Return all figures by group; figures with a limit come first."""
    groups: dict[FigureGroup, list[FigureRow]] = {}
    for key in sorted(metrics, key=lambda k: k not in limits):
        value, limit = metrics[key], limits.get(key)
        shown = f"{value:,.4g}" if isinstance(value, float) else f"{value:,}" if isinstance(value, int) else str(value)
        shown = NO_FIGURE if value is None else shown
        shown += flat_walls_note(metrics, key)
        stated = "" if limit is None else format_limit(limit) + (", depends on the machine" if is_time(key) else "")
        holds = None if limit is None or is_time(key) else isinstance(value, int | float) and limit.holds(value)
        figure = FigureRow(key, meaning_of(key), shown, stated, holds)
        if isinstance(value, str | list):
            is_list = isinstance(value, list)
            rows = enumerate(map(str, value if isinstance(value, list) else [value]), start=1)
            lines = [FigureLine(text, str(k) if is_list else "", _at(text)) for k, text in rows]
            figure = replace(figure, value=f"{len(lines)}, listed" if is_list else "", lines=lines)
        groups.setdefault(group_of(key), []).append(figure)
    return list(groups.items())


def _at(text: str) -> str:
    """Return the place of a text as `x,y`, m; empty if it has none."""
    found = _PLACE.search(text)
    return f"{found[1]},{found[2]}" if found else ""


def places_of(groups: list[tuple[FigureGroup, list[FigureRow]]]) -> list[ChartPlace]:
    """Return the places that have numbers on the map: those of figures that are lists."""
    lines = [line for _, figures in groups for figure in figures for line in figure.lines if line.number and line.at]
    places = []
    for line in lines:
        x, y = map(float, line.at.split(","))
        places.append(ChartPlace(int(line.number), x, y, line.text))
    return places
