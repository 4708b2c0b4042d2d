"""Modules run as `python -m` runs them, in processes forked from one that has imported the pipeline already."""

from __future__ import annotations

import multiprocessing
import os
import runpy
import subprocess
import sys
from functools import cache
from multiprocessing.context import ForkServerContext
from pathlib import Path
from tempfile import TemporaryDirectory

_PRELOADED = ["pipeline.compose", "pipeline.__main__", "open3d"]
_PRELOADED += ["minesurveys.vector.dxf", "pipeline.report.page", "scipy.signal"]  # commands load them on demand
_PRELOADED += ["baselines.evaluate", "baselines.score", "tests.preloaded"]


@cache
def _context() -> ForkServerContext:
    """Return the context whose server has imported what commands need."""
    from stages.__main__ import STAGES  # takes a second to load; the process that hands out tests needs none of it

    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([*(f"stages.{name}" for name in STAGES), *_PRELOADED])
    return context


def run_forked(
    module: str, arguments: tuple[str, ...], folder: Path, variables: dict[str, str] | None = None
) -> subprocess.CompletedProcess:
    """Run a module with its arguments in `folder` and further variables; return its exit code, output and messages.

    The code comes from this checkout, not from `folder`, and libraries have read their environment variables before.
    """
    with TemporaryDirectory() as streams:
        out, err = Path(streams) / "out", Path(streams) / "err"
        process = _context().Process(target=_run, args=(module, arguments, folder, (out, err), variables or {}))
        process.start()
        process.join()
        assert process.exitcode is not None  # it has ended
        return subprocess.CompletedProcess(
            [sys.executable, "-m", module, *arguments], process.exitcode, out.read_text(), err.read_text()
        )


def _run(
    module: str, arguments: tuple[str, ...], folder: Path, streams: tuple[Path, Path], variables: dict[str, str]
) -> None:
    for descriptor, path in zip((1, 2), streams, strict=True):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), descriptor)
    os.environ.update(variables)
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    sys.argv = [module, *arguments]
    main = f"{module}.__main__" if hasattr(sys.modules.get(module), "__path__") else module
    sys.modules.pop(main, None)  # or runpy warns that it was imported before
    runpy.run_module(module, run_name="__main__", alter_sys=True)
