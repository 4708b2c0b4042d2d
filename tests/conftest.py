"""Fixtures: small mines as worlds, copies of the project, and data that some machines do not have."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import hypothesis
import pytest
from filelock import FileLock

from pipeline.compose import compose
from pipeline.params.config import Config
from stages.__main__ import STAGES
from tests.mines import RING, TEE, BuiltMine
from tests.project import ROOT, Project

# The same examples in every run, so that only a change of the code can fail a test. HYPOTHESIS_PROFILE=explore draws
# new ones.
hypothesis.settings.register_profile("steady", derandomize=True)
hypothesis.settings.register_profile("explore", derandomize=False)
hypothesis.settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "steady"))

SHARED = ROOT.parent / "shared" / "data"


@pytest.fixture(scope="session")
def shared_mine() -> Path:
    """Return the folder with the published plan, poses and sweeps, or skip the test."""
    folder = SHARED / "chilean_mine"
    if not folder.is_dir():
        pytest.skip("the published plan and sweeps are not on this machine (their licence is unclear)")
    return folder


@pytest.fixture(scope="session")
def shared_rock() -> Path:
    """Return the file of the scanned cave, or skip the test."""
    path = SHARED / "rock" / "cave1.stl"
    if not path.is_file():
        pytest.skip("the scanned cave is not on this machine")
    return path


@pytest.fixture(scope="session")
def config() -> Config:
    """Return the default configuration."""
    before = Path.cwd()
    os.chdir(ROOT)
    try:
        return compose([])
    finally:
        os.chdir(before)


@pytest.fixture(scope="session")
def tee(config: Config, tmp_path_factory: pytest.TempPathFactory) -> BuiltMine:
    """Return the T-junction as a world; tests must not change its folder."""
    return BuiltMine(TEE, config, tmp_path_factory.mktemp("tee"))


@pytest.fixture(scope="session")
def ring(config: Config, tmp_path_factory: pytest.TempPathFactory) -> BuiltMine:
    """Return the ring drift as a world with a coarse surface; tests must not change its folder."""
    coarse = compose(["surface.rough.spacing_m=0.3", "surface.rough.roof_spacing_m=0.4"])
    return BuiltMine(RING, coarse, tmp_path_factory.mktemp("ring"))


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """Return a new copy of the project with the tiny survey."""
    return Project(tmp_path / "mine", tiny=True)


@pytest.fixture(scope="session")
def traced_project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """Return a copy whose first two stages have run; tests may only run stages in it that fail."""
    project = Project(tmp_path_factory.mktemp("traced") / "mine", tiny=True)
    project.stages("survey", "contours")
    return project


def shared_folder(factory: pytest.TempPathFactory) -> Path:
    """Return a folder that all test workers share."""
    return factory.getbasetemp().parent if "PYTEST_XDIST_WORKER" in os.environ else factory.getbasetemp()


@pytest.fixture(scope="session")
def repro(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """Return a project with the tiny survey, built by `dvc repro`; tests work on copies."""
    shared = shared_folder(tmp_path_factory)
    with FileLock(shared / "repro.lock"):
        folder = shared / "repro" / "mine"
        if folder.is_dir():
            return Project.at(folder)
        project = Project(folder, tiny=True)
        (folder.parent / "stdout").write_text(project.run("dvc", "repro", check=True).stdout)
    return project


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """Return a project with the embedded survey and all six stages built; tests work on copies."""
    shared = shared_folder(tmp_path_factory)
    with FileLock(shared / "built.lock"):
        folder = shared / "built" / "mine"
        if folder.is_dir():
            return Project.at(folder)
        project = Project(folder, tiny=False)
        fresh = project.run(sys.executable, "-m", "dvc", "--cd", str(ROOT), "status", "--json")
        if fresh.returncode == 0 and fresh.stdout.strip() == "{}":  # `make all` has already built it
            shutil.rmtree(folder / "artifacts")
            shutil.copytree(ROOT / "artifacts", folder / "artifacts", ignore=shutil.ignore_patterns("bench*"))
        else:
            project.stages(*STAGES)
    return project
