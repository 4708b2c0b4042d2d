"""Try a folder of survey files: which are read or built, which need an option, which are refused, and why.

Each file is read as by `python -m pipeline new --dry-run`, in a process of its own with limits on time and memory. With
`--build` the world is built, too, in a copy of the project, and judged.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path

from tqdm import tqdm

from baselines.base.markdown import markdown_table
from minesurveys.errors import DoubtError, UnexpectedError, lacks_memory, printable
from minesurveys.formats import FORMATS, kind_of
from minesurveys.guard.process_limits import has_limits
from minesurveys.limits import reader_limits
from minesurveys.remarks import Remark, collect_remarks
from pipeline.commands.options import add_options, stated_options
from pipeline.errors import MineError
from pipeline.params.stated import StatedOptions, option
from pipeline.store.files import write_atomically

VERDICTS = ("read", "built", "asked", "refused", "failed")
TABLE = Path("artifacts/bench/files.md")
_TIME_S = 240  # of the processors; a file is read twice, each time within 60 s
_WAIT_S = 1200.0  # by the clock, of a process that sleeps; a busy machine may take long
_SPARE_BYTES = 2_000_000_000  # of the libraries, beyond what a reader may take
_OPTION = re.compile(  # a station's name may end like one
    r"(?<![\w.])(?:--[a-z][a-z-]*[a-z]"
    r"|(?:survey|contours|compile3d|surface|realism)\.[a-z]\w*(?:\.[a-z]\w*)*(?:=\w+)?)"
)
_SURVEY = "trial"
_BUILD_S = 3600.0  # by the clock, of a world
_NEAR = ("within_5cm", "within_10cm", "within_30cm")  # of points of a scan: shares
_WHY = 300  # characters of the remarks on a file that was read


@dataclass(frozen=True)
class Outcome:
    """What became of a file: one of `VERDICTS`, and why; processor seconds, bytes at the peak, and files that it named.

    `asked` is a refusal that names an option; `failed` is a fault of a reader or the builder.
    """

    verdict: str
    why: str
    seconds: float = 0.0
    peak_bytes: int = 0
    used: list[str] = field(default_factory=list)


def try_folder(folder: Path, words: list[str], jobs: int) -> dict[str, Outcome]:
    """Return the outcome of each survey file below a folder, by its path there; `words` are options of `new`."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file() and not path.name.startswith(".")]
    known = [path for path in files if path.suffix.lower() in FORMATS]
    with (
        ThreadPoolExecutor(jobs) as pool,
        tqdm(pool.map(lambda path: _try_apart(path, words), known), total=len(known), unit="file", disable=None) as bar,
    ):
        outcomes = dict(zip(known, bar, strict=True))
    named = {Path(name) for outcome in outcomes.values() for name in outcome.used}
    outcomes = {path: o for path, o in outcomes.items() if o.verdict == "read" or path.resolve() not in named}
    beside = {path.with_suffix("") for path in known}
    for path in files:
        if path not in outcomes and path.resolve() not in named and path.with_suffix("") not in beside:
            outcomes[path] = Outcome("refused", _unsupported(path))
    return {path.relative_to(folder).as_posix(): outcomes[path] for path in sorted(outcomes)}


def _unsupported(path: Path) -> str:
    """Return why a file of no supported format is refused."""
    try:
        kind_of(path)
    except MineError as error:
        return str(error).removeprefix(f"{path}: ").partition(" (.")[0]
    raise AssertionError(path)


def _try_apart(path: Path, words: list[str]) -> Outcome:
    """Return the outcome of a file that a new process reads."""
    command = [sys.executable, "-m", "benchmarks.files", "--child", str(path), *words]
    start = time.monotonic()
    try:
        with tempfile.TemporaryDirectory() as scratch:  # also of a process that is ended
            done = subprocess.run(
                command,
                capture_output=True,
                text=True,
                stdin=subprocess.DEVNULL,
                timeout=_BUILD_S if "--build" in words else _WAIT_S,
                env={**os.environ, "TMPDIR": scratch},
            )
        return Outcome(**json.loads(done.stdout.splitlines()[-1]))
    except subprocess.TimeoutExpired:
        taken = time.monotonic() - start
        return Outcome("failed", f"not done within {taken:.0f} s", taken)
    except (IndexError, TypeError, ValueError):
        if has_limits() and done.returncode == -signal.SIGXCPU:
            return Outcome("failed", f"not read within {_TIME_S} s of processor time", _TIME_S)
        last = (done.stderr.strip().splitlines() or [""])[-1]
        return Outcome("failed", f"exit code {done.returncode}: {last[:200]}", time.monotonic() - start)


def try_file(path: Path, stated: StatedOptions) -> Outcome:
    """Return the outcome of a file that this process reads; options that its kind has no use for are left out."""
    from pipeline.build.dry_run import dry_run

    start = sum(os.times()[:4])  # of this process and of those that it ended; a busy machine adds nothing
    verdict, why, used = "failed", "", []
    with collect_remarks() as remarks:
        try:
            kind = kind_of(path)
            unread = {name: None for name in stated.values() if kind not in option(name).read_with}
            reading = dry_run(_SURVEY, path, stated.model_copy(update=unread), [])
            used = [str(file.resolve()) for file in reading.files]
            verdict = "read"
        except UnexpectedError as error:
            why = error.detail
        except MineError as error:
            asks = isinstance(error, DoubtError) or bool(options_of(str(error)))
            verdict, why = "asked" if asks else "refused", str(error)
        except Exception as error:  # every other exception is a finding
            verdict = "refused" if lacks_memory(error) else "failed"
            why = "not enough memory" if lacks_memory(error) else f"{type(error).__name__}: {error}"
    # What was remarked before a refusal may be its cause.
    why = "; ".join([*filter(None, [why]), *(_fact(remark, path) for remark in remarks)])[:_WHY]
    why = why.removeprefix(f"{path}: ").replace(f"{path.parent}/", "").replace(f"data/mines/{_SURVEY}/", "")
    return Outcome(verdict, why, round(sum(os.times()[:4]) - start, 1), _peak_bytes(), used)


def build_file(path: Path, words: list[str], folder: Path) -> Outcome:
    """Return the outcome of the world of a file, built with options of `new` in a copy of the project in a folder."""
    from tests.project import Project

    start, project = sum(os.times()[:4]), Project(folder, tiny=False)
    command = [sys.executable, "-m", "pipeline", "new", _SURVEY, "--from", str(path.resolve()), *words]
    done = project.run(*command, check=False)
    last = (done.stderr.strip().splitlines() or [""])[-1].removeprefix("new: ")
    last = last.replace(f"data/mines/{_SURVEY}/{path.name}: ", "")
    verdict, why = "failed", last
    if done.returncode == 0:
        measured = json.loads((folder / f"artifacts/worlds/{_SURVEY}/validation/metrics.json").read_text())
        scan = measured.get("scan", {})
        held = "holds" if measured["certificate"]["holds"] else "does not hold"
        near = "".join(f", {100 * scan[key]:.1f} % within {key[7:]}" for key in _NEAR if key in scan)
        verdict, why = "built", f"the certificate {held}{near}"
    elif done.returncode == 2:
        verdict = "asked" if options_of(last) else "refused"
    return Outcome(verdict, printable(why, _WHY), round(sum(os.times()[:4]) - start, 1), _peak_bytes())


def options_of(text: str) -> list[str]:
    """Return the options of `new` and the parameters that a refusal names, each once."""
    return list(dict.fromkeys(_OPTION.findall(text)))


def _fact(remark: Remark, path: Path) -> str:
    """Return a remark without the file's name and without its option."""
    row = remark.named_in(path.name)
    return printable(f"{row.value} {row.what}".strip(), _WHY)


def _peak_bytes() -> int:
    """Return the largest resident memory of this process and of the readers that it started."""
    if not has_limits():
        return 0
    import resource

    kinds = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return 1024 * max(resource.getrusage(kind).ru_maxrss for kind in kinds)


def table(outcomes: dict[str, Outcome]) -> str:
    """Return the outcomes as Markdown: the counts by format, then a row a file."""
    suffixes = sorted({Path(name).suffix.lower() for name in outcomes})
    counts = Counter((Path(name).suffix.lower(), outcome.verdict) for name, outcome in outcomes.items())
    by_format = [(suffix or "none", *(counts[suffix, verdict] for verdict in VERDICTS)) for suffix in suffixes]
    rows = [
        (name, found.verdict, f"{found.seconds:.1f}", f"{found.peak_bytes / 1e9:.1f}", found.why.replace("|", "/"))
        for name, found in outcomes.items()
    ]
    summary = markdown_table(("format", *VERDICTS), by_format)
    return f"{summary}\n{markdown_table(('file', 'outcome', 'CPU s', 'GB', 'why'), rows)}"


def _own_options() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--out", type=Path, default=TABLE, help="the table, Markdown")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="files at a time")
    parser.add_argument("--build", action="store_true", help="build the world of each file, and judge it")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    return parser


def command_line() -> argparse.ArgumentParser:
    """Return the parser: a folder, and the options of `new`, which apply to the files that are read with them."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.files", description=__doc__, parents=[_own_options()], allow_abbrev=False
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument("overrides", nargs="*", metavar="OVERRIDE", help="with --build: of the parameters")
    add_options(parser)
    return parser


def main(words: list[str]) -> int:
    """Try a folder's files and print the table; exit code 2 if a reader failed or there is no such folder."""
    typed = command_line().parse_intermixed_args(words)
    given = [word for word in _own_options().parse_known_args(words)[1] if Path(word) != typed.folder]
    if typed.child and typed.build:
        with tempfile.TemporaryDirectory() as scratch:
            print(json.dumps(asdict(build_file(typed.folder, given, Path(scratch) / "project"))))
        return 0
    if typed.child:
        _limit_process()
        print(json.dumps(asdict(try_file(typed.folder, stated_options(typed.folder, typed)))))
        return 0
    if not typed.folder.is_dir():
        print(f"files: {typed.folder}: no such folder", file=sys.stderr)
        return 2
    try:
        stated_options(typed.folder, typed)
    except MineError as error:
        print(f"files: {error}", file=sys.stderr)
        return 2
    outcomes = try_folder(typed.folder, ["--build"] * typed.build + given, typed.jobs)
    text = table(outcomes)
    print(text)
    write_atomically(typed.out, text.encode())
    return 2 if any(found.verdict == "failed" for found in outcomes.values()) else 0


def _limit_process() -> None:
    if has_limits():
        import resource

        most = reader_limits().memory_bytes + _SPARE_BYTES
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        resource.setrlimit(resource.RLIMIT_CPU, (_TIME_S, _TIME_S + 5))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
