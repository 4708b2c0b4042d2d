"""The sandbox of a stranger's policy: bubblewrap's arguments, and what is visible inside."""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import minexplore
from baselines.base.errors import BaselineError

POLICY = "/policy"  # where a policy's files are, inside
PROJECT = "/project"  # where the packages `baselines` and `minexplore` are, inside
_HIDDEN = ("results", "__pycache__")  # of `baselines`: the folder of results is never inside
_SYSTEM = ("/usr/lib", "/usr/lib64", "/lib", "/lib64")  # shared libraries
_NOBODY = "65534"
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
# Without MUJOCO_GL, importing MuJoCo starts a process that looks for a display.
_VARIABLES = {"PATH": "/usr/bin", "HOME": "/", "LANG": "C.UTF-8", "MUJOCO_GL": "disable", **_ONE_THREAD}
_FILTERED = "from baselines.sandbox.syscall_filter import install_filter; install_filter()"
_PROBE_S = 60.0  # to start an empty sandbox on a busy machine


@dataclass(frozen=True)
class Limits:
    """What a policy may use: memory of its process, and its own time over all its calls."""

    memory_bytes: int = 4 << 30
    time_s: float = 7200.0


def sandbox_command(folder: Path | None, program: str, *words: str) -> list[str]:
    """Return the command that runs a Python program in a sandbox; the program must install the filter of system calls.

    Parameters
    ----------
    folder : Path, optional
        What the policy consists of; it is `POLICY` inside.
    program : str
        Python code, for this interpreter without the module `site`.
    words : str
        The program's arguments.

    Raises
    ------
    BaselineError
        If bubblewrap is not installed.
    """
    python = [os.path.realpath(sys.executable), "-I", "-S", "-B", "-c", program, *words]
    return [_find_bubblewrap(), *_isolation(), *_visible(folder), *python]


@functools.cache
def require_sandbox() -> None:
    """Refuse a system that does not start a sandbox.

    Raises
    ------
    BaselineError
        Naming what is missing.
    """
    program = f"import sys; sys.path += {[*library_folders(), PROJECT]}; {_FILTERED}"
    done = subprocess.run(sandbox_command(None, program), capture_output=True, timeout=_PROBE_S)
    if done.returncode:
        lines = done.stderr.decode(errors="replace").splitlines() or [f"exit code {done.returncode}"]
        reason = "".join(c if c.isprintable() else " " for c in lines[-1])
        raise BaselineError(f"bubblewrap starts no sandbox on this system ({reason})")


def library_folders() -> list[str]:
    """Return the folders of this interpreter's installed packages."""
    return [path for path in sys.path if Path(path).name in ("site-packages", "dist-packages")]


def _find_bubblewrap() -> str:
    found = shutil.which("bwrap")
    if found is None:
        raise BaselineError("bubblewrap is not installed: `make setup` installs it")
    return found


def _isolation() -> list[str]:
    """Return the arguments that take away all but what `_visible` gives.

    The policy is the only process in its namespace: no other one there could be taken over.
    """
    words = ["--unshare-all", "--unshare-user", "--cap-drop", "ALL", "--uid", _NOBODY, "--gid", _NOBODY]
    words += ["--disable-userns"] if _has_option("--disable-userns") else []
    words += ["--new-session", "--die-with-parent", "--as-pid-1", "--clearenv"]
    return words + [word for item in _VARIABLES.items() for word in ("--setenv", *item)]


@functools.cache
def _has_option(name: str) -> bool:
    """Return whether bubblewrap knows an option; version 0.8 added `--disable-userns`."""
    return name in subprocess.run([_find_bubblewrap(), "--help"], capture_output=True, text=True).stdout


def _visible(folder: Path | None) -> list[str]:
    """Return the arguments that make files visible, all of them read-only.

    `/proc` is read-only as well: for root, `/proc/sys` is not namespaced.
    """
    words: list[str] = []
    for path in map(Path, _SYSTEM):
        if path.is_symlink():
            words += ["--symlink", str(path.readlink()), str(path)]
        elif path.is_dir():
            words += _shown(path)
    python = Path(os.path.realpath(sys.executable))
    others = [Path("/etc/ld.so.cache"), python, Path(sys.base_prefix, "lib"), *map(Path, library_folders())]
    for path in others:
        words += _shown(path) if path.exists() else []
    for path in sorted(Path(__file__).parents[1].iterdir()):
        words += _shown(path, f"{PROJECT}/baselines/{path.name}") if path.name not in _HIDDEN else []
    words += _shown(Path(minexplore.__file__).parent, f"{PROJECT}/minexplore")
    words += _shown(folder, POLICY) if folder is not None else ["--dir", POLICY]
    for device in ("/dev/null", "/dev/zero", "/dev/urandom"):
        words += ["--dev-bind", device, device]
    return [*words, "--proc", "/proc", "--remount-ro", "/proc", "--dir", "/tmp", "--remount-ro", "/", "--chdir", "/"]


def _shown(path: Path, place: str | None = None) -> list[str]:
    return ["--ro-bind", str(path.resolve()), place or str(path)]
