"""Do many pieces of work, each once: `map_pieces`."""

from __future__ import annotations

import os
import shlex
import sys
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter
from pydantic_core import to_json
from tqdm import tqdm

from pieces.places import Answers, over_cluster, over_processes
from pieces.results import PiecesError, Results, packed, unpack
from pieces.work import Where, Work

_EVERY_S = 30.0  # between lines of progress where standard error is no terminal
_LINE = "{desc}: {n_fmt} of {total_fmt} pieces, {remaining} left\n"
_MOST_LISTED = 20  # failed pieces


@dataclass(frozen=True)
class WorkPiece:
    """An item, the name of its result, and the folder that it writes."""

    item: Any
    name: str
    folder: Path | None


def map_pieces(
    work: Work, items: Iterable[Any], where: Where, done: Callable[[Any, Any], Any] = lambda item, result: None
) -> list[Any]:
    """Return the results of all items in their order, each kept as soon as it is made; one that is kept is not made.

    A result's name is the hash of code, inputs and item. So a command that was ended goes on where it stopped, on any
    machine that sees the results. `done` is called with each item and its result, those that were kept first.

    Raises
    ------
    PiecesError
        If pieces failed, after all others are done; each is listed with the command that repeats it alone.
    """
    pieces = [_piece(work, item) for item in items if where.piece in (None, work.label(item))]
    if where.piece is not None and not pieces:
        raise PiecesError(f"--piece {where.piece}: no piece of {work.title} has this label")
    store, found, adapter = where.to or work.kept, dict[str, Any](), TypeAdapter(work.result)
    results = Results(store, work.title) if store else None
    kept = results.names() if results and where.piece is None else set()

    def take(piece: WorkPiece, data: bytes) -> str:
        result, archive = adapter.validate_json(data), f"{piece.name}.zip"
        if results and where.to and piece.folder:
            if not piece.folder.is_dir() and (packed_files := results.read(archive)) is not None:
                unpack(packed_files, piece.folder)
            if not piece.folder.is_dir() or (work.holds and not work.holds(piece.item, result)):
                return f"{piece.folder}: is not what was made; move it away"
        found[piece.name] = result
        done(piece.item, result)
        return ""

    for piece in pieces:
        data = results.read(f"{piece.name}.json") if results and f"{piece.name}.json" in kept else None
        if data is not None:
            take(piece, data)
    left, failed = [piece for piece in pieces if piece.name not in found], list[str]()
    tqdm.monitor_interval = 0  # no thread beside this one: reading a survey forks
    lines: dict[str, Any] = {"mininterval": _EVERY_S, "delay": _EVERY_S, "bar_format": _LINE}
    shown = {} if sys.stderr.isatty() else lines
    bar = tqdm(total=len(pieces), initial=len(found), desc=work.title, unit="piece", **shown)
    with bar, closing(_answers(work, left, where)) as answers:
        for piece, answer in answers:
            data, problem = answer if isinstance(answer, tuple) else (b"", f"{type(answer).__name__}: {answer}")
            if results and not where.to and not problem:
                results.write(f"{piece.name}.json", data)
            problem = (take(piece, data) if data else "") or problem
            if problem:
                again = shlex.join(["python", *sys.orig_argv[1:], "--piece", work.label(piece.item)])
                failed.append(f"{work.title}: {work.label(piece.item)}: {problem}\n  again: {again}")
            bar.update()
    if failed:
        print(*failed[:_MOST_LISTED], *(failed[_MOST_LISTED:] and ["..."]), sep="\n", file=sys.stderr)
        first = failed[0].splitlines()[0]
        raise PiecesError(f"{len(failed)} of {len(pieces)} pieces failed, {first}; the same command goes on with them")
    if where.piece is not None:
        print(*found.values())
        raise SystemExit(0)
    return [found[piece.name] for piece in pieces]


def _piece(work: Work, item: Any) -> WorkPiece:
    name = sha256(to_json([work.title, work.code, work.inputs, item])).hexdigest()
    return WorkPiece(item, name, work.folder(item) if work.folder else None)


def _answers(work: Work, pieces: list[WorkPiece], where: Where) -> Answers:
    call = partial(make, str(Path.cwd()), (where.to, work.title) if where.to else None, work.do, work.problem)
    if where.on == "ray" and where.piece is None:
        return over_cluster(call, iter(pieces), where.jobs, work.processors, work.memory_gb)
    jobs = min(where.jobs, len(pieces), int((os.cpu_count() or 1) / work.processors))
    if hasattr(os, "sysconf"):  # not on Windows
        jobs = min(jobs, int(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30 / work.memory_gb))
    return over_processes(call, deque(pieces), jobs) if jobs > 1 else ((piece, call(piece)) for piece in pieces)


def make(folder: str, to: tuple[str, str] | None, do: Callable, problem: Callable | None, piece: WorkPiece) -> tuple:
    """Make one result, and keep it at an address; return it as JSON, and why it does not count."""
    try:
        os.chdir(folder)  # the project's, on a node
        result = do(piece.item)
        data, wrong = to_json(result, inf_nan_mode="constants"), problem(result) if problem else None
        if to and not wrong:
            results = Results(*to)
            if piece.folder:
                results.write(f"{piece.name}.zip", packed(piece.folder))
            results.write(f"{piece.name}.json", data)
        return data, wrong or ""
    except Exception as error:  # this piece fails and the others go on
        return b"", f"{type(error).__name__}: {error}"
