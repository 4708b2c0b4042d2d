"""Where calls are made: in processes of this machine, or on a cluster of Ray."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import pkgutil
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from pieces.results import PiecesError

_PR_SET_PDEATHSIG = 1
_ENDS = (signal.SIGINT, signal.SIGTERM)  # signals that end a command
_AHEAD = 2  # calls that wait for each processor, so that none idles
_LEAST_AHEAD = 1000  # calls that wait for a cluster, which may grow by them
_RETRIES = 2  # of a call whose worker or node ended
_TAKEN, _WAIT_S = 100, 0.1  # answers that are taken at once, and how long they are waited for
Call = Callable[[Any], Any]
Answers = Generator[tuple[Any, Any]]  # each argument with what its call returned, or the error of its process


def begin_worker() -> None:
    """Prepare a worker: it leaves Ctrl-C to its parent, and ends with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDS)
    if sys.platform == "linux":  # without a thread: a process that has one starts an interpreter to read a survey
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    else:
        threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)


def over_processes(call: Call, left: deque[Any], jobs: int) -> Answers:
    """Call in processes. If one ends, what was under way is called again, each in a process alone."""
    pool = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), begin_worker)
    under_way: dict[Future[Any], Any] = {}
    try:
        while left or under_way:
            blocked = signal.pthread_sigmask(signal.SIG_BLOCK, _ENDS)  # of processes that start
            try:
                while left and len(under_way) < _AHEAD * jobs:
                    future = pool.submit(call, left[0])
                    under_way[future] = left.popleft()
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
            for done in wait(under_way, return_when=FIRST_COMPLETED).done:
                answer = done.result()
                yield under_way.pop(done), answer
    except BrokenProcessPool:
        if jobs == 1:
            yield under_way.popitem()[1], PiecesError("its process was ended, perhaps for want of memory")
    except BaseException:  # also where the caller closes this
        for worker in multiprocessing.active_children():
            worker.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
    for suspect in under_way.values():
        yield from over_processes(call, deque([suspect]), 1)
    if left:
        yield from over_processes(call, left, jobs)


def over_cluster(call: Call, left: Iterator[Any], jobs: int, processors: float, memory_gb: float) -> Answers:
    """Call on the cluster at RAY_ADDRESS, or on one of `jobs` processors that is started here and ended."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray
    except ImportError:
        raise PiecesError("--on ray: Ray is not installed; `make setup-baselines` installs it") from None
    address = os.environ.get("RAY_ADDRESS")
    own = {} if address else {"num_cpus": jobs, "include_dashboard": False}
    environment = {"env_vars": {"PYTHONPATH": str(Path.cwd())}}
    ending = signal.getsignal(signal.SIGTERM)
    try:
        ray.init(address, logging_level="ERROR", log_to_driver=False, runtime_env=environment, **own)
    except Exception as error:  # Ray raises `Exception` as well
        raise PiecesError(f"--on ray: RAY_ADDRESS={address}: {' '.join(str(error).split())[:200]}") from error
    signal.signal(signal.SIGTERM, ending)  # Ray has set a handler of its own
    call, under_way = importable(call), dict[Any, Any]()
    needs = {"num_cpus": processors, "memory": memory_gb * 2**30, "max_retries": _RETRIES}
    remote = ray.remote(**needs)(lambda argument: _on_node(call, argument))  # it takes no partial
    try:
        while True:
            ahead = max(_LEAST_AHEAD, int(_AHEAD * ray.cluster_resources().get("CPU", 0)))
            under_way |= {remote.remote(each): each for each in islice(left, ahead - len(under_way))}
            if not under_way:
                return
            for done in ray.wait(list(under_way), num_returns=min(_TAKEN, len(under_way)), timeout=_WAIT_S)[0]:
                try:
                    answer = ray.get(done)
                except ray.exceptions.RayError as error:
                    answer = error
                yield under_way.pop(done), answer
    finally:
        for waiting in under_way:
            ray.cancel(waiting, force=True)
        ray.shutdown()


def _on_node(call: Call, argument: Any) -> Any:
    """Call without Ray's collector of garbage: a process with a thread starts an interpreter to read each survey."""
    for thread in threading.enumerate():
        if type(thread).__name__ == "PythonGCThread":
            thread.stop()  # type: ignore[attr-defined]
    return call(argument)


def importable(call: Any) -> Any:
    """Return a function of the main module, or a partial of it, as one of a module that workers import."""
    if isinstance(call, partial):
        return partial(importable(call.func), *map(importable, call.args), **call.keywords)
    spec = sys.modules["__main__"].__spec__
    if spec is None or getattr(call, "__module__", None) != "__main__":
        return call
    return pkgutil.resolve_name(f"{spec.name}:{call.__qualname__}")
