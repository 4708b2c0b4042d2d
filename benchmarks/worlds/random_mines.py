"""Build worlds from pictures of generated mines with narrow, rough drifts, and check them.

Mines of all four styles are drawn at 10 px/m, by turns anti-aliased, in black and white, and as JPEG.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from baselines.base.markdown import markdown_table, write_table
from benchmarks.resume import resume
from minexplore.splits import STYLES
from pipeline.compose import compose
from pipeline.proof.validator import Validator
from pipeline.stage import make_artifacts
from pipeline.store.codecs import decode
from pipeline.types import FreeSpace, Mask, Survey, Workings
from stages.__main__ import load_stages

RESULTS, TABLE = Path("artifacts/bench/random-mines-drawn.jsonl"), Path("docs/evidence/parts/random-mines.md")
_WALL_ERROR_M = 0.031  # the limit of conf/mine/own.yaml
_COLUMNS = ("style", "mines", "pass", "wall error, m", "parts per metre of wall", "lowest IoU", "area, m2", "loops")
_DRAWN = {
    "anti-aliased": [],
    "black and white": ["survey.anti_aliased=false"],
    "JPEG": ["survey.jpeg_quality=80"],
}
_ROUGH = "{rms_m: 0.06, hurst: 0.75, shortest_m: 0.3, longest_m: 6.0}"
_PICTURE = [
    "survey.as_picture=true",
    "survey.px_per_m=10",
    "survey.mine.width_m=[2.5,3.5]",
    f"survey.rough_walls={_ROUGH}",
]
# Without visible rock, because this benchmark checks the collision walls; all checks of stage 6 but those of rock.
_CHECKS = [
    "preset=light",
    "validation.extent=full",
    "validation.certificate.contacts=100",
    "validation.certificate.limits.contacts={min: 1}",
    "validation.certificate.limits.escapes={max: 0}",
    "validation.certificate.limits.deepest_m={max: 0.10}",
]


def judge(seed: int) -> dict[str, Any]:
    """Build one mine's world in a temporary folder and return the results of its checks."""
    style, drawn = STYLES[seed % len(STYLES)], list(_DRAWN)[seed // len(STYLES) % len(_DRAWN)]
    root = Path(tempfile.mkdtemp(prefix="mine-"))
    row: dict[str, Any] = {"seed": seed, "style": style, "drawn": drawn}
    try:
        own = [f"survey.seed={seed}", f"survey.mine.style={style}", *_DRAWN[drawn]]
        config = compose(["survey=procedural", *_PICTURE, *own, *_CHECKS])
        for stage in load_stages()[:-1]:
            make_artifacts(stage, getattr(config, stage.name), root)
        free = decode(root / "contours/free_space.geojson", FreeSpace)
        cleaned, raw = (decode(root / f"contours/{name}.png", Mask) for name in ("cleaned", "raw"))
        survey = decode(root / "survey/survey.json", Survey)
        traced = decode(root / "contours/traced.geojson", Workings).polygons.geoms[0]
        validator = Validator(config.validation, root / "realism/world", cleaned, raw, survey, traced=traced)
        topology = validator.measure("topology")
        return row | {
            "valid": bool(free.polygon.is_valid),
            "connected": topology["components_world"] == 1 and topology["loops_difference"] == 0,
            "certificate": bool(validator.certificate.holds),
            "wall_error_m": validator.wall_error.mean_m,
            "parts_per_wall_m": round(validator.measure("collision")["parts"] / free.polygon.length, 4),
            "iou": round(float(validator.measure("iou")["free_space_vs_cleaned"]), 5),
            "area_m2": round(free.polygon.area),
            "loops": topology["loops_world"],
        }
    except Exception as error:  # this mine fails and the others continue
        return row | {"problem": f"{type(error).__name__}: {error}"}
    finally:
        shutil.rmtree(root, ignore_errors=True)


def holds(row: dict[str, Any]) -> bool:
    """Return whether a mine passes all checks."""
    return all(row.get(key) for key in ("valid", "connected", "certificate")) and row["wall_error_m"] <= _WALL_ERROR_M


def table(rows: list[dict[str, Any]]) -> str:
    """Return the results by style as Markdown."""
    rows_of_table = []
    for style in (*STYLES, None):
        some = [row for row in rows if style in (None, row["style"])]
        measured = [row for row in some if "iou" in row]
        if not measured:
            continue
        low, high = (f([row["area_m2"] for row in measured]) for f in (min, max))
        most = max(row["loops"] for row in measured)
        name = style.replace("_", " ") if style else "all"
        worst = min(row["iou"] for row in measured)
        error, parts = (max(row[key] for row in measured) for key in ("wall_error_m", "parts_per_wall_m"))
        passed = sum(map(holds, some))
        checks = (len(some), passed, f"{error:.3f}", f"{parts:.2f}", f"{worst:.4f}")
        rows_of_table.append((name, *checks, f"{low:,} to {high:,}", f"up to {most}"))
    return markdown_table(_COLUMNS, rows_of_table)


def _rows(wanted: list[int], jobs: int) -> Iterator[dict[str, Any]]:
    with ProcessPoolExecutor(jobs) as pool:
        yield from (done.result() for done in as_completed([pool.submit(judge, seed) for seed in wanted]))


def main() -> int:
    """Build and check the mines that have no result yet; exit code 2 if one fails."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.worlds.random_mines", description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    rows = resume(RESULTS, range(arguments.count), lambda seeds: _rows(seeds, arguments.jobs), "mine")
    text = table(rows)
    write_table(TABLE, text)
    print(text)
    failed = [row for row in sorted(rows, key=lambda r: r["seed"]) if not holds(row)]
    for row in failed:
        print(row)
    return 2 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
