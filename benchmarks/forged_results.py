"""Give the scorer forged results files: it must neither crash nor take long nor accept figures that were not driven."""

from __future__ import annotations

import argparse
import json
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from baselines.bounds import bound_of
from baselines.errors import BaselineError, RejectedError
from baselines.rerun import compare
from baselines.result_file import RESULTS, Episode, Head, read_results
from baselines.score import check
from baselines.statistics import figures
from benchmarks.forgery import forge

TABLE = Path("artifacts/bench/forged_results.json")
LIMIT_S, LIMIT_BYTES = 10.0, 1_000_000_000
# Processor time, as a machine may be busy; a file that only waits is noticed by the clock.
_TIMERS = ((signal.SIGPROF, signal.ITIMER_PROF, LIMIT_S), (signal.SIGALRM, signal.ITIMER_REAL, 12 * LIMIT_S))
READ, CHECKED, DRIVEN = "refused when read", "rejected by the mine", "rejected when driven again"
EQUAL, ACCEPTED, CRASHED, LATE = "accepted, equal figures", "accepted, other figures", "crashed", "took too long"


class _Late(BaseException):
    """A file took longer than the limit. It is a BaseException so that no reader catches it."""


@dataclass
class Tally:
    """What became of the files, and what they cost."""

    counts: Counter[str] = field(default_factory=Counter)
    slowest_s: float = 0.0
    failures: list[str] = field(default_factory=list)
    gained: float = 0.0  # the greatest rise of final coverage in a file that only driving again rejects

    @property
    def peak_bytes(self) -> int:
        """Return the most memory that this process has held."""
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024

    def holds(self) -> bool:
        """Return whether no file crashed the scorer, exceeded a limit, or was accepted with other figures."""
        return not any(self.counts[kind] for kind in (ACCEPTED, CRASHED, LATE)) and self.peak_bytes < LIMIT_BYTES


def judge(data: bytes, head: Head, honest: list[Episode], file: Path, tally: Tally) -> str:
    """Return what becomes of a forged copy of an honest file; the honest episodes are what driving again gives."""
    file.write_bytes(data)
    begun, outcome = time.process_time(), READ
    for kind, timer, limit in _TIMERS:
        signal.signal(kind, _interrupt)
        signal.setitimer(timer, limit)
    try:
        claimed, episodes = read_results(file)
        outcome = CHECKED
        check(file, claimed, episodes)
        outcome = EQUAL
        if _figures(claimed, episodes) != _figures(head, honest):
            outcome = DRIVEN
            gain = sum(e.seen[-1] for e in episodes) / sum(e.seen[-1] for e in honest) - 1
            compare(file, claimed, episodes, honest)
            outcome = ACCEPTED
    except RejectedError:
        if outcome == DRIVEN:
            tally.gained = max(tally.gained, gain)
    except BaselineError:
        pass
    except _Late:
        outcome = LATE
    except Exception:
        outcome = CRASHED
        tally.failures.append(traceback.format_exc())
    finally:
        for _, timer, _ in _TIMERS:
            signal.setitimer(timer, 0)
    tally.slowest_s = max(tally.slowest_s, time.process_time() - begun)
    tally.counts[outcome] += 1
    return outcome


def _interrupt(kind: int, frame: object) -> None:
    raise _Late


def _figures(head: Head, episodes: list[Episode]) -> dict[str, Any]:
    return dict(figures(head, episodes, bound_of(head.env, head.world_sha256))) | {"policy": head.policy}


def main() -> int:
    """Forge the kept results or those named, and print what became of them; exit code 1 if any got through."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.forged_results", description=__doc__)
    parser.add_argument("results", nargs="*", type=Path, help="honest files; those of the entrance by default")
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    honest = []
    for path in arguments.results or sorted(RESULTS.glob("ChileanMineEntrance-v0/*.jsonl")):
        head, episodes = read_results(path)
        check(path, head, episodes)
        honest.append((head, episodes))
    tally = Tally()
    with tempfile.TemporaryDirectory() as folder:
        for number in tqdm(range(arguments.count), desc="forged results", disable=None):
            rng = np.random.default_rng([arguments.seed, number])
            head, episodes = honest[number % len(honest)]
            outcome = judge(forge(head, episodes, rng), head, episodes, Path(folder) / "forged.jsonl", tally)
            if outcome in (ACCEPTED, CRASHED, LATE):
                print(f"file {number}: {outcome}", *tally.failures[-1:], file=sys.stderr)
    for kind in (READ, CHECKED, DRIVEN, EQUAL, ACCEPTED, CRASHED, LATE):
        print(f"{tally.counts[kind]:6} {kind}")
    print(f"slowest {tally.slowest_s:.2f} s of processor time, most memory {tally.peak_bytes / 1e6:.0f} MB in all")
    print(f"as stated, a file that only driving again rejects claims up to {tally.gained:.1%} more final coverage")
    TABLE.parent.mkdir(parents=True, exist_ok=True)
    facts = {"counts": dict(tally.counts), "slowest_s": tally.slowest_s, "peak_bytes": tally.peak_bytes}
    TABLE.write_text(json.dumps({**facts, "files": arguments.count, "gained": tally.gained}, indent=1) + "\n")
    return 0 if tally.holds() else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except BaselineError as error:
        print(f"forged results: {error}", file=sys.stderr)
        sys.exit(2)
