"""Do many pieces of work, each once: `map_pieces`, in processes of this machine or on a cluster of Ray."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import shlex
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from pydantic import TypeAdapter
from pydantic_core import to_json
from tqdm import tqdm

from pieces.results import PiecesError, Results
from pieces.work import Where, Work

_ENDS = (signal.SIGINT, signal.SIGTERM)  # signals that end a command
_PR_SET_PDEATHSIG = 1
_MOST_WAIT = 20_000  # calls that Ray has at a time: twice the processors of a thousand nodes
_MOST_SHOWN = 300  # characters of an error of Ray
Answer = tuple[bytes, str]  # the result as JSON, and why it does not count
Place = tuple[Callable[[Any], Future[Answer]], int]  # what starts a call, and how many calls may be under way


def map_pieces(
    work: Work, items: Iterable[Any], where: Where, done: Callable[[Any, Any], Any] = lambda item, result: None
) -> list[Any]:
    """Return the results of all items in their order; one that is kept is not made, and one that is made is kept.

    So a command that was ended goes on where it stopped, on any machine that sees the results. `done` is called with
    each item and its result as it comes.

    Raises
    ------
    PiecesError
        If pieces failed, after all others are done; each is listed with the command that repeats it alone.
    """
    pieces = [item for item in items if where.piece in (None, work.label(item))]
    if where.piece is not None and not pieces:
        raise PiecesError(f"--piece {where.piece}: no piece of {work.title} has this label")
    found, failed, adapter = dict[int, Any](), list[str](), TypeAdapter(work.result)
    tqdm.monitor_interval = 0  # no thread beside this one: reading a survey forks
    every_s = 0.1 if sys.stderr.isatty() else 30.0
    bar = tqdm(total=len(pieces), desc=work.title, unit="piece", mininterval=every_s, delay=every_s)
    with bar, closing(_answers(work, pieces, where)) as answers:
        for number, (data, problem) in answers:
            item = pieces[number]
            if data:
                found[number] = adapter.validate_json(data)
                problem = problem or _bring(work, where, item, found[number])
                done(item, found[number])
            if problem:
                again = shlex.join(["python", *sys.orig_argv[1:], "--piece", work.label(item)])
                failed.append(f"{work.title}: {work.label(item)}: {problem}\n  again: {again}")
            bar.update()
    if failed:
        print(*failed, sep="\n", file=sys.stderr)
        first = failed[0].splitlines()[0]
        raise PiecesError(f"{len(failed)} of {len(pieces)} pieces failed, {first}; the same command goes on with them")
    if where.piece is not None:
        print(*found.values())
        raise SystemExit(0)
    return [found[number] for number in range(len(pieces))]


def _answers(work: Work, items: list[Any], where: Where) -> Generator[tuple[int, Answer]]:
    """Yield the number of each item with its answer as it comes."""
    call = partial(_make, str(Path.cwd()), replace(work, label=str, holds=None), where)
    jobs = min(where.jobs, len(items), os.cpu_count() or 1)
    if hasattr(os, "sysconf"):  # not on Windows
        jobs = min(jobs, int(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30 / work.memory_gb))
    on_ray = bool(items) and where.on == "ray" and where.piece is None
    if not on_ray and jobs <= 1:
        yield from enumerate(map(call, items))
        return
    left, under_way, ended = enumerate(items), dict[Future[Answer], int](), SimpleQueue[Future[Answer]]()
    with _on_cluster(call, work, where.jobs) if on_ray else _in_processes(call, jobs) as (start, most):
        while True:
            for number, item in islice(left, most - len(under_way)):
                under_way[future := start(item)] = number
                future.add_done_callback(ended.put)
            if not under_way:
                return
            number, error = under_way.pop(future := ended.get()), future.exception()
            yield number, (b"", _why(error)) if error else future.result()


def _why(error: BaseException) -> str:
    """Return why a call gave no answer."""
    if isinstance(error, BrokenExecutor):
        return "its process was ended, perhaps for want of memory"
    return f"{type(error).__name__}: {' '.join(str(error).split())[-_MOST_SHOWN:]}"


def _make(folder: str, work: Work, where: Where, item: Any) -> Answer:
    """Return a result that is kept, or make it and keep it."""
    try:
        os.chdir(folder)  # the project's, on a node
        address, name = where.to or work.kept, work.name(item)
        store = Results(address) if address else None
        if store and where.piece is None and (data := store.read(name)):
            return data, ""
        result = work.do(item)
        data, problem = to_json(result, inf_nan_mode="constants"), work.problem(result) if work.problem else None
        if store and not problem:
            if where.to and work.folder:
                store.write_folder(f"{name}.zip", work.folder(item))
            store.write(name, data)
        return data, problem or ""
    except Exception as error:  # this piece fails and the others go on
        return b"", f"{type(error).__name__}: {error}"


def _bring(work: Work, where: Where, item: Any, result: Any) -> str:
    """Bring the folder of a result from where it is kept if it is not here; return why it cannot be."""
    if not where.to or not work.folder:
        return ""
    if not (folder := work.folder(item)).is_dir():
        Results(where.to).read_folder(f"{work.name(item)}.zip", folder)
    return "" if work.holds is None or work.holds(item, result) else f"{folder}: is not what was made; move it away"


def begin_worker() -> None:
    """Prepare a worker: it leaves Ctrl-C to its parent, and ends with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDS)
    parent = multiprocessing.parent_process()
    if sys.platform == "linux":  # without a thread: a process that has one starts an interpreter to read a survey
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    elif parent is not None:
        threading.Thread(target=lambda: (parent.join(), os._exit(1)), daemon=True).start()
    if parent is not None and not parent.is_alive():  # it ended before
        os._exit(1)


@contextmanager
def _in_processes(call: Callable[[Any], Answer], jobs: int) -> Iterator[Place]:
    """Call in so many processes. One that ends fails its own call only, and another takes its place."""
    pools, idle = list[ProcessPoolExecutor](), list[ProcessPoolExecutor]()

    def start(item: Any) -> Future[Answer]:
        if not idle:
            pools.append(ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), begin_worker))
        pool = idle.pop() if idle else pools[-1]
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, _ENDS)  # of a process that starts
        future = pool.submit(call, item)
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        future.add_done_callback(lambda ended: None if ended.exception() else idle.append(pool))
        return future

    try:
        yield start, jobs
    except BaseException:  # also where the caller closes this
        for worker in multiprocessing.active_children():
            worker.terminate()
        raise
    finally:
        for pool in pools:  # each waits for its own process: of two that wait for one, one finds no process
            pool.shutdown()


@contextmanager
def _on_cluster(call: Callable[[Any], Answer], work: Work, jobs: int) -> Iterator[Place]:
    """Call on the cluster at RAY_ADDRESS, or on one of `jobs` processors that is started here and ended."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray
    except ImportError:
        raise PiecesError("--on ray: Ray is not installed; `make setup-baselines` installs it") from None
    address, ending = os.environ.get("RAY_ADDRESS", "local"), signal.getsignal(signal.SIGTERM)
    own = {"num_cpus": jobs, "include_dashboard": False} if address == "local" else {}
    # Ray's collector of garbage is a thread (see `begin_worker`).
    environment = {"PYTHONPATH": str(Path.cwd()), "RAY_start_python_gc_manager_thread": "0"}
    try:
        ray.init(address, logging_level="ERROR", log_to_driver=False, runtime_env={"env_vars": environment}, **own)
    except Exception as error:  # Ray raises `Exception` as well
        raise PiecesError(f"--on ray: RAY_ADDRESS={address}: {' '.join(str(error).split())[:_MOST_SHOWN]}") from error
    signal.signal(signal.SIGTERM, ending)  # Ray has set a handler of its own
    remote = ray.remote(memory=work.memory_gb * 2**30)(lambda item: call(item))
    try:
        yield lambda item: remote.remote(item).future(), _MOST_WAIT
    finally:
        ray.shutdown()
