"""Files that state something beside their coordinates, read as by `new --dry-run`: right values beside ours.

The files are not part of the project: `python -m benchmarks stated-files FOLDER` takes the folder that holds them and
leaves out those that it lacks. Right values are those of the program that the format belongs to, or of the one that
wrote the file.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from baselines.base.markdown import markdown_table
from minesurveys.remarks import collect_remarks
from pipeline.build.dry_run import DryRun, dry_run
from pipeline.commands.options import add_options, stated_options
from pipeline.errors import MineError
from pipeline.store.files import write_atomically
from pipeline.types import DrawnFloors, SurveyedLegs

TABLE = Path("artifacts/bench/stated-files.md")
_NAME = "stated"
_SHOWN = 110  # characters of a refusal


def _area(found: DryRun) -> str:
    if found.workings is None:
        return _size(found)
    return f"{np.count_nonzero(found.workings) / found.made.survey.frame.px_per_m**2:.0f} m2"


def _size(found: DryRun) -> str:
    """Return how far the workings reach east and north; of one volume, its stations or its mesh, and up."""
    shape: Any = found.made.shape
    if found.workings is None:
        mesh = shape.mesh if isinstance(shape, DrawnFloors) else shape
        of_legs = isinstance(shape, SurveyedLegs)
        points, what = (shape.positions_m, " of stations") if of_legs else (mesh.vertices, "")
        return " x ".join(f"{span:.1f}" for span in np.ptp(points, axis=0)) + f" m{what}"
    spans = [np.ptp(at) + 1 for at in np.nonzero(found.workings)]
    return " x ".join(f"{span / found.made.survey.frame.px_per_m:.1f}" for span in reversed(spans)) + " m"


def _heights(found: DryRun) -> str:
    heights: Any = found.made.survey.heights
    z = [place[2] for place in heights.spots] + [place[2] for line in heights.lines for place in line]
    return f"{min(z) + heights.datum_m:.1f} to {max(z) + heights.datum_m:.1f} m"


@dataclass(frozen=True)
class Case:
    """A file, the words of `new`, what is measured of it, and the right value; without a measure it is refused."""

    file: str
    words: tuple[str, ...]
    measure: Callable[[DryRun], str] | None
    right: str


CASES = (
    Case("heights-plan.geojson", ("--heights", "heights-half.tif"), _heights, "394.0 to 400.0 m"),
    Case("feet-by-crs.las", (), _size, "22.0 x 18.7 m"),
    Case("plan-userunit1.pdf", ("--scale", "1:500"), _size, "100.0 m east"),
    Case("plan-userunit2.pdf", ("--scale", "1:500"), _size, "100.0 m east, as the other"),
    Case("clipped-int32.las", (), None, "refused: 25 % of the Y records are 2147483647"),
    Case("therion-gps-sd.th", (), _size, "e1 to e2 100.0 m, and the passages' width"),
    Case("survex-gps-sd.svx", (), _size, "e1 to e2 100.0 m, and the passages' width"),
    Case("typo-loop.svx", (), _size, "built; a remark: the loop misses by 20.0 m in 180 m"),
    Case("duplicate-tie.svx", (), _area, "one piece"),
    Case("entrance-equated.svx", (), _area, "mine.1 is the entrance"),
    Case("survex-floating.svx", (), None, "refused: mine.lower.1, and what to do"),
    Case("therion-no-data-line.th", ("--half-width", "1"), _size, "legs of 40 m east and 40 m north, 2 m wide"),
    Case("map-alpha.yaml", (), _area, "304 m2"),
    Case("map-ascii100.yaml", (), _area, "304 m2"),
    Case("nan-points.pcd", (), _area, "280 m2; 200 of 10,000 points are NaN"),
    Case("polygon-mesh-tube.dxf", ("--volume",), _size, "60 x 4 x 3.2 m"),
    Case("total-station.csv", (), None, "refused: the way from these columns to ours"),
)


def judge(case: Case, folder: Path) -> tuple[str, str, str, str]:
    """Return the file, the right value, ours, and the first remark on what the file states."""
    words = [str(folder / word) if (folder / word).is_file() else word for word in case.words]
    parser = argparse.ArgumentParser()
    add_options(parser)
    stated = stated_options(folder / case.file, parser.parse_args(words))
    with collect_remarks() as remarks:
        try:
            found = dry_run(_NAME, folder / case.file, stated, [])
            ours = case.measure(found) if case.measure else "read"
        except MineError as error:
            ours = f"refused: {str(error).replace(f'{folder}/', '')[:_SHOWN]}"
    first = remarks[0].line()[:_SHOWN] if remarks else ""
    return f"{case.file} {' '.join(case.words)}".strip(), case.right, ours, first


def main() -> int:
    """Read the files of a folder; print the table and write it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks stated-files", description=__doc__)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    present = [case for case in CASES if (folder / case.file).is_file()]
    if not present:
        print(f"stated-files: {folder}: holds none of {', '.join(case.file for case in CASES)}", file=sys.stderr)
        return 2
    text = markdown_table(("file", "right", "ours", "first remark"), [judge(case, folder) for case in present])
    write_atomically(TABLE, text.encode())
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
