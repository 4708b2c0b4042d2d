"""Fixtures: small mines as worlds, copies of the project, and data that some machines do not have."""

from __future__ import annotations

import contextlib
import gc
import os
import pickle
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import hypothesis
import pytest
from filelock import FileLock

import pipeline  # noqa: F401  (it chooses MuJoCo's OpenGL, before anything imports MuJoCo)
from tests.project import ROOT, Project

if TYPE_CHECKING:  # the process that hands out tests loads this file, too: fixtures import what they use
    from pipeline.params.config import Config
    from tests.mines import BuiltMine

if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    # A shell starts background jobs so. Commands that tests start and interrupt would inherit it.
    signal.signal(signal.SIGINT, signal.default_int_handler)

# The same examples in every run, so that only a change of the code can fail a test. HYPOTHESIS_PROFILE=explore draws
# new ones. No example has a limit on time: it would depend on what else the machine does.
hypothesis.settings.register_profile("steady", derandomize=True, deadline=None)
hypothesis.settings.register_profile("explore", derandomize=False, deadline=None)
hypothesis.settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "steady"))

# The walls of drawn test mines follow the borders of pixels, corners too.
EXACT_WALLS = ["contours.trace=pixels", "contours.tolerance_m=0.21"]
SMALL_PICTURES = ["surface.texture.size_px=256", "realism.preview_width_px=400"]
SHARED = ROOT.parent / "shared" / "data"

gc.disable()  # while modules are imported and tests collected, nothing of them becomes garbage: a fifth of that time


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put tests of whole pipelines first: one worker builds them, the other starts with the second half."""
    items.sort(key=lambda item: not {"repro", "built"} & set(getattr(item, "fixturenames", ())))


def pytest_collection_finish() -> None:
    """Leave modules and collected tests out of all later collections of garbage."""
    gc.collect()
    gc.freeze()
    gc.enable()


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
    """Return the default configuration, but for the walls of drawn test mines and the size of pictures."""
    from tests.composed import compose

    return compose([*EXACT_WALLS, *SMALL_PICTURES])


def build_once(factory: pytest.TempPathFactory, name: str, build: Callable[[Path], None]) -> Path:
    """Return a folder that all test workers share; the first worker that asks builds it, the others wait."""
    base = factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    folder, complete = shared / name, shared / f"{name}.complete"
    with FileLock(shared / f"{name}.lock"):
        if not complete.exists():
            shutil.rmtree(folder, ignore_errors=True)  # of a worker whose build failed
            build(folder)
            complete.touch()
    return folder


def share_mine(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], Any]) -> Any:
    """Return a mine that one worker makes in a folder and writes for the others."""

    def build(folder: Path) -> None:
        folder.mkdir()
        (folder / "mine.pickle").write_bytes(pickle.dumps(make(folder)))

    return pickle.loads((build_once(factory, name, build) / "mine.pickle").read_bytes())


def share_volume(factory: pytest.TempPathFactory, name: str) -> Path:
    """Return the bundle of a station table of `tests.volumes` as one volume, which one worker builds for all."""

    def build(folder: Path) -> None:
        from tests import volumes  # it composes a configuration, which few tests need

        folder.mkdir()
        volumes.build_volume(getattr(volumes, name), folder)

    return build_once(factory, name, build) / "world"


@pytest.fixture(scope="session")
def tee(config: Config, tmp_path_factory: pytest.TempPathFactory) -> BuiltMine:
    """Return the T-junction as a world; tests must not change its folder."""
    from tests.mines import TEE, BuiltMine

    return share_mine(tmp_path_factory, "tee", lambda folder: BuiltMine(TEE, config, folder / "world"))


@pytest.fixture(scope="session")
def ring(tmp_path_factory: pytest.TempPathFactory) -> BuiltMine:
    """Return the ring drift as a world with a coarse surface; tests must not change its folder."""
    from tests.composed import compose
    from tests.mines import RING, BuiltMine

    coarse = [f"surface.rough.{spacing}" for spacing in ("spacing_m=0.3", "roof_spacing_m=0.4")]
    config = compose([*EXACT_WALLS, *SMALL_PICTURES, *coarse])
    return share_mine(tmp_path_factory, "ring", lambda folder: BuiltMine(RING, config, folder / "world"))


@pytest.fixture(scope="session")
def small_world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the bundle of a ring with a coarse surface; tests must not change its folder."""

    def build(folder: Path) -> None:
        from benchmarks.worlds.small_world import build_small_world
        from tests.mines import unreported

        with unreported():
            build_small_world(folder / "world")

    return build_once(tmp_path_factory, "small", build) / "world"


@pytest.fixture(scope="session")
def box(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the bundle of a drift of 20 m, 4 m wide, as one volume; tests must not change its folder."""
    return share_volume(tmp_path_factory, "BOX")


@pytest.fixture(scope="session")
def ramp(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the bundle of a drift with a ramp of 15 % in its middle third, likewise."""
    return share_volume(tmp_path_factory, "RAMP")


@pytest.fixture(scope="session")
def over(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the bundle of a drift over another, 8 m apart, and of the ramp that joins them, likewise."""
    return share_volume(tmp_path_factory, "OVER")


@pytest.fixture(scope="session")
def light() -> Config:
    """Return the configuration of worlds without visible rock."""
    from tests.composed import compose

    return compose(["preset=light"])


@pytest.fixture(scope="session")
def unbuilt(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """Return a project with the tiny survey in which nothing has run; tests work on copies."""
    return Project.at(build_once(tmp_path_factory, "unbuilt", lambda folder: Project(folder, tiny=True)))


@pytest.fixture
def project(unbuilt: Project, tmp_path: Path) -> Project:
    """Return a new copy of the project with the tiny survey."""
    return unbuilt.copy(tmp_path / "mine")


@pytest.fixture(scope="session")
def traced(unbuilt: Project, tmp_path_factory: pytest.TempPathFactory) -> Project:
    """Return a project with the tiny survey whose first two stages have run; tests work on copies."""
    return Project.at(
        build_once(tmp_path_factory, "traced", lambda folder: unbuilt.copy(folder).stages("survey", "contours"))
    )


@pytest.fixture(scope="session")
def traced_project(traced: Project, tmp_path_factory: pytest.TempPathFactory) -> Project:
    """Return this worker's copy of `traced`; tests may only run stages in it that fail."""
    return traced.copy(tmp_path_factory.mktemp("traced") / "mine")


@pytest.fixture(scope="session")
def repro(unbuilt: Project, tmp_path_factory: pytest.TempPathFactory) -> Project:
    """Return a project with the tiny survey, built by `dvc repro`; tests work on copies."""

    def build(folder: Path) -> None:
        project = unbuilt.copy(folder / "mine")
        (folder / "stdout").write_text(project.run("dvc", "repro", check=True).stdout)

    return Project.at(build_once(tmp_path_factory, "repro", build) / "mine")


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """Return a project with the embedded survey and all six stages built; tests work on copies."""

    def build(folder: Path) -> None:
        from pipeline.compose import compose_after_root
        from pipeline.stage import ARTIFACTS, is_fresh
        from stages.__main__ import STAGES, load_stages

        project = Project(folder, tiny=False)
        with contextlib.chdir(ROOT):
            config = compose_after_root([])
            has_run = all(is_fresh(stage, getattr(config, stage.name), ARTIFACTS) for stage in load_stages())
        if has_run:  # `make all` has already built it
            for name in (*STAGES, "report"):
                shutil.copytree(ROOT / "artifacts" / name, folder / "artifacts" / name, dirs_exist_ok=True)
            shutil.copy2(ROOT / "artifacts" / "params.json", folder / "artifacts" / "params.json")
        else:
            project.stages(*STAGES)

    return Project.at(build_once(tmp_path_factory, "built", build))
