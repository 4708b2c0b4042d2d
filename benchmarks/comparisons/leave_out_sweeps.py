"""Correct the published plan by all sweeps but one, and measure the one left out.

Writes `parts/corrected-plan.md` and `docs/corrected.jpg`. The plan's scale is that of the poses (docs/adr/0007).
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from shapely import Polygon

from baselines.base.markdown import markdown_table, write_table
from benchmarks.resume import run_benchmark
from pipeline.compose import compose
from pipeline.report.figures.corrected import draw_corrected
from pipeline.report.results import shrink_picture
from pipeline.scans.correct import Correction, Sweeps, correct_by_bias, measure_bias, place_sweeps, read_sweeps
from pipeline.scans.registration import Pose
from pipeline.scans.sweep_correction import cast_fan, caster_of
from pipeline.stage import make_artifacts
from pipeline.store.codecs import decode, encode
from pipeline.store.files import write_atomically
from pipeline.store.mine_survey import open_survey
from pipeline.types import Survey, Workings
from stages.__main__ import load_stages

PAGE, PICTURE = Path("docs/evidence/parts/corrected-plan.md"), Path("docs/corrected.jpg")
_PX_PER_M = 7.62
_PLAN = ["survey=plan", "survey.poses=null", "survey.scale.source=stated", f"survey.scale.px_per_m={_PX_PER_M}"]
_COLUMNS = (
    *("sweep left out", "its own bias, m", "bias of the others, m", "as drawn, m", "corrected by the others, m"),
    *("ratio", "as drawn, placed anew, m", "ratio"),
)
_TRACE = ["contours.trace=half_level"]


def trace_plan() -> tuple[Polygon, Survey]:
    """Return the published plan's workings as traced, without correction, and its survey."""
    config = compose([*_PLAN, *_TRACE])
    with tempfile.TemporaryDirectory() as folder:
        for stage in load_stages()[:2]:
            make_artifacts(stage, getattr(config, stage.name), Path(folder))
        traced = decode(Path(folder) / "contours/traced/workings.geojson", Workings)
        return traced.polygons.geoms[0], open_survey(Path(folder) / "survey/mine").survey


def median_error_m(free: Polygon, sweeps: Sweeps, name: str, pose: Pose) -> float:
    """Return the median range error of one sweep at a pose."""
    bearing, measured = sweeps.counted[name]
    return float(np.median(np.abs(cast_fan(caster_of(free), pose, bearing) - measured)))


def leave_each_out(drawn: Polygon, sweeps: Sweeps, bias_of: dict[str, float]) -> list[dict]:
    """Return for each sweep its median range errors in the plan as drawn and as the other sweeps correct it."""
    placed, rows = place_sweeps(drawn, sweeps).poses, []
    for name in sweeps.poses:
        others = {other: bias for other, bias in bias_of.items() if other != name}
        corrected = correct_by_bias(drawn, sweeps, sweeps.without(name), others)
        pose = place_sweeps(corrected.polygon, sweeps).poses[name]
        rows.append(
            {
                "sweep": name,
                "bias_m": corrected.report.bias_m,
                "drawn_own_m": median_error_m(drawn, sweeps, name, placed[name]),
                "drawn_same_m": median_error_m(drawn, sweeps, name, pose),
                "corrected_m": median_error_m(corrected.polygon, sweeps, name, pose),
            }
        )
    return rows


def tables(rows: list[dict], correction: Correction) -> str:
    """Return the figures as Markdown."""
    report = correction.report
    low, high = report.bias_interval_m
    halved = [sum(row["corrected_m"] <= 0.5 * row[key] for row in rows) for key in ("drawn_same_m", "drawn_own_m")]
    return (
        f"All four sweeps: walls are drawn {report.bias_m:.2f} m too far out ({low:.2f} to {high:.2f} m when each "
        f"sweep is left out). {sum(report.followed_m.values()):.0f} m of wall follow the sweeps.\n\n"
        f"{markdown_table(_COLUMNS, (_cells(row, report.bias_of_sweep_m[row['sweep']]) for row in rows))}\n"
        f"At the same place the median error falls to at most half in {halved[0]} of {len(rows)} sweeps; "
        f"placed anew in the plan as drawn, in {halved[1]}."
    )


def _cells(row: dict, own_bias_m: float) -> list[object]:
    same, own = (row["corrected_m"] / row[key] for key in ("drawn_same_m", "drawn_own_m"))
    errors = (f"{row[key]:.3f}" for key in ("drawn_same_m", "corrected_m"))
    ratios = (f"{same:.2f}", f"{row['drawn_own_m']:.3f}", f"{own:.2f}")
    return [row["sweep"], f"{own_bias_m:.2f}", f"{row['bias_m']:.2f}", *errors, *ratios]


def main() -> int:
    """Measure and write the page and the picture."""
    drawn, survey = trace_plan()
    poses = compose(["survey=plan", "survey.correct=sweeps"]).contours.poses
    assert poses is not None
    files = {name: Path(file) for name, file in poses.sweeps.items()}
    sweeps = read_sweeps(Path(poses.file), files, poses.max_range_m, poses.max_range_var_m2)
    bias_of = measure_bias(drawn, sweeps)
    correction = correct_by_bias(drawn, sweeps, sweeps, bias_of)
    text = tables(leave_each_out(drawn, sweeps, bias_of), correction)
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "corrected.png"
        picture.write_bytes(encode(picture, draw_corrected(drawn, correction, survey.frame)))
        write_atomically(PICTURE, shrink_picture(picture))
    write_table(PAGE, text)
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(run_benchmark("leave-out-sweeps", main))
