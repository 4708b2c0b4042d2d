"""Fuzz every reader with broken and hostile files.

A case passes if it ends in time and within the limit on memory, with a result or an error message of our own words.
Time is that of the processors: other work on the machine does not count.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fuzzing.builders import Files
from benchmarks.fuzzing.case_alarm import Alarm, HangError
from benchmarks.fuzzing.hostile import HOSTILE
from benchmarks.fuzzing.library_words import library_words
from benchmarks.fuzzing.samples import SAMPLES
from benchmarks.judged_cases import JudgedCases, largest
from benchmarks.results import Row
from minesurveys.errors import UnexpectedError
from pipeline.errors import MineError

_COUNT = 10  # cases of a reader, hostile ones first
Case = tuple[str, Callable[[], Files]]  # its name, and the function that makes its files
_MEMORY = 4_000_000_000
_NUMBERS = [b"-1", b"0", b"1e308", b"nan", b"inf", b"99999999999", b"-0.0", b"4294967296", b"1e-320", b"''"]


@dataclass(frozen=True)
class TimeLimits:
    """Most processor time of a case, s, and the time by the clock after which it is ended, s."""

    processor_s: float
    clock_s: float


_BROKEN = TimeLimits(10.0, 55.0)  # a reader that sleeps is ended by the clock before its own limit of 60 s
_HOSTILE = TimeLimits(70.0, 120.0)  # a hostile file may use the whole limit of 60 s


@dataclass(frozen=True)
class CaseOutcome:
    """What became of a case: `valid`, `refused` or what is wrong with the reader; its processor time, s."""

    verdict: str
    seconds: float


def mutate(data: bytes, rng: np.random.Generator) -> bytes:
    """Return a broken copy: truncated, with bits flipped, pieces removed, repeated or moved, or numbers replaced."""
    if not data:
        return rng.bytes(int(rng.integers(64)))
    at, end = sorted(rng.integers(len(data) + 1, size=2).tolist())
    match int(rng.integers(8)):
        case 0:
            return data[:at]
        case 1:
            broken = bytearray(data)
            for place in rng.integers(len(data), size=int(rng.integers(1, 24))).tolist():
                broken[place] ^= 1 << int(rng.integers(8))
            return bytes(broken)
        case 2:
            return data[:at] + rng.bytes(int(rng.integers(1, 64))) + data[at:]
        case 3:
            return data[:at] + data[end:]
        case 4:
            return data[:end] + data[at:end] * int(rng.integers(1, 6)) + data[end:]
        case 5:
            return data[:at] + bytes(end - at) + data[end:]
        case 6:
            words = data.split(b" ")
            words[int(rng.integers(len(words)))] = _NUMBERS[int(rng.integers(len(_NUMBERS)))]
            return b" ".join(words)
        case _:
            lines = data.split(b"\n")
            one, other = rng.integers(len(lines), size=2).tolist()
            lines[one], lines[other] = lines[other], lines[one]
            return b"\n".join(lines)


def cases(reader: str, count: int) -> list[Case]:
    """Return a reader's cases, hostile ones first: name, and the function that makes its files.

    Files are bytes by name; the first file is read.
    """
    sample = SAMPLES[reader]()
    hostile = HOSTILE.get(reader, {})

    def broken(number: int) -> Files:
        rng = np.random.default_rng([zlib.crc32(reader.encode()), number])
        name = list(sample)[int(rng.integers(len(sample)))]
        return {**sample, name: mutate(sample[name], rng)}

    listed: list[Case] = [(name, partial(_replaced, sample, make)) for name, make in hostile.items()]
    listed += [(f"broken {i}", partial(broken, i)) for i in range(count - len(listed))]
    return listed[:count]


def _replaced(sample: Files, make: Callable[[], Files]) -> Files:
    return {**sample, **make()}


def try_case(read: Callable[[Path], Any], files: Files, folder: Path, limits: TimeLimits) -> CaseOutcome:
    """Write a case's files, read the first, and judge what comes of it."""
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    start = sum(os.times()[:4])  # of this process and of those that it ended
    verdict = _verdict(read, folder / next(iter(files)), limits)
    seconds = sum(os.times()[:4]) - start
    if seconds > limits.processor_s and verdict in ("valid", "refused"):
        verdict = f"{seconds:.1f} s of the processors"
    return CaseOutcome(verdict, seconds)


def _verdict(read: Callable[[Path], Any], path: Path, limits: TimeLimits) -> str:
    """Return `valid`, `refused`, `hang`, or the exception that the reader does not name."""
    signal.signal(signal.SIGALRM, Alarm(limits.processor_s))
    signal.setitimer(signal.ITIMER_REAL, limits.clock_s)
    try:
        read(path)
    except UnexpectedError as error:
        return error.detail[-300:]
    except MineError as error:
        return _judge(str(error))
    except HangError:
        return "hang"
    except Exception as error:  # every other exception is a finding
        return f"{type(error).__name__}: {str(error)[:200]}"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    return "valid"


def _judge(message: str) -> str:
    """Return `refused` for a message of one line in our own words."""
    if not message or "\n" in message:
        return f"not one line: {message[:200]}"
    words = library_words(message)
    return f"a library's words, {', '.join(words)}: {message[:200]}" if words else "refused"


def _child(reader: str, first: int, count: int) -> None:
    """Run a reader's cases from `first` on and print the verdict, time and peak memory of each."""
    from benchmarks.fuzzing.readers import READERS, registry_beside

    out = os.fdopen(os.dup(1), "w")
    with Path(os.devnull).open("w") as quiet:
        os.dup2(quiet.fileno(), 1)
        os.dup2(quiet.fileno(), 2)
    for number, (name, make) in list(enumerate(cases(reader, count)))[first:]:
        with tempfile.TemporaryDirectory() as parent:
            folder = Path(parent) / "data"
            folder.mkdir()
            registry_beside(folder)
            files = make()
            trial = try_case(READERS[reader], files, folder, _BROKEN if name.startswith("broken") else _HOSTILE)
            verdict = trial.verdict
            if [p.name for p in Path(parent).iterdir()] != ["data"] or len(list(folder.iterdir())) != len(files) + 1:
                verdict = "a file was left behind"
        peak = 1024 * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
        if peak > _MEMORY:
            verdict = f"{peak / 1e9:.1f} GB of memory"
        print(json.dumps([number, name, verdict, round(trial.seconds, 3), peak]), file=out, flush=True)


def fuzz_reader(reader: str, count: int = _COUNT) -> Row:
    """Run a reader's cases in a child process. After a case that kills the process, a new process continues."""
    verdicts: list[tuple[str, str]] = []
    slowest, peak = (0.0, ""), 0
    while len(verdicts) < count:
        command = [sys.executable, "-m", "benchmarks.fuzz", "--child", reader, str(len(verdicts)), str(count)]
        before = len(verdicts)
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
            assert child.stdout is not None
            for line in child.stdout:
                number, name, verdict, seconds, memory = json.loads(line)
                verdicts.append((f"{number} ({name})", verdict))
                slowest, peak = max(slowest, (seconds, name)), max(peak, memory)
        if len(verdicts) < count:
            verdicts.append((str(len(verdicts)), f"crash (exit code {child.returncode})"))
            if len(verdicts) == before + 1 and before == 0:
                break
    found = [verdict for _, verdict in verdicts]
    return {
        "cases": len(verdicts),
        "hostile": len(HOSTILE.get(reader, {})),
        "valid": found.count("valid"),
        "refused": found.count("refused"),
        "slowest_s": slowest[0],
        "slowest_case": slowest[1],
        "peak_bytes": peak,
        "failed": {name: verdict for name, verdict in verdicts if verdict not in ("valid", "refused")},
    }


FUZZ = JudgedCases(
    name="fuzz",
    cases=list(SAMPLES),
    judge=fuzz_reader,
    holds=lambda row: not row["failed"],
    groups=lambda row: [row["case"]],
    of="reader",
    with_all=False,
    columns={
        "cases": largest("cases"),
        "hostile": largest("hostile"),
        "refused with a message": largest("refused"),
        "valid": largest("valid"),
        "failed": lambda rows: len(rows[0]["failed"]),
        "memory, GB": largest("peak_bytes", ".1f", 1e-9),
        "slowest, CPU s": largest("slowest_s", ".1f"),
        "slowest case": lambda rows: rows[0]["slowest_case"],
    },
)

if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        _child(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
    else:
        sys.exit(FUZZ.run(__doc__))
