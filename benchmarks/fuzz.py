"""Throw broken and hostile files at every reader: an error message or a valid result, never a crash, a hang, a leak."""

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
    """Time is up; no reader catches it."""


def mutate(data: bytes, rng: np.random.Generator) -> bytes:
    """Return a broken copy: cut off, bits flipped, pieces lost, doubled or moved, numbers made absurd."""
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
    """Return a reader's inputs: file name to bytes, the first of which is read; hostile ones first."""
    sample, rng = SAMPLES[reader](), np.random.default_rng(zlib.crc32(reader.encode()))
    made = [{**sample, **hostile} for hostile in HOSTILE.get(reader, [])]
    while len(made) < count:
        name = list(sample)[int(rng.integers(len(sample)))]
        made.append({**sample, name: mutate(sample[name], rng)})
    return made


def try_case(read: Callable[[Path], Any], files: dict[str, bytes], room: Path) -> str:
    """Return `valid`, `refused`, `hang` or what was raised instead of an error of ours."""
    for name, data in files.items():
        (room / name).parent.mkdir(parents=True, exist_ok=True)
        (room / name).write_bytes(data)
    signal.signal(signal.SIGALRM, _stop)
    signal.alarm(_HANG_S)
    try:
        read(room / next(iter(files)))
    except MineError as error:
        return "refused" if str(error) else "an empty message"
    except _Hang:
        return "hang"
    except Exception as error:  # the finding that this looks for
        return f"{type(error).__name__}: {str(error)[:200]}"
    finally:
        signal.alarm(0)
    return "valid"


def _stop(*_: object) -> None:
    raise _Hang


def _child(reader: str, first: int, count: int) -> None:
    """Run cases and say after each what became of it."""
    from benchmarks.fuzz_samples import READERS

    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    os.environ["MINEXPLORE_FUZZ"] = "1"
    out = os.fdopen(os.dup(1), "w")
    with Path(os.devnull).open("w") as quiet:
        os.dup2(quiet.fileno(), 1)
        os.dup2(quiet.fileno(), 2)
    for number, files in list(enumerate(cases(reader, count)))[first:]:
        with tempfile.TemporaryDirectory() as folder:
            room = Path(folder) / "in"
            room.mkdir()
            start = time.perf_counter()
            verdict = try_case(READERS[reader], files, room)
            if [p.name for p in Path(folder).iterdir()] != ["in"]:
                verdict = "a file outside its folder"
        print(json.dumps([number, verdict, round(time.perf_counter() - start, 3)]), file=out, flush=True)


def fuzz_reader(reader: str, count: int, tell: Callable[[int], object]) -> dict[str, Any]:
    """Run a reader's cases in a process of their own, begun again after every one that kills it."""
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
                tell(1)
        if len(verdicts) < count:
            verdicts.append(f"crash (exit code {child.returncode})")
            tell(1)
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


def table(found: dict[str, dict[str, Any]]) -> str:
    """Return the findings as Markdown."""
    names = ("reader", "cases", "refused with a message", "valid", "crashed, hung or leaked", "slowest, s")
    lines = [f"| {' | '.join(names)} |", "|---" * len(names) + "|"]
    for reader, row in found.items():
        told = (reader, row["cases"], row["refused"], row["valid"], len(row["failed"]), f"{row['slowest_s']:.1f}")
        lines.append(f"| {' | '.join(map(str, told))} |")
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
    found = {}
    with tqdm(total=arguments.count * len(arguments.readers), unit="case", disable=None) as bar:
        for reader in arguments.readers:
            bar.set_postfix_str(reader)
            found[reader] = fuzz_reader(reader, arguments.count, bar.update)
    write_atomically(RESULTS, (json.dumps(found, indent=1) + "\n").encode())
    print(table(found))
    failed = {f"{reader} {case}": v for reader, row in found.items() for case, v in row["failed"].items()}
    for case, verdict in failed.items():
        print(f"{case}: {verdict}")
    if not failed and arguments.readers == list(SAMPLES):
        head = (
            "# Fuzzing\n\nBroken and hostile files thrown at every reader, written by `make fuzz`. A case passes\n"
            "if it ends within 10 s in a result or a message, and leaves no file outside its folder.\n\n"
        )
        write_atomically(TABLE, (head + table(found)).encode())
    return 2 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
