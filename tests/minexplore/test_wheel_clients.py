"""The wheel by itself: examples in an empty environment, and the checkers of training libraries."""

import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fixtures import build_once
from tests.project import ROOT, Project

COMMAND = runpy.run_path(str(ROOT / "packaging" / "check_clients.py"))
CLIENTS, TORCH, InstallError, check, install = (
    COMMAND[name] for name in ("CLIENTS", "TORCH", "InstallError", "check", "install")
)
# The page below leads to `train_sb3.py`.
WORDS = {
    "drive.py": ["--steps", "3"],
    "map_from_lidar.py": ["--steps", "11"],
    "place_robot.py": ["--seconds", "0.5"],
}

OF_CORE = """
import importlib, pkgutil, minexplore
for name in set(minexplore.__all__) - {"MineVecEnv"}:  # extra `sb3`
    getattr(minexplore, name)
for module in pkgutil.walk_packages(minexplore.__path__, "minexplore."):
    if not module.name.startswith(("minexplore.extra.", "minexplore.envs.multi_agent")):  # extra `team`
        importlib.import_module(module.name)
print(minexplore.load("chilean_mine").folder)
"""


@pytest.fixture(scope="session")
def wheel(repro: Project, tmp_path_factory):
    def build(folder: Path) -> None:
        done = repro.copy(folder).run("env", "PYTHONPATH=.", sys.executable, "packaging/build_wheel.py")
        assert done.returncode == 0, done.stderr

    return next((build_once(tmp_path_factory, "wheel", build) / "dist").glob("minexplore-*.whl"))


@pytest.fixture(scope="session")
def installed(tmp_path_factory):
    """Return a function that returns the interpreter of an environment with a package, one for all tests."""

    def once(of: str, what: str) -> str:
        def build(folder: Path) -> None:
            folder.mkdir()
            install(what, (), folder)

        try:
            return str(build_once(tmp_path_factory, f"with-{of}", build) / "environment/bin/python")
        except InstallError as error:
            pytest.skip(f"{what} cannot be installed here: {error}")

    return once


def extra_of(example: str) -> str:
    """Return the extra that an example's first lines name, with brackets."""
    found = re.search(r"the wheel and its extra `(\w+)`", (ROOT / "examples" / example).read_text())
    return f"[{found[1]}]" if found else ""


def run_from_wheel(python: str, *words: str, folder: Path, **env: str) -> str:
    """Run a program with the packages of an environment alone and return what it prints."""
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run([python, *words], cwd=folder, env={**variables, **env}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("example", sorted(WORDS))
def test_an_example_runs_from_the_wheel_with_the_extra_that_it_names(wheel, installed, example, tmp_path):
    extra = extra_of(example)
    python = installed(f"wheel{extra.strip('[]')}", f"{wheel}{extra}")
    run_from_wheel(python, str(ROOT / "examples" / example), *WORDS[example], folder=tmp_path, MUJOCO_GL="osmesa")


@pytest.mark.slow
def test_the_wheel_alone_has_all_of_the_core_and_bundles_are_read_without_it(wheel, installed, tmp_path):
    python = installed("wheel", str(wheel))
    world = run_from_wheel(python, "-c", OF_CORE, folder=tmp_path).strip()
    example = str(ROOT / "examples" / "read_bundle.py")
    assert "m north of the start" in run_from_wheel(python, example, world, folder=tmp_path)


@pytest.mark.slow
def test_the_lines_of_the_page_lead_from_an_empty_environment_to_ppo_in_an_own_mine(wheel):
    page = (ROOT / "docs/start.md").read_text()
    made, new, *lines = re.search(r"```sh\n(make all && make wheel\n.*?)```", page, re.S)[1].splitlines()
    assert len(lines) + 2 <= 10
    assert made == "make all && make wheel"  # as the fixture did
    assert f'{extra_of("train_sb3.py")}"' in next(line for line in lines if "pip install" in line)
    folder, path = wheel.parents[1], f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    small = {"plan.png": "data/chilean_mine/tiny.csv preset=light", '[sb3]"': '[sb3]" torch==2.13.0'}
    for line in (new, *lines):
        command = line + (" --steps 64 --robots 2" if line == lines[-1] else "")
        for of_page, here in small.items():
            command = command.replace(of_page, here)
        words = {"cwd": folder, "env": {**variables, "PATH": path}, "capture_output": True, "text": True}
        done = subprocess.run(command, shell=True, **words)
        if done.returncode and "pip install" in line:
            pytest.skip(f"the packages of the wheel cannot be installed here: {done.stderr.splitlines()[-1]}")
        assert done.returncode == 0, (command, done.stderr)
    assert (folder / "ppo_mine.zip").is_file()


@pytest.mark.slow
@pytest.mark.parametrize("client", CLIENTS, ids=lambda client: client.name)
def test_a_client_s_own_checker_passes_with_the_wheel(wheel, installed, client, tmp_path):
    if TORCH in client.packages:  # unpacked once: each client has links to its files
        packages = Path(installed("torch", TORCH)).parents[1] / "lib"
        (tmp_path / "environment").mkdir()
        subprocess.run(["cp", "-al", packages, tmp_path / "environment/lib"], check=True)
    try:
        assert check(client, wheel, tmp_path)
    except InstallError as error:
        pytest.skip(f"{client.name} cannot be installed here: {error}")
