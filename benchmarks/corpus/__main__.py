"""Build the corpus: `make corpus`, or `python -m benchmarks corpus`. A run goes on where the last one stopped."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from datetime import date
from functools import partial
from pathlib import Path

from benchmarks.corpus.members import CASES, DEFAULT, CorpusMember, build_member, folder_of, generated, with_heights
from benchmarks.corpus.metadata import CorpusEntry, read_entry, require_ours, write_metadata
from pieces.run import map_pieces
from pieces.work import HERE, Where, Work, add_options, code_sha256, where_of
from pipeline.errors import ArtifactError, run_command

OUT = Path("artifacts/corpus")
MOST_MB = 400.0
_EACH, _WITH_HEIGHTS = 20, 20
_MEMORY_GB = 4.0  # of a surveyed mine with rock


def build(folder: Path, members: list[CorpusMember], where: Where = HERE) -> list[CorpusEntry]:
    """Build the members that the folder lacks, write what describes all of them, and return the entries.

    Raises
    ------
    ArtifactError
        If the folder has other files where this writes, the pipeline refuses a member, a certificate does not hold, or
        all are larger than `MOST_MB`.
    """
    require_ours(folder)  # before hours of building
    work = Work(
        "corpus",
        partial(build_member, folder, sum(not member.words for member in members if member != DEFAULT)),
        None,
        code_sha256("minesurveys", "minexplore", "pipeline", "stages", "benchmarks"),
        kept=None,  # the folder states what it has
        memory_gb=_MEMORY_GB,
        label=lambda member: member.name,
        folder=partial(folder_of, folder),
    )
    map_pieces(work, members, where)
    entries = [read_entry(folder, member) for member in members]
    broken = [entry.member.name for entry in entries if not entry.holds]
    if broken:
        raise ArtifactError(f"{folder}: the certificate of {', '.join(broken)} does not hold")
    write_metadata(folder, entries, _last_commit_date())
    size_mb = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 1e6
    if size_mb > MOST_MB:
        raise ArtifactError(f"{folder}: {size_mb:.0f} MB, limit {MOST_MB:g}")
    print(json.dumps({"worlds": len(entries), "certificates_hold": len(entries), "mb": round(size_mb, 1)}))
    return entries


def _last_commit_date() -> date:
    """Return the day of the project's last commit, which Croissant names as the date of publication."""
    done = subprocess.run(["git", "log", "-1", "--format=%cs"], capture_output=True, text=True)
    if done.returncode:
        raise ArtifactError("corpus: git knows no commit in this folder, whose date the corpus needs")
    return date.fromisoformat(done.stdout.strip())


def main() -> int:
    """Read the command line; exit code 2 with one line if a world cannot be built."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks corpus", description=__doc__)
    parser.add_argument("--out", type=Path, default=OUT)
    parser.add_argument("--each", type=int, default=_EACH, help="generated mines of each style")
    parser.add_argument("--heights", type=int, default=_WITH_HEIGHTS, help="generated mines with heights")
    add_options(parser)
    arguments = parser.parse_args()
    members = [DEFAULT, *CASES, *generated(arguments.each), *with_heights(arguments.heights)]
    where = where_of(arguments)
    return run_command("corpus", lambda: build(arguments.out, members, where), "interrupted; run it again to go on")


if __name__ == "__main__":
    sys.exit(main())
