"""Processor time and size of light worlds by kilometre of drift, for mines of all four styles, on one core."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from tqdm import tqdm

from baselines.base.markdown import markdown_table, write_table
from minexplore.splits import STYLES
from pipeline.build.family import generated, make_member, without_rock
from pipeline.errors import ArtifactError

TABLE = Path("docs/evidence/parts/light-worlds.md")
_TAIL = """
A thousand mines take {thousand:.0f} min of two cores at this rate. Fifty of them pass the stress test, which takes
{stress:.1f} s more in the second mine.
"""


def measure(number: int, stress: bool = False) -> dict[str, Any]:
    """Build one mine of the training split in a temporary folder; return its style, drift, seconds and bytes.

    Raises
    ------
    ArtifactError
        If the mine cannot be built or its certificate does not hold.
    """
    member = without_rock(generated("train", number + 1, []), number + 1 if stress else 0)[number]
    root = Path(tempfile.mkdtemp(prefix="light-"))
    try:
        start = time.process_time()
        outcome = make_member(member, root)
        seconds = time.process_time() - start
        if outcome.problem:
            raise ArtifactError(f"{member.folder}: {outcome.problem}")
        network = json.loads((root / member.folder / "contours/topology.json").read_text())
        bundle = root / member.folder / "realism" / "world"
        return {
            "style": member.style,
            "drift_km": network["total_length_m"] / 1000,
            "seconds": seconds,
            "mb": sum(file.stat().st_size for file in bundle.iterdir()) / 1e6,
        }
    finally:
        shutil.rmtree(root, ignore_errors=True)


def table(rows: list[dict[str, Any]]) -> str:
    """Return mean drift, seconds and megabytes by style, and by kilometre, as Markdown."""
    cells = []
    for style in (*STYLES, None):
        some = [row for row in rows if style in (None, row["style"])]
        km, s, mb = (sum(row[key] for row in some) for key in ("drift_km", "seconds", "mb"))
        n, name = len(some), style.replace("_", " ") if style else "all"
        largest = max(row["mb"] for row in some)
        figures = (km / n, s / n, s / km, mb / n, mb / km, largest)
        cells.append((name, n, *(f"{figure:.2f}" for figure in figures)))
    titles = ("style", "mines", "drift, km", "s", "s per km", "MB", "MB per km", "largest, MB")
    return markdown_table(titles, cells)


def main() -> int:
    """Build the mines one after the other and write the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed.light_worlds", description=__doc__)
    parser.add_argument("--count", type=int, default=20, help="a multiple of four has as many mines of each style")
    count = parser.parse_args().count
    measure(3)
    start_s = time.process_time()
    rows = [measure(number) for number in tqdm(range(count), unit="mine", disable=None)]
    tested = measure(1, stress=True)["seconds"] - rows[1]["seconds"]
    mean_s = sum(row["seconds"] for row in rows) / len(rows)
    measured = f"Measured on {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} meanwhile; {start_s:.1f} s to start."
    text = f"{measured}\n\n{table(rows)}{_TAIL.format(thousand=(1000 * mean_s + 50 * tested) / 2 / 60, stress=tested)}"
    write_table(TABLE, text)
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
