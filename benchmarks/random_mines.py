"""Build worlds from generated mines of all four styles, and check validity, connectivity, certificate and IoU."""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from tqdm import tqdm

from minexplore.splits import STYLES
from pipeline.compose import compose
from pipeline.proof.validator import Validator
from pipeline.stage import make_artifacts
from pipeline.store.codecs import decode
from pipeline.store.files import write_atomically
from pipeline.types import FreeSpace, Mask, Survey
from stages.__main__ import load_stages

RESULTS, TABLE = Path("artifacts/bench/random-mines.jsonl"), Path("docs/random-mines.md")
_IOU = 0.99
# The rough surface is coarse, because this benchmark checks the collision walls and not the texture.
_COARSE = ["surface.rough.spacing_m=0.5", "surface.rough.roof_spacing_m=0.5", "validation.certificate.contacts=100"]


def judge(seed: int) -> dict[str, Any]:
    """Build one mine's world in a temporary folder and return the results of its checks."""
    style = STYLES[seed % len(STYLES)]
    root = Path(tempfile.mkdtemp(prefix="mine-"))
    row: dict[str, Any] = {"seed": seed, "style": style}
    try:
        config = compose(["survey=procedural", f"survey.seed={seed}", f"survey.mine.style={style}", *_COARSE])
        for stage in load_stages()[:-1]:
            make_artifacts(stage, getattr(config, stage.name), root)
        free = decode(root / "contours/free_space.geojson", FreeSpace)
        cleaned, raw = (decode(root / f"contours/{name}.png", Mask) for name in ("cleaned", "raw"))
        survey = decode(root / "survey/survey.json", Survey)
        validator = Validator(config.validation, root / "realism/world", cleaned, raw, survey)
        topology = validator.measure("topology")
        return row | {
            "valid": bool(free.polygon.is_valid),
            "connected": topology["components_world"] == 1 and topology["loops_difference"] == 0,
            "certificate": bool(validator.certificate.holds),
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
    return all(row.get(key) for key in ("valid", "connected", "certificate")) and row["iou"] >= _IOU


def table(rows: list[dict[str, Any]]) -> str:
    """Return the results by style as Markdown."""
    lines = ["| style | mines | pass | lowest IoU | area, m2 | loops |", "|---|---|---|---|---|---|"]
    for style in (*STYLES, None):
        some = [row for row in rows if style in (None, row["style"])]
        measured = [row for row in some if "iou" in row]
        if not measured:
            continue
        low, high = (f([row["area_m2"] for row in measured]) for f in (min, max))
        most = max(row["loops"] for row in measured)
        name = style.replace("_", " ") if style else "all"
        worst = min(row["iou"] for row in measured)
        passed = sum(map(holds, some))
        lines.append(f"| {name} | {len(some)} | {passed} | {worst:.4f} | {low:,} to {high:,} | up to {most} |")
    return "\n".join(lines) + "\n"


def _rows(wanted: list[int], jobs: int) -> Iterator[dict[str, Any]]:
    with ProcessPoolExecutor(jobs) as pool:
        yield from (done.result() for done in as_completed([pool.submit(judge, seed) for seed in wanted]))


def main() -> int:
    """Build and check the mines that have no result yet; exit code 2 if one fails."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.random_mines", description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(line) for line in RESULTS.read_text().splitlines()] if RESULTS.is_file() else []
    wanted = sorted(set(range(arguments.count)) - {row["seed"] for row in rows})
    with RESULTS.open("a") as log:
        for row in tqdm(_rows(wanted, arguments.jobs), total=len(wanted), unit="mine", disable=None):
            rows.append(row)
            log.write(json.dumps(row) + "\n")
            log.flush()
    text = table(rows)
    head = (
        "# Random mines\n\nWorlds built from generated mines, written by `make random-mines`. A mine passes if its\n"
        "free space is valid, its world has one component with the plan's loops, the containment certificate holds,\n"
        "and IoU is at least 0.99.\n\n"
    )
    write_atomically(TABLE, (head + text).encode())
    print(text)
    failed = [row for row in sorted(rows, key=lambda r: r["seed"]) if not holds(row)]
    for row in failed:
        print(row)
    return 2 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
