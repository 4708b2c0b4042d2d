"""`python -m benchmarks NAME [ARGUMENTS]` runs one measurement; without a name it prints the table of them.

`python -m benchmarks stale` lists the pages of evidence that are older than the code, and `evidence` renews them.
"""

from __future__ import annotations

import argparse
import difflib
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from functools import partial
from pathlib import Path

from benchmarks import CALLERS_ENVIRONMENT
from benchmarks.freshness import OUT_OF_TIME, begin, renew, stale, stamp
from benchmarks.judged_cases import CODE
from benchmarks.measurements import BENCHMARKS, Benchmark
from pipeline.errors import run_command

ROOT = Path(__file__).resolve().parents[1]
STALE, RENEW = COMMANDS = ("stale", "evidence")
_GRACE_S = 60.0  # in which an interrupted measurement ends


def table() -> str:
    """Return the table of the measurements."""
    named = ((b.name, "" if b.minutes is None else f"{b.minutes:g}", b.needs, b.writes) for b in BENCHMARKS)
    rows = [("name", "minutes", "after make", "writes"), *named]
    return "\n".join(f"{a:17} {b:>7}  {c:16} {d}".rstrip() for a, b, c, d in rows)


def environment_of(benchmark: Benchmark) -> dict[str, str]:
    """Return the caller's environment with the project's Python first on the path."""
    path = f"{ROOT / '.venv' / 'bin'}{os.pathsep}{CALLERS_ENVIRONMENT.get('PATH', os.defpath)}"
    return {**CALLERS_ENVIRONMENT, "PATH": path, **({"OMP_NUM_THREADS": "1"} if benchmark.one_thread else {})}


def run_until(command: list[str], environment: dict[str, str], until: float | None) -> int:
    """Run a command in the project's folder and return its exit code, `OUT_OF_TIME` if it was ended.

    Its process group is interrupted at `until`, of `time.monotonic`, and when this process is interrupted.
    """
    taking = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # a job in the background ignores it
    process = subprocess.Popen(command, cwd=ROOT, env=environment, process_group=0, preexec_fn=taking)
    try:
        return process.wait(None if until is None else max(until - time.monotonic(), 0.0))
    except subprocess.TimeoutExpired:
        return OUT_OF_TIME
    finally:
        if process.poll() is None:
            _interrupt(process)


def _interrupt(process: subprocess.Popen[bytes]) -> None:
    """Interrupt a process group, and kill what is left of it after a minute."""
    os.killpg(process.pid, signal.SIGINT)
    try:
        with suppress(subprocess.TimeoutExpired):
            process.wait(_GRACE_S)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def measure(benchmark: Benchmark, words: list[str], until: float | None = None) -> int:
    """Run a measurement; state on the pages that it wrote by which code; return its exit code."""
    environment = environment_of(benchmark)
    code = run_until(["make", "-s", benchmark.needs], environment, until)
    if code:
        return code
    before = begin(benchmark, ROOT)
    command = f"trap 'exit 130' INT; {benchmark.command}"  # an interrupted shell waits for the measurement's end
    code = run_until(["sh", "-ec", command, benchmark.name, *words], {**environment, CODE: before.code}, until)
    stamp(before, ROOT)
    return code


def main(words: list[str]) -> int:
    """Print the table, list or renew what is stale, or run a measurement; exit code 2 if there is none of that name."""
    if not words or words[0] in ("-h", "--help"):
        print(table())
        return 0
    if words[0] == STALE:
        return stale(ROOT)
    if words[0] == RENEW:
        parser = argparse.ArgumentParser(prog="python -m benchmarks evidence", description="Renew what is stale.")
        parser.add_argument("--budget", type=_hours, metavar="2h", help="go on for so long at most")
        budget_h = parser.parse_args(words[1:]).budget
        return renew(ROOT, budget_h, lambda benchmark, until: measure(benchmark, [], until))
    found = {b.name: b for b in BENCHMARKS}.get(words[0])
    if found is None:
        near = difflib.get_close_matches(words[0], [b.name for b in BENCHMARKS])
        hint = f"nearest names: {', '.join(near)}; " if near else ""
        print(f"benchmarks: no measurement {words[0]!r}; {hint}`python -m benchmarks` lists them", file=sys.stderr)
        return 2
    return measure(found, words[1:])


def _hours(text: str) -> float:
    """Return the hours that `2h`, `90m` or a number of hours states."""
    found = re.fullmatch(r"(\d+(?:\.\d+)?)([hm]?)", text)
    if found is None:
        raise argparse.ArgumentTypeError(f"{text!r}: want hours, as 2h, or minutes, as 90m")
    return float(found[1]) / (60 if found[2] == "m" else 1)


def _end(words: list[str]) -> None:
    sys.exit(main(words))


if __name__ == "__main__":
    sys.exit(run_command("benchmarks", lambda: _end(sys.argv[1:])))
