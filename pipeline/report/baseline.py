"""The regression gate's baseline, and the results table: figures in prose come from these files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2

from pipeline.errors import ArtifactError
from pipeline.metrics.limits import flatten
from pipeline.metrics.texture import WINDOWS_M, is_uninformative
from pipeline.store.files import write_atomically

METRICS = Path("artifacts/validation/metrics.json")
TIMINGS = "timings.json"  # beside the metrics
BASELINE = Path("tests/baseline.json")
RESULTS = Path("docs/results.md")
PICTURES = {
    "world.jpg": Path("artifacts/realism/world/preview.png"),
    "contours.jpg": Path("artifacts/contours/contours.png"),
    "views.jpg": Path("artifacts/validation/views.png"),
    "texture.jpg": Path("artifacts/validation/texture.png"),
    "heat.jpg": Path("artifacts/validation/heat.png"),
    "roughness.jpg": Path("artifacts/surface/roughness.png"),
    "sections.jpg": Path("artifacts/surface/sections.png"),
}
README = Path("README.md")
_OPEN, _CLOSE = "<!-- results -->", "<!-- /results -->"
_PICTURE_WIDTH = 1200
_GATED = ("iou.", "texture.published.", "texture.strict.")
IOU_DROP, TEXTURE_DROP = 0.002, 0.01

_ROWS = [
    ("IoU, free space, rendered, vs cleaned plan", "iou.free_space_vs_cleaned", ".4f", ">= 0.990", "0.9538"),
    ("IoU, free space, vs raw binarised plan", "iou.free_space_vs_raw", ".4f", ">= 0.970", "-"),
    ("IoU, rock", "iou.rock", ".4f", "", "-"),
    ("free columns tested", "navigability.columns", ",d", "", "-"),
    ("blocked columns", "navigability.blocked", "d", "0", '"none"'),
    ("columns that simplification moved into the wall", "navigability.blocked_at_wall", ",d", "", "-"),
    ("the deepest of those, m from the plan's wall", "navigability.deepest_blocked_m", ".3f", "", "-"),
    ("loops, plan / world", ("topology.loops_plan", "topology.loops_world"), "d", "equal", "1"),
    ("drifts lost / added", ("topology.drifts_lost", "topology.drifts_added"), "d", "0 / 0", "-"),
    ("tunnel, m2", "areas.tunnel_m2", ",.0f", "", "104,423"),
    ("islands, m2", "areas.islands_m2", ",.0f", "", "14,577"),
    ("outside, m2", "areas.outside_m2", ",.0f", "", "-"),
    ("convex collision parts", "collision.parts", "d", "<= 800", "1,186"),
    ("collision in the free space, m2", "certificate.intrusion_m2", ".4f", "< 0.01", "-"),
    ("rock without collision, m2", "certificate.missing_m2", ".4f", "< 0.01", "-"),
    ("containment certificate holds", "certificate.holds", "d", "1", "-"),
    ("texture, published score, overall", "texture.published.overall", ".3f", ">= 0.95", "0.794"),
    ("- wall jaggedness", "texture.published.wall_jaggedness_deg", ".3f", ">= 0.90", "0.976"),
    ("- bump Rq", "texture.published.bump_rq_m", ".3f", ">= 0.90", "0.819"),
    ("- roughness scale integral", "texture.published.roughness_integral_m2", ".3f", ">= 0.90", "0.798"),
    ("- dominant wavelength", "texture.published.dominant_wavelength_m", ".3f", ">= 0.90", "0.994"),
    ("- ceiling irregularity", "texture.published.ceiling_irregularity_m", ".3f", ">= 0.90", "0.509"),
    ("- wall heterogeneity", "texture.published.wall_heterogeneity_m", ".3f", ">= 0.90", "0.778"),
    ("texture, strict score, overall", "texture.strict.overall", ".3f", ">= 0.80", "about 0.29"),
    ("bump Rq, mean of 0.5 m voxels, model / real", "texture.bump_ratio", ".3f", "0.85 to 1.15", "0.36"),
    (
        "Rq over all points in voxels of " + " / ".join(f"{w:g}" for w in WINDOWS_M) + " m, model / real",
        tuple(f"texture.rq_ratio.at_{100 * w:.0f}_cm" for w in WINDOWS_M), ".2f", "", "-",
    ),
    ("visible to collision wall at 0.5 m height, median / p95 / max, m",
     ("walls.gap_median_m", "walls.gap_p95_m", "walls.gap_max_m"), ".2f", "0.15 / 0.35 / 0.60", "-"),
    ("narrowest passage, clear width kept", "walls.narrowest_kept", ".3f", ">= 0.95", "-"),
    ("bundle, MB", "world.bytes", "MB", "<= 60", "about 800"),
    ("MjModel load, the first in a process, s", "world.first_load_s", ".3f", "-", "< 10"),
    ("MjModel load, again, s", "world.load_s", ".3f", "<= 2", "< 10"),
]  # fmt: skip


def read_metrics(path: Path = METRICS) -> dict[str, Any]:
    """Return a world's flat metrics, with its load times where those beside them were measured in the same world.

    Raises
    ------
    ArtifactError
        If a file is missing or not JSON.
    """
    metrics, certificate = _read_json(path), _read_json(path.with_name("certificate.json"))
    timings = path.with_name(TIMINGS)
    loads = flatten(_read_json(timings)) if timings.is_file() else {}  # `dvc checkout` brings none
    return metrics | (loads if loads.pop("world_sha256", None) == certificate["world_sha256"] else {})


def _read_json(path: Path) -> dict[str, Any]:
    try:
        return flatten(json.loads(path.read_text()))
    except FileNotFoundError:
        raise ArtifactError(f"{path}: missing; stage 6 writes it (`make all`)") from None
    except ValueError as error:
        raise ArtifactError(f"{path}: not JSON: {error}") from error


def gated(metrics: dict[str, float]) -> dict[str, float]:
    """Return the metrics that the gate compares: IoU and texture scores."""
    return {k: v for k, v in metrics.items() if k.startswith(_GATED)}


def regressions(metrics: dict[str, float], baseline: dict[str, float]) -> list[str]:
    """Return one line for each gated metric that fell by more than its allowance, or is gone."""
    lines = []
    for name, before in baseline.items():
        allowed = TEXTURE_DROP if name.startswith("texture.") else IOU_DROP
        now = metrics.get(name)
        if now is None or now < before - allowed:
            lines.append(f"{name}: {now} fell by more than {allowed} from {before}")
    return lines


def accept_baseline() -> str:
    """Write the present gated metrics to the baseline and say what changed."""
    now = gated(read_metrics())
    before = json.loads(BASELINE.read_text()) if BASELINE.is_file() else {}
    write_atomically(BASELINE, (json.dumps(now, indent=2) + "\n").encode())
    return "\n".join(f"{name}: {before.get(name, '-')} -> {value}" for name, value in now.items())


def write_results() -> str:
    """Write the results table to `docs/` and into the README, and the pictures they show; return the table."""
    for name, source in PICTURES.items():
        write_atomically(RESULTS.with_name(name), shrink_picture(source))
    text = results_table(read_metrics())
    header = "# Results\n\nThe embedded survey, as measured by `make all`; written by `make report`.\n\n"
    write_atomically(RESULTS, (header + text).encode())
    before, _, rest = README.read_text().partition(_OPEN)
    write_atomically(README, (before + _OPEN + "\n" + text + _CLOSE + rest.partition(_CLOSE)[2]).encode())
    return text


def shrink_picture(source: Path) -> bytes:
    """Return a picture as a JPEG of the width that the docs show."""
    picture = cv2.imread(str(source))
    if picture is None:
        raise ArtifactError(f"{source}: missing; run `make all` first")
    size = (_PICTURE_WIDTH, round(picture.shape[0] * _PICTURE_WIDTH / picture.shape[1]))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes()


def flat_walls_note(metrics: dict[str, Any], name: str) -> str:
    """Return what flat walls score on a texture axis, to stand behind its score; nothing for other figures."""
    group, _, axis = name.partition(".")
    flat = metrics.get(f"{group}.flat_walls.{axis}")
    if flat is None:
        return ""
    return f" (flat walls {flat:.3f}{': uninformative' if is_uninformative(flat) else ''})"


def results_table(metrics: dict[str, float]) -> str:
    """Return flat metrics as the Markdown table of the README.

    Raises
    ------
    ArtifactError
        If the load times of this world were not measured.
    """
    if "world.load_s" not in metrics:
        raise ArtifactError(f"{TIMINGS}: no load times of this world; `python -m stages.validation` measures them")
    lines = ["| figure | measured | limit | paper |", "|---|---|---|---|"]
    for title, names, form, limit, paper in _ROWS:
        values = [metrics[name] for name in ([names] if isinstance(names, str) else names)]
        shown = " / ".join(f"{v / 1e6:.2f}" if form == "MB" else format(v, form) for v in values)
        shown += flat_walls_note(metrics, names) if isinstance(names, str) else ""
        lines.append(f"| {title} | {shown} | {limit} | {paper} |")
    return "\n".join(lines) + "\n"
