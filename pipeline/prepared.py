"""Run a stage of the default world, or its report, in a process that has loaded the libraries: DVC's commands.

`python -m pipeline.prepared NAME` asks a process that `pipeline.reproduce` holds, which forks itself for each command:
libraries take a second to load each time. It also lets stages begin while earlier ones run, as `pipeline new` does.
Without such a process, as under `dvc repro`, the command loads its own libraries.
"""

from __future__ import annotations

import os
import signal
import socket
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from pipeline.guard.process_limits import die_with_parent

if TYPE_CHECKING:
    from pipeline.guard.forked import Forked
    from pipeline.stage import Stage

ADDRESS = "MINEXPLORE_PREPARED"  # the environment's variable with the path of the socket
REPORT = "report"
_LONGEST_NAME = 64
_STREAMS = (0, 1, 2)
_KILLED = 256 - signal.SIGKILL  # the exit code of a command that was killed
_LATER = (  # what stages and the report load while they run
    "pipeline.report.page",
    "pipeline.report.figures.replay",
    "pipeline.report.figures.roughness",
    "pipeline.report.figures.texture",
    "pipeline.worlds",
)


@contextmanager
def prepared(whole: bool) -> Iterator[dict[str, str]]:
    """Hold a process that runs commands, and yield the environment in which they find it; Linux only.

    `whole` says that all stages are asked for, so that they may begin while earlier ones run.
    """
    if sys.platform != "linux":
        yield dict(os.environ)
        return
    with tempfile.TemporaryDirectory(prefix="minexplore-") as folder, socket.socket(socket.AF_UNIX) as listener:
        address, parent = str(Path(folder) / "socket"), os.getpid()
        listener.bind(address)
        listener.listen()
        server = os.fork()
        if not server:
            _exit(partial(_serve, listener, parent, whole))
        try:
            yield {**os.environ, ADDRESS: address}
        finally:
            os.kill(server, signal.SIGKILL)
            os.waitpid(server, 0)


def run(name: str, begun: Forked[Any] | None = None) -> int:
    """Run a stage or the report in this process, and return the exit code.

    `begun` is the work of the stage that already runs in another process.
    """
    sys.argv = [name]
    if name == REPORT:
        sys.argv = ["pipeline", name]
        return int(import_module("pipeline.__main__").main())
    return int(import_module("pipeline.stage").main(import_module(f"stages.{name}").STAGE, begun))


def _serve(listener: socket.socket, parent: int, whole: bool) -> int:
    """Load the libraries, then run commands, one after another, until the parent ends this process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    die_with_parent(parent)
    stages = import_module("stages.__main__").load_stages()
    begun: dict[str, Forked[Any] | None] = {}
    server = os.getpid()
    for name in _LATER:
        import_module(name)
    import_module("pipeline.geometry.ray_scene").load_open3d()
    while True:
        asked, _ = listener.accept()
        with asked:
            named, streams, _, _ = socket.recv_fds(asked, _LONGEST_NAME, len(_STREAMS))
            name = named.decode()
            begun |= {stage.name: _begin(stage) for stage in stages if whole and stage.begins_with == name}
            own = begun.pop(name, None)
            child = os.fork()
            if not child:
                listener.close()
                asked.close()  # whoever asks notices the end of the process that answers
                _exit(partial(_run_with, name, streams, own, server))
            for stream in streams:
                os.close(stream)
            code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
            if own:
                own.end()
            asked.send(bytes([code % 256]))  # a signal is a negative number


def _begin(stage: Stage) -> Forked[Any] | None:
    """Let a stage begin; if it cannot, it says why when it runs."""
    from pipeline.errors import MineError
    from pipeline.params.reading.composed import composed_section
    from pipeline.stage import ARTIFACTS

    with suppress(MineError, OSError):
        return stage.begin(composed_section(stage.name), ARTIFACTS)
    return None


def _run_with(name: str, streams: list[int], begun: Forked[Any] | None, server: int) -> int:
    """Run a command whose standard input, output and errors are these; it ends with the server."""
    die_with_parent(server)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for own, given in zip(_STREAMS, streams, strict=True):
        os.dup2(given, own)
    return run(name, begun)


def _exit(work: Callable[[], int]) -> NoReturn:
    """Do the work of a forked process, and end it with the exit code."""
    code = 1
    try:
        code = work()
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _ask(address: str, name: str) -> int:
    """Let the prepared process run a command; return its exit code. If there is no such process, run it here."""
    with socket.socket(socket.AF_UNIX) as asked:
        try:
            asked.connect(address)
        except OSError:
            return run(name)
        socket.send_fds(asked, [name.encode()], list(_STREAMS))
        answer = asked.recv(1)
    code = answer[0] if answer else _KILLED
    if code == _KILLED:
        print(f"{name}: the system ended it, perhaps for want of memory", file=sys.stderr)
    return code


def main() -> int:
    """Run the command that is named; return its exit code."""
    address, name = os.environ.get(ADDRESS), sys.argv[1]
    return _ask(address, name) if address else run(name)


if __name__ == "__main__":
    sys.exit(main())
