"""Build worlds from pictures of generated mines with narrow, rough drifts, and check them.

Mines of all four styles are drawn at 10 px/m, by turns anti-aliased, in black and white, and as JPEG.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from benchmarks.judged_cases import JudgedCases, largest, least, span
from benchmarks.results import Row
from minexplore.splits import STYLES
from pipeline.compose import compose
from pipeline.proof.validator import Validator
from pipeline.stage import make_artifacts
from pipeline.store.codecs import decode
from pipeline.store.mine_survey import open_survey
from pipeline.types import FreeSpace, Mask, Workings
from stages.__main__ import load_stages

_WALL_ERROR_M = 0.031  # the limit of conf/mine/own.yaml
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


def judge(seed: int) -> Row:
    """Build one mine's world in a temporary folder and return the results of its checks, or the problem."""
    style, drawn = STYLES[seed % len(STYLES)], list(_DRAWN)[seed // len(STYLES) % len(_DRAWN)]
    row: Row = {"style": style, "drawn": drawn}
    try:
        with tempfile.TemporaryDirectory(prefix="mine-") as folder:
            return row | _checks(seed, style, drawn, Path(folder))
    except Exception as error:  # this mine fails and the others continue
        return row | {"problem": f"{type(error).__name__}: {error}"}


def _checks(seed: int, style: str, drawn: str, root: Path) -> Row:
    own = [f"survey.seed={seed}", f"survey.mine.style={style}", *_DRAWN[drawn]]
    config = compose(["survey=procedural", *_PICTURE, *own, *_CHECKS])
    for stage in load_stages()[:-1]:
        make_artifacts(stage, getattr(config, stage.name), root)
    free = decode(root / "contours/free_space.geojson", FreeSpace)
    cleaned, raw = (decode(root / f"contours/{name}.png", Mask) for name in ("cleaned", "raw"))
    survey = open_survey(root / "survey/mine").survey
    traced = decode(root / "contours/traced/workings.geojson", Workings).polygons.geoms[0]
    validator = Validator(config.validation, root / "realism/world", cleaned, raw, survey, traced=traced)
    topology = validator.measure("topology")
    return {
        "valid": bool(free.polygon.is_valid),
        "connected": topology["components_world"] == 1 and topology["loops_difference"] == 0,
        "certificate": bool(validator.certificate.holds),
        "wall_error_m": validator.wall_error.mean_m,
        "parts_per_wall_m": round(validator.measure("collision")["parts"] / free.polygon.length, 4),
        "iou": round(float(validator.measure("iou")["free_space_vs_cleaned"]), 5),
        "area_m2": round(free.polygon.area),
        "loops": topology["loops_world"],
    }


def holds(row: Row) -> bool:
    """Return whether a mine passes all checks."""
    return all(row.get(key) for key in ("valid", "connected", "certificate")) and row["wall_error_m"] <= _WALL_ERROR_M


RANDOM_MINES = JudgedCases(
    name="random-mines",
    cases=range(1000),
    sample=24,
    judge=judge,
    holds=holds,
    groups=lambda row: [row["style"].replace("_", " ")],
    of="style",
    columns={
        "mines": len,
        "pass": lambda rows: sum(map(holds, rows)),
        "wall error, m": largest("wall_error_m", ".3f"),
        "parts per metre of wall": largest("parts_per_wall_m", ".2f"),
        "lowest IoU": least("iou", ".4f"),
        "area, m2": span("area_m2", ",.0f"),
        "loops": lambda rows: f"up to {largest('loops')(rows)}",
    },
)

if __name__ == "__main__":
    sys.exit(RANDOM_MINES.run(__doc__))
