"""The results table and the pictures of the docs, made from the artifacts of the stages."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2

from minexplore.sealed.json_text import describe_json_error
from pipeline.errors import ArtifactError
from pipeline.metrics.limits import flatten, format_limit
from pipeline.metrics.rock.paper import PAPER
from pipeline.metrics.rock.relief import OCTAVES_M, STEEP_DEG
from pipeline.metrics.rock.texture import AXES, WINDOWS_M, is_uninformative
from pipeline.params.validation import Limit, ValidationParams
from pipeline.store.files import write_atomically
from pipeline.store.hashing import read_text_file
from pipeline.store.manifest import read_params

VALIDATION = Path("artifacts/validation")
TIMINGS = "timings.json"  # in the folder of the metrics
RESULTS, README, PICTURE_FOLDER = Path("docs/evidence/results.md"), Path("README.md"), Path("docs")
PICTURES = {
    "world.jpg": Path("artifacts/realism/world/preview.png"),
    "contours.jpg": Path("artifacts/contours/evidence/contours.png"),
    "views.jpg": VALIDATION / "evidence/views.png",
    "texture.jpg": VALIDATION / "evidence/texture.png",
    "heat.jpg": VALIDATION / "evidence/heat.png",
    "roughness.jpg": Path("artifacts/surface/evidence/roughness.png"),
    "sections.jpg": Path("artifacts/surface/evidence/sections.png"),
}
_OPEN, _CLOSE = "<!-- results -->", "<!-- /results -->"
_PICTURE_WIDTH = 1200
_HUGE = 1e300
HEIGHT_TITLES = {
    "from_0_cm_to_50_cm": "below 0.5 m",
    "from_50_cm_to_150_cm": "0.5 to 1.5 m",
    "from_150_cm_up": "above 1.5 m",
}
NO_FIGURE = "no figure"  # some need more wall than a small mine has


@dataclass(frozen=True)
class MetricRow:
    """One row of the table: title, metrics, their format, and whether the README shows the row too."""

    title: str
    metrics: tuple[str, ...]
    form: str
    headline: bool = False


def _row(title: str, metric: str, form: str, headline: bool = False) -> MetricRow:
    return MetricRow(title, (metric,), form, headline)


ROWS = [
    _row("IoU, free space, rendered, vs cleaned plan", "iou.free_space_vs_cleaned", ".4f", headline=True),
    _row("IoU, free space, vs raw binarized plan", "iou.free_space_vs_raw", ".4f"),
    _row("IoU, rock", "iou.rock", ".4f"),
    MetricRow(
        "against the cleaned plan: rock in its free space, m2 / share of it / rock that is missing, m2",
        ("against_plan.rock_in_free_m2", "against_plan.rock_in_free_share", "against_plan.missing_rock_m2"),
        ".4g",
        headline=True,
    ),
    MetricRow(
        "wall error, built against traced, mean / 99th percentile / max, m",
        ("wall_error.mean_m", "wall_error.p99_m", "wall_error.max_m"),
        ".3f",
    ),
    _row("wall error, traced against drawn, mean, m", "wall_error.drawn_mean_m", ".3f"),
    _row("free columns of the cleaned plan, one a pixel", "navigability.columns", ",d"),
    MetricRow(
        "of those, blocked deeper in the plan than the tolerance at its walls / within it",
        ("navigability.blocked", "navigability.blocked_at_wall"),
        ",d",
        headline=True,
    ),
    _row("the deepest of those, m from the plan's wall", "navigability.deepest_blocked_m", ".3f"),
    MetricRow("loops, plan / world", ("topology.loops_plan", "topology.loops_world"), "d"),
    MetricRow("drifts lost / added", ("topology.drifts_lost", "topology.drifts_added"), "d", headline=True),
    _row("tunnel, m2", "areas.tunnel_m2", ",.0f"),
    _row("islands, m2", "areas.islands_m2", ",.0f"),
    _row("outside, m2", "areas.outside_m2", ",.0f"),
    _row("convex collision parts", "collision.parts", "d", headline=True),
    _row("collision in the outline of the bundle: deepest, mm", "certificate.intrusion_mm", ".1f", headline=True),
    _row("rock of that outline without collision: widest circle, mm", "certificate.missing_mm", ".1f"),
    _row("containment certificate holds", "certificate.holds", "d", headline=True),
    _row("texture, published score, overall", "texture.published.overall", ".3f", headline=True),
    _row("- standard deviation between sets of eight stretches", "texture.spread.published", ".3f"),
    *(_row(f"- {axis.title}", f"texture.published.{name}", ".3f") for name, axis in AXES.items()),
    _row("texture, strict score, overall", "texture.strict.overall", ".3f", headline=True),
    _row("- standard deviation between sets of eight stretches, strict", "texture.spread.strict", ".3f"),
    _row("sets of eight stretches whose mean is given", "texture.draws", "d"),
    *(_row(f"- {axis.title}, strict", f"texture.strict.{name}", ".3f") for name, axis in AXES.items()),
    _row("bump Rq, mean of 0.5 m voxels, model / real", "texture.bump_ratio", ".3f"),
    MetricRow(
        "Rq over all points in voxels of " + " / ".join(f"{w:g}" for w in WINDOWS_M) + " m, model / real",
        tuple(f"texture.rq_ratio.at_{100 * w:.0f}_cm" for w in WINDOWS_M),
        ".2f",
    ),
    MetricRow(
        "area of walls more than 20 / 40 deg off the plan's wall",
        tuple(f"relief.steep_share.above_{least}_deg" for least in STEEP_DEG),
        ".2f",
    ),
    *(
        MetricRow(
            f"- {title}",
            tuple(f"relief.steep_share_by_height.{band}.above_{least}_deg" for least in STEEP_DEG),
            ".2f",
        )
        for band, title in HEIGHT_TITLES.items()
    ),
    _row("area in flat faces of 0.05 m2 and more", "relief.flat_face_share", ".2f"),
    MetricRow(
        "length of the walls' level cut at 1.0 / 1.5 m over the plan's walls",
        ("relief.cut.at_100_cm.length_ratio", "relief.cut.at_150_cm.length_ratio"),
        ".2f",
    ),
    MetricRow(
        "slope of the walls' spectrum at 1.0 m height, 0.2-0.5 / 0.5-1 / 1-2 m",
        tuple(f"relief.cut.at_100_cm.slope.from_{100 * a:.0f}_cm_to_{100 * b:.0f}_cm" for a, b in OCTAVES_M),
        ".2f",
    ),
    MetricRow(
        "visible to collision wall, m, median / p95 / max at 0.5 m height, then at 5 cm",
        tuple(f"walls.{at}gap_{name}_m" for at in ("", "at_5_cm.") for name in ("median", "p95", "max")),
        ".2f",
        headline=True,
    ),
    _row("narrowest passage, clear width kept", "walls.narrowest_kept", ".3f"),
    _row("drifts, m", "topology.drift_m", ",.0f"),
    _row("rock on walls and roof, m2", "per_m2.rock_m2", ",.0f"),
    _row("convex collision parts beyond two a corner, per metre of wall", "collision.parts_per_wall_m", ".3f"),
    _row("bundle beyond 1.1 MB, bytes per m2 of rock", "per_m2.bytes", ",.0f"),
    _row("bundle, MB", "world.bytes", "MB", headline=True),
    _row("MjModel load, the first in a process, s", "world.first_load_s", ".2f", headline=True),
    _row("MjModel load, again, s", "world.load_s", ".2f"),
    _row("MjModel load, peak of memory, MB", "world.load_memory_mb", ",.0f"),
    _row("MjModel load, again, beyond 0.05 s, per m2 of rock, s", "per_m2.load_s", ".2e"),
    _row("MjModel load, peak of memory beyond 60 MB, per m2 of rock, MB", "per_m2.load_memory_mb", ".4f"),
]


def read_metrics(folder: Path = VALIDATION) -> dict[str, Any]:
    """Return the flat metrics of a world, and its load times if they were measured on the same world.

    Raises
    ------
    ArtifactError
        If a file is missing or not JSON.
    """
    metrics, certificate = _read_json(folder / "metrics.json"), _read_json(folder / "certificate.json")
    timings = folder / TIMINGS
    loads = flatten(_read_json(timings)) if timings.is_file() else {}  # `dvc checkout` restores no timings
    return metrics | (loads if loads.pop("world_sha256", None) == certificate.get("world_sha256") else {})


def _read_json(path: Path) -> dict[str, Any]:
    """Return a file of figures as a flat dict: numbers, truth values, printable text, and lists."""
    try:
        content = json.loads(read_text_file(path))
        flat = flatten(content) if isinstance(content, dict) else {}
    except FileNotFoundError:
        raise ArtifactError(f"{path}: missing; stage 6 writes it (`make all`)") from None
    except (ValueError, RecursionError) as error:
        raise ArtifactError(f"{path}: {describe_json_error(error)}; stage 6 writes it anew (`make all`)") from error
    if not flat:
        raise ArtifactError(f"{path}: want a mapping of figures, not {content!r:.40}")
    for name, value in flat.items():
        if not (_is_plain(value) and name.isprintable()):
            raise ArtifactError(f"{path}: {name[:80]!r} = {value!r:.80}: not a figure")
    return flat


def _is_plain(value: Any) -> bool:
    """Return whether a value of a file can be shown: None, a number below 10^300, printable text, or a list."""
    if isinstance(value, int | float):
        return abs(value) < _HUGE  # also false for nan
    return value is None or isinstance(value, list) or (isinstance(value, str) and value.isprintable())


def read_limits(folder: Path = VALIDATION) -> dict[str, Limit]:
    """Return the limits of a world's metrics by name, with those of the certificate's clauses."""
    params = read_params(folder / "manifest.json", ValidationParams)
    return {**params.limits, **{f"certificate.{name}": limit for name, limit in params.certificate.limits.items()}}


def write_results() -> str:
    """Write the page of results, its headline rows to the README, and the pictures; return the table."""
    for name, source in PICTURES.items():
        write_atomically(PICTURE_FOLDER / name, shrink_picture(source))
    metrics, limits = read_metrics(), read_limits()
    text = results_table(ROWS, metrics, limits)
    header = "# Results\n\nThe embedded survey, as measured by `make all`; written by `make report`.\n\n"
    write_atomically(RESULTS, (header + text).encode())
    headlines = results_table([row for row in ROWS if row.headline], metrics, limits)
    before, _, rest = README.read_text().partition(_OPEN)
    write_atomically(README, f"{before}{_OPEN}\n{headlines}{_CLOSE}{rest.partition(_CLOSE)[2]}".encode())
    return text


def shrink_picture(source: Path) -> bytes:
    """Return a picture as JPEG, 1200 px wide, for the docs."""
    picture = cv2.imread(str(source))
    if picture is None:
        raise ArtifactError(f"{source}: missing; run `make all` first")
    size = (_PICTURE_WIDTH, round(picture.shape[0] * _PICTURE_WIDTH / picture.shape[1]))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes()


def flat_walls_note(metrics: Mapping[str, Any], name: str) -> str:
    """Return a remark with the score of flat walls for a texture score; an empty text for other metrics."""
    flat = metrics.get(name.replace("texture.", "texture.flat_walls.", 1))
    if flat is None or not name.startswith("texture.") or ".flat_walls." in name:
        return ""
    return f" (flat walls {flat:.3f}{': uninformative' if is_uninformative(flat) else ''})"


def results_table(rows: list[MetricRow], metrics: Mapping[str, Any], limits: Mapping[str, Limit]) -> str:
    """Return rows as a Markdown table with the measured value, the limit and the paper's value.

    A row with a value beyond its limit is marked. Stage 6 lets only load times be so.

    Raises
    ------
    ArtifactError
        If the load times of this world were not measured.
    """
    if "world.load_s" not in metrics:
        raise ArtifactError(f"{TIMINGS}: no load times of this world; `python -m stages.validation` measures them")
    lines = ["| figure | measured | limit | paper |", "|---|---|---|---|"]
    for row in rows:
        measured = " / ".join(_format(metrics.get(name, "-"), row.form) for name in row.metrics)
        note = flat_walls_note(metrics, row.metrics[0]) if len(row.metrics) == 1 else ""
        limit = " / ".join(_format_limit(limits[name], row.form) for name in row.metrics if name in limits)
        limit += " (missed)" * any(_is_beyond(metrics.get(name), limits.get(name)) for name in row.metrics)
        paper = " / ".join(str(PAPER[name]) for name in row.metrics if name in PAPER)
        lines.append(f"| {row.title} | {measured}{note} | {limit} | {paper or '-'} |")
    return "\n".join(lines) + "\n"


def _is_beyond(value: Any, limit: Limit | None) -> bool:
    return limit is not None and isinstance(value, int | float) and not limit.holds(value)


def _format(value: float | str | None, form: str) -> str:
    if value is None:
        return NO_FIGURE
    if isinstance(value, str):
        return value
    return f"{value / 1e6:.2f}" if form == "MB" else format(value, form)


def _format_limit(limit: Limit, form: str) -> str:
    if form == "MB":
        limit = Limit(**{k: v / 1e6 for k, v in limit.model_dump().items() if v is not None})
    return format_limit(limit)
