"""The rows of decision 29's gate: for each figure its names in both models, and what is wanted of the volume."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.metrics.limits import format_limit
from pipeline.metrics.rock.texture import AXES
from pipeline.params.validation import Limit
from stages.__main__ import STAGES

NONE = "not measured"
_AXES = ("overall", *AXES)
_EQUAL = 1e-9  # of figures that are rounded to six digits


@dataclass(frozen=True)
class Wish:
    """What is wanted of the volume: the text, and whether a figure holds, of all level figures and the volume's own."""

    text: str
    holds: Callable[[Mapping[str, Any], float, float], bool]


@dataclass(frozen=True)
class GateRow:
    """One row: title, names of the figure in a level world and in a volume, what is wanted, and its format."""

    title: str
    level: str
    volume: str
    wanted: Wish | None = None
    form: str = ",.4g"


def at_most(most: float) -> Wish:
    """Return the wish for no more than a number."""
    return Wish(f"at most {most:g}", lambda _, level, volume: volume <= most)


def at_least(least: float) -> Wish:
    """Return the wish for no less than a number."""
    return Wish(f"at least {least:g}", lambda _, level, volume: volume >= least)


def at_most_times(times: float) -> Wish:
    """Return the wish for no more than so many times the level model's figure."""
    return Wish(f"at most {times:g} times", lambda _, level, volume: volume <= times * level)


def at_least_times(times: float) -> Wish:
    """Return the wish for no less than so many times the level model's figure."""
    return Wish(f"at least {times:g} times", lambda _, level, volume: volume >= times * level)


def within_spread(reading: str) -> Wish:
    """Return the wish for no less than the level model's score less its spread between draws."""
    spread = f"texture.spread.{reading}"
    return Wish("less than its spread below", lambda found, level, volume: volume >= level - found[spread])


_MORE = Wish("not less", lambda _, level, volume: volume >= level - _EQUAL)
_LESS = Wish("not more", lambda _, level, volume: volume <= level + _EQUAL)


def _row(title: str, name: str, wanted: Wish | None = None, form: str = ",.4g") -> GateRow:
    return GateRow(title, name, name, wanted, form)


def _times(kind: str, title: str) -> list[GateRow]:
    wishes = {"compile3d": at_most_times(1.5), "all": at_most_times(1.0)} if kind == "processor_s" else {}
    return [
        _row(f"{title}, {'all stages' if name == 'all' else name}, s", f"{kind}.{name}", wishes.get(name), ",.1f")
        for name in (*STAGES, "all")
    ]


ROWS = [
    _row("collision parts, with floor and roof", "parts", at_most(300), ",.0f"),
    *_times("processor_s", "processor time"),
    *_times("wall_s", "time of the clock"),
    _row("largest memory of a stage, MB", "peak_mb", at_most_times(1.0), ",.0f"),
    _row("bundle, MB", "bundle_mb", at_most(25.0), ".2f"),
    _row("IoU, free space with the cleaned plan", "iou.free_space_vs_cleaned", _MORE, ".6f"),
    _row("IoU, free space with the raw plan", "iou.free_space_vs_raw", _MORE, ".6f"),
    _row("IoU, rock", "iou.rock", _MORE, ".6f"),
    GateRow("intrusion of parts, mm", "certificate.intrusion_mm", "enclosure.intrusion_mm", _LESS),
    GateRow("missing rock, level; gap, volume; mm", "certificate.missing_mm", "enclosure.gap_mm", _LESS),
    _row("columns blocked, beyond the tolerance at walls", "columns.blocked", _LESS, ",.0f"),
    _row("columns blocked, at walls", "columns.blocked_at_wall", _LESS, ",.0f"),
    _row("certificate holds", "certificate.holds", at_least(1)),
    *(
        _row(
            f"{reading} axes, {axis.replace('_', ' ')}",
            f"texture.{reading}.{axis}",
            within_spread(reading) if axis == "overall" else None,
            ".4f",
        )
        for reading in ("published", "strict")
        for axis in _AXES
    ),
    _row("cut at 1 m, length by the wall's", "relief.cut.at_100_cm.length_ratio", None, ".3f"),
    GateRow(
        "visible width of the narrowest passage, of its own",
        "walls.narrowest_kept",
        "rock.narrowest_kept",
        at_least(0.95),
        ".4f",
    ),
    _row("faces of visible rock", "rock_faces", None, ",.0f"),
    _row("steps/s of one robot", "steps.one", at_least_times(0.95), ",.0f"),
    _row("steps/s of 64 robots, spread over the mine", "steps.spread", at_least_times(0.95), ",.0f"),
    _row("steps/s of 64 robots, at the entrance", "steps.entrance", at_least_times(0.95), ",.0f"),
]


def row_of(
    row: GateRow, level: Mapping[str, Any], volume: Mapping[str, Any], shipped: Mapping[str, Any]
) -> tuple[str, ...]:
    """Return the cells of a row: figure, wanted, level, volume, ratio, met, and the level model as it ships."""
    one, two, three = level.get(row.level), volume.get(row.volume), shipped.get(row.level)
    cells = [NONE if value is None else format(value, row.form) for value in (one, two, three)]
    wanted = row.wanted.text if row.wanted else ""
    if one is None or two is None:
        return row.title, wanted, *cells[:2], "", NONE if row.wanted else "", cells[2]
    met = "" if row.wanted is None else "yes" if row.wanted.holds(level, one, two) else "**no**"
    return row.title, wanted, *cells[:2], f"{two / one:.2f}" if one else "", met, cells[2]


def clause_rows(model: str, clauses: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Return the cells of a certificate's clauses: model, clause, limit, value, holds."""
    return [
        (
            model,
            name,
            format_limit(Limit(**clause["limit"])),
            f"{clause['value']:g}",
            "yes" if clause["holds"] else "**no**",
        )
        for name, clause in clauses.items()
    ]
