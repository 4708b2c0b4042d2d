"""Fuzz every reader with broken and hostile files: it must return a result or an error message, and never crash."""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from benchmarks.fuzz_samples import HOSTILE, SAMPLES
from pipeline.errors import MineError
from pipeline.store.files import write_atomically

RESULTS, TABLE = Path("artifacts/bench/fuzz.json"), Path("docs/fuzz.md")
_HANG_S, _MEMORY = 10, 8_000_000_000
_NUMBERS = [b"-1", b"0", b"1e308", b"nan", b"inf", b"99999999999", b"-0.0", b"4294967296", b"1e-320", b"''"]


class _Hang(BaseException):
    """The time limit is exceeded. It is a BaseException so that no reader catches it."""


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


def cases(reader: str, count: int) -> list[dict[str, bytes]]:
    """Return a reader's inputs, hostile ones first. An input maps file names to bytes; the first file is read."""
    sample, rng = SAMPLES[reader](), np.random.default_rng(zlib.crc32(reader.encode()))
    inputs = [{**sample, **hostile} for hostile in HOSTILE.get(reader, [])]
    while len(inputs) < count:
        name = list(sample)[int(rng.integers(len(sample)))]
        inputs.append({**sample, name: mutate(sample[name], rng)})
    return inputs


def try_case(read: Callable[[Path], Any], files: dict[str, bytes], folder: Path) -> str:
    """Return `valid`, `refused`, `hang`, or the exception that is not a `MineError`."""
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    signal.signal(signal.SIGALRM, _stop)
    signal.alarm(_HANG_S)
    try:
        read(folder / next(iter(files)))
    except MineError as error:
        return "refused" if str(error) else "an empty message"
    except _Hang:
        return "hang"
    except Exception as error:  # every other exception is a finding
        return f"{type(error).__name__}: {str(error)[:200]}"
    finally:
        signal.alarm(0)
    return "valid"


def _stop(*_: object) -> None:
    raise _Hang


def _child(reader: str, first: int, count: int) -> None:
    """Run a reader's cases from `first` on and print the verdict of each."""
    from benchmarks.fuzz_readers import READERS

    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    os.environ["MINEXPLORE_FUZZ"] = "1"
    out = os.fdopen(os.dup(1), "w")
    with Path(os.devnull).open("w") as quiet:
        os.dup2(quiet.fileno(), 1)
        os.dup2(quiet.fileno(), 2)
    for number, files in list(enumerate(cases(reader, count)))[first:]:
        with tempfile.TemporaryDirectory() as parent:
            folder = Path(parent) / "in"
            folder.mkdir()
            start = time.perf_counter()
            verdict = try_case(READERS[reader], files, folder)
            if [p.name for p in Path(parent).iterdir()] != ["in"]:
                verdict = "a file outside its folder"
        print(json.dumps([number, verdict, round(time.perf_counter() - start, 3)]), file=out, flush=True)


def fuzz_reader(reader: str, count: int, progress: Callable[[int], object]) -> dict[str, Any]:
    """Run a reader's cases in a child process. After a case that kills the process, a new process continues."""
    verdicts: list[str] = []
    slowest, slow = 0.0, 0
    while len(verdicts) < count:
        command = [sys.executable, "-m", "benchmarks.fuzz", "--child", reader, str(len(verdicts)), str(count)]
        before = len(verdicts)
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
            assert child.stdout is not None
            for line in child.stdout:
                _, verdict, seconds = json.loads(line)
                verdicts.append(verdict)
                slowest, slow = max((slowest, slow), (seconds, len(verdicts) - 1))
                progress(1)
        if len(verdicts) < count:
            verdicts.append(f"crash (exit code {child.returncode})")
            progress(1)
            if len(verdicts) == before + 1 and before == 0:
                break
    good = {"valid", "refused"}
    return {
        "cases": len(verdicts),
        "valid": verdicts.count("valid"),
        "refused": verdicts.count("refused"),
        "slowest_s": slowest,
        "slowest_case": slow,
        "failed": {i: v for i, v in enumerate(verdicts) if v not in good},
    }


def table(results: dict[str, dict[str, Any]]) -> str:
    """Return the results as Markdown."""
    names = ("reader", "cases", "refused with a message", "valid", "failed", "slowest, s")
    lines = [f"| {' | '.join(names)} |", "|---" * len(names) + "|"]
    for reader, row in results.items():
        cells = (reader, row["cases"], row["refused"], row["valid"], len(row["failed"]), f"{row['slowest_s']:.1f}")
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines) + "\n"


def main() -> int:
    """Fuzz all readers; exit code 2 if one fails."""
    if sys.argv[1:2] == ["--child"]:
        _child(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
        return 0
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--readers", nargs="*", choices=list(SAMPLES), default=list(SAMPLES))
    arguments = parser.parse_args()
    results = {}
    with tqdm(total=arguments.count * len(arguments.readers), unit="case", disable=None) as bar:
        for reader in arguments.readers:
            bar.set_postfix_str(reader)
            results[reader] = fuzz_reader(reader, arguments.count, bar.update)
    write_atomically(RESULTS, (json.dumps(results, indent=1) + "\n").encode())
    print(table(results))
    failed = {f"{reader} {case}": v for reader, row in results.items() for case, v in row["failed"].items()}
    for case, verdict in failed.items():
        print(f"{case}: {verdict}")
    if not failed and arguments.readers == list(SAMPLES):
        head = (
            "# Fuzzing\n\nEvery reader is given broken and hostile files. Written by `make fuzz`. A case passes if it\n"
            "ends within 10 s with a result or a message, and leaves no file outside its folder. Other cases fail.\n\n"
        )
        write_atomically(TABLE, (head + table(results)).encode())
    return 2 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
