"""Simple plans as level mines and as slabs, both without visible rock: which are clean, and their processor times."""

from __future__ import annotations

import resource
import sys
import tempfile
from pathlib import Path
from statistics import median

from benchmarks.judged_cases import JudgedCases
from benchmarks.results import Row
from benchmarks.simple_mines import HEIGHTS, made, random_mine

_WORDS: dict[str, list[str]] = {"level": [], "slab": ["--grade", "0"]}


def judge(seed: int) -> Row:
    """Return exit code, last message and processor time, s, of one plan built by both models."""
    mine = random_mine(seed)
    row: Row = {"kind": mine.kind}
    with tempfile.TemporaryDirectory() as folder:
        words = mine.write(Path(folder))
        for model, more in _WORDS.items():
            before = _processor_s()
            found = made(f"{model}-{seed}", [*words, *more, "preset=light"])
            row |= {f"{model}_s": _processor_s() - before, f"{model}_code": found["exit_code"]}
            if found["exit_code"]:
                row["message"] = f"{model}: {found['messages'][-1].strip()}"
    return row


def _processor_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def note(rows: list[Row]) -> str:
    """Return a line for each plan that is not built clean by both models."""
    return "\n".join(f"- plan {row['case']}, a {row['kind']}: {row['message']}" for row in rows if "message" in row)


SLABS = JudgedCases(
    name="simple-slabs",
    cases=[seed for seed in range(1000) if seed % HEIGHTS],
    sample=12,
    judge=judge,
    holds=lambda row: "message" not in row,
    groups=lambda row: [row["kind"]],
    of="kind",
    columns={
        "plans": len,
        "level: clean": lambda rows: sum(not row["level_code"] for row in rows),
        "slab: clean": lambda rows: sum(not row["slab_code"] for row in rows),
        "level, median s": lambda rows: f"{median(row['level_s'] for row in rows):.1f}",
        "slab, median s": lambda rows: f"{median(row['slab_s'] for row in rows):.1f}",
        "slab by level, median": lambda rows: f"{median(row['slab_s'] / row['level_s'] for row in rows):.2f}",
    },
    note=note,
    has_page=False,
)

if __name__ == "__main__":
    sys.exit(SLABS.run(__doc__))
