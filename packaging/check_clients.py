"""Run the checkers of training libraries with the wheel, each in an environment of its own.

`python packaging/check_clients.py` prints a Markdown table. `make wheel` makes the wheel. Packages
come from the index that pip is set up with.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import venv
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent / "clients"
DIST = Path("dist")
_LONGEST_S = 1200  # of an installation or a check


@dataclass(frozen=True)
class Client:
    """A library, what is installed beside the wheel, and the program of this folder that checks it."""

    name: str
    packages: tuple[str, ...]
    program: str


TORCH = "torch==2.13.0"
CLIENTS = (
    Client("gymnasium, lowest", ("gymnasium==1.2.2",), "gymnasium_check.py"),
    Client("gymnasium", ("gymnasium==1.4.0",), "gymnasium_check.py"),
    Client(
        "PettingZoo and SuperSuit",
        ("pettingzoo==1.27.0", "supersuit==3.11.0", "stable-baselines3==2.9.2", TORCH),
        "pettingzoo_check.py",
    ),
    Client("Stable-Baselines3", ("stable-baselines3==2.9.2", TORCH), "sb3_check.py"),
    Client("TorchRL", ("torchrl==0.14.1", "pettingzoo==1.27.0", TORCH), "torchrl_check.py"),
    Client("skrl", ("skrl==2.1.1", TORCH), "skrl_check.py"),
    Client("Tianshou", ("tianshou==2.0.1", TORCH), "tianshou_check.py"),
    Client("RLlib, new stack", ("ray[rllib]==2.60.0", TORCH), "rllib_check.py"),
    Client("rsl-rl", ("rsl-rl-lib==5.5.1", TORCH), "rsl_rl_check.py"),
    Client("Minari", ("minari[create,hdf5]==0.5.4", "pillow==12.0.0"), "minari_check.py"),
)


class InstallError(RuntimeError):
    """A client cannot be installed here."""


def check(client: Client, wheel: Path, folder: Path) -> str:
    """Install a client and a wheel into a new environment in a folder and return what its program checked.

    Raises
    ------
    InstallError
        If it cannot be installed, for example without a network.
    RuntimeError
        If the check fails; the message is the end of its error output.
    """
    python = install(str(wheel), client.packages, folder)
    done = _run([python, "-W", "ignore", str(HERE / client.program)], folder)
    if done.returncode:
        raise RuntimeError(f"{client.name}: {_end(done)}")
    return done.stdout.strip().splitlines()[-1]


def install(wheel: str, packages: tuple[str, ...], folder: Path) -> str:
    """Return the interpreter of a new environment in a folder that has a wheel, or its extras, and packages.

    Raises
    ------
    InstallError
        If they cannot be installed.
    """
    venv.create(folder / "environment", with_pip=True)
    python = str(folder / "environment" / "bin" / "python")
    # Compiling the modules that a check never imports takes longer than the check.
    done = _run([python, "-m", "pip", "install", "--quiet", "--no-compile", wheel, *packages], folder)
    if done.returncode:
        raise InstallError(_end(done))
    return python


def _run(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run(
        command,
        cwd=folder,
        env={**variables, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=_LONGEST_S,
    )


def _end(done: subprocess.CompletedProcess[str]) -> str:
    return (done.stderr.strip() or done.stdout.strip() or "no output").splitlines()[-1]


def main() -> int:
    """Check clients and print the table, without torch, which most have; 1 if one fails, 2 if there is no wheel."""
    parser = argparse.ArgumentParser(prog="check_clients.py", description=__doc__)
    parser.add_argument(
        "programs", nargs="*", help=f"of {', '.join(client.program for client in CLIENTS)}; all by default"
    )
    parser.add_argument("--wheel", type=Path, help="by default the newest in dist/")
    arguments = parser.parse_args()
    wheels = [arguments.wheel] if arguments.wheel else sorted(DIST.glob("minexplore-*.whl"), key=os.path.getmtime)
    if not wheels or not wheels[-1].is_file():
        print(f"clients: no wheel in {DIST}; run `make wheel`, or give --wheel", file=sys.stderr)
        return 2
    wheel, failed = wheels[-1].resolve(), 0
    print("| client | packages | what ran |\n|---|---|---|")
    for client in CLIENTS:
        if arguments.programs and client.program not in arguments.programs:
            continue
        with tempfile.TemporaryDirectory() as folder:
            try:
                what = check(client, wheel, Path(folder))
            except (InstallError, RuntimeError, subprocess.TimeoutExpired) as error:
                what, failed = f"failed: {error}".replace("|", "/"), 1
        packages = ", ".join(package for package in client.packages if package != TORCH)
        print(f"| {client.name} | {packages} | {what} |", flush=True)
    return failed


if __name__ == "__main__":
    sys.exit(main())
