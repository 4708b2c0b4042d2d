"""Mines with known answers, and copies of the project to run commands in."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import hypothesis
import numpy as np
import pytest
import shapely
from filelock import FileLock
from shapely import LineString, MultiPolygon, Polygon

from pipeline.compose import compose
from pipeline.geometry.rasterize import fill_polygon
from pipeline.mjcf.assemble import assemble_world
from pipeline.params.config import Config
from pipeline.store.codecs import encode
from pipeline.types import DriftNetwork, Frame, FreeSpace, Scale, Survey, Workings
from stages.__main__ import STAGES
from stages.compile3d import compile_rock
from stages.contours import trace_free_space
from stages.surface import model_surface

# The same examples on every run, so that a red test is a change of the code; HYPOTHESIS_PROFILE=explore draws others.
hypothesis.settings.register_profile("steady", derandomize=True)
hypothesis.settings.register_profile("explore", derandomize=False)
hypothesis.settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "steady"))

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared" / "data"

# Straight drift, ring drift with one island, T-junction: areas, loops and dead ends are known without a computer.
STRAIGHT = shapely.box(0, 0, 100, 5)
RING = shapely.box(0, 0, 60, 40).difference(shapely.box(6, 6, 54, 34))
TEE = shapely.union_all([shapely.box(0, 0, 80, 5), shapely.box(38, 5, 43, 40)])


@pytest.fixture(scope="session")
def shared_mine() -> Path:
    """Return the folder of the published plan, poses and sweeps, or skip."""
    folder = SHARED / "chilean_mine"
    if not folder.is_dir():
        pytest.skip("the published plan and sweeps are not on this machine (their licence is unclear)")
    return folder


@pytest.fixture(scope="session")
def shared_rock() -> Path:
    """Return the scanned cave, or skip."""
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


def frame_for(polygon: Polygon, px_per_m: float = 8.0, margin_m: float = 4.0) -> Frame:
    """Return a pixel grid around a polygon, the mine's origin on a pixel corner."""
    west, south, east, north = polygon.bounds
    left, above = round((margin_m - west) * px_per_m), round((north + margin_m) * px_per_m)
    width, height = left + round((east + margin_m) * px_per_m), above + round((margin_m - south) * px_per_m)
    return Frame(px_per_m, left, above, width, height)


def survey_of(frame: Frame, entrance_m: tuple[float, float]) -> Survey:
    """Return the record of a plan drawn at a stated scale."""
    return Survey("test", "plan", frame, Scale(frame.px_per_m, "stated"), [], entrance_m, {}, ["plan.png"])


def plan_of(polygon: Polygon, frame: Frame) -> np.ndarray:
    """Draw a polygon dark on light paper."""
    grey = np.where(fill_polygon(polygon, frame), 40, 255).astype(np.uint8)
    return cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)


PICTURE = Workings(MultiPolygon())  # the workings of a survey that is a picture


class BuiltMine:
    """A mine taken through stages 2 to 5 in memory, its bundle written to a folder."""

    def __init__(self, polygon: Polygon, config: Config, folder: Path, px_per_m: float = 8.0) -> None:
        """Run the stages' own functions."""
        self.frame = frame_for(polygon, px_per_m)
        inside = polygon.representative_point()
        self.survey = survey_of(self.frame, (inside.x, inside.y))
        traced = trace_free_space(config.contours, plan_of(polygon, self.frame), self.survey, PICTURE)
        self.raw, self.cleaned = traced["raw"], traced["cleaned"]
        self.free_space: FreeSpace = traced["free_space"]
        self.network: DriftNetwork = traced["topology"]
        self.compiled = compile_rock(config.compile3d, self.free_space, self.network, self.survey)
        self.surface = model_surface(config.surface, self.free_space, self.network, self.compiled["rock"])
        world = assemble_world(
            config.realism, self.survey, self.free_space, self.network, self.compiled["rock"],
            self.compiled["collision"], self.compiled["spawn"], self.surface["meshes"], self.surface["texture"],
            self.surface["overlay"],
            occupancy_npz=encode(Path("o.npz"), self.compiled["occupancy"]), free_space_bt=self.compiled["octree"],
            map_png=encode(Path("map.png"), self.compiled["map"]), map_yaml=self.compiled["map_yaml"].encode(),
        )["world"]  # fmt: skip
        self.bundle = folder
        for name, data in world.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)


@pytest.fixture(scope="session")
def tee(config: Config, tmp_path_factory: pytest.TempPathFactory) -> BuiltMine:
    """Return the T-junction as a world; do not change its folder."""
    return BuiltMine(TEE, config, tmp_path_factory.mktemp("tee"))


@pytest.fixture(scope="session")
def ring(config: Config, tmp_path_factory: pytest.TempPathFactory) -> BuiltMine:
    """Return the ring drift as a world; do not change its folder."""
    wide = compose(["surface.overlay.spacing_m=0.3", "surface.overlay.back_spacing_m=0.4"])
    return BuiltMine(RING, wide, tmp_path_factory.mktemp("ring"))


TINY_STATIONS = """leg,station,easting_m,northing_m,left_m,right_m
A,a0,0,0,2.5,2.5
A,a1,10,0,2.5,2.5
A,a2,30,0,2.5,2.5
A,a3,60,0,2.5,2.5
B,a2,30,0,2.5,2.5
B,b1,30,12,2.5,2.5
B,b2,30,30,2.5,2.5
"""

Run = Callable[..., subprocess.CompletedProcess]


class Project:
    """A copy of the tracked files, with a small survey in place of the embedded one."""

    def __init__(self, folder: Path, tiny: bool) -> None:
        """Copy the project into `folder` and make it a git repository of its own."""
        self.folder = folder
        files = subprocess.run(
            ["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout.splitlines()
        for name in files:
            if (ROOT / name).is_file():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, folder / name)
        (folder / ".venv").symlink_to(Path(sys.prefix))
        (folder / "dvc.lock").unlink(missing_ok=True)
        if tiny:
            self.use_stations(TINY_STATIONS)
            self.coarsen()
        self.run("git", "init", "-q")
        self.run("git", "add", "-A")
        self.run("git", "-c", "user.name=t", "-c", "user.email=t@example.org", "commit", "-qm", "start")

    def use_stations(self, text: str) -> None:
        """Make `text` the default survey and register it."""
        path = self.folder / "data" / "chilean_mine" / "tiny.csv"
        path.write_text(text)
        registry = self.folder / "data" / "registry.txt"
        kept = [line for line in registry.read_text().splitlines() if not line.startswith("chilean_mine/tiny.csv")]
        registry.write_text("\n".join(kept) + "\n")
        self.run(sys.executable, "-m", "pipeline", "register", "data/chilean_mine/tiny.csv", check=True)
        conf = self.folder / "conf" / "survey" / "stations.yaml"
        lines = [
            line for line in conf.read_text().splitlines()
            if not line.startswith(("stations:", "frame_m:", "margin_m:", "  ", "labels_m:", "scale:", "entrance_m"))
        ]  # fmt: skip
        lines += ["stations: data/chilean_mine/tiny.csv", "frame_m: null", "margin_m: 12.0", "entrance_m: [5.0, 0.0]"]
        lines += ["labels_m: {A: [10, 8]}", "scale: {source: bar, bar_length_m: 20.0}"]
        conf.write_text("\n".join(lines) + "\n")

    def coarsen(self) -> None:
        """Lay the rock's mesh wide and sample it thinly; the texture limits, the default's own, are left out."""
        surface, validation = (self.folder / "conf" / name / "default.yaml" for name in ("surface", "validation"))
        text = surface.read_text().replace("back_spacing_m: 0.14", "back_spacing_m: 0.4")
        surface.write_text(text.replace("  spacing_m: 0.10", "  spacing_m: 0.3"))
        text = validation.read_text().replace("points_per_m2: 3000", "points_per_m2: 200")
        text = text.replace("contacts: 1000", "contacts: 100")
        before, _, limits = text.partition("limits:\n")
        kept, _, rest = limits.partition("  texture:\n")
        validation.write_text(before + "limits:\n" + kept + "  world:\n" + rest.partition("  world:\n")[2])

    def copy(self, folder: Path) -> Project:
        """Return a private copy, artifacts included."""
        shutil.copytree(self.folder, folder, symlinks=True)
        return Project.at(folder)

    @classmethod
    def at(cls, folder: Path) -> Project:
        """Return a copy that is there already."""
        project = cls.__new__(cls)
        project.folder = folder
        return project

    def run(self, *command: str, check: bool = False, **env: str) -> subprocess.CompletedProcess:
        """Run a command in the project with its own imports and the environment's tools first on the path."""
        variables = {**os.environ, "PATH": f"{Path(sys.prefix) / 'bin'}:{os.environ['PATH']}", **env}
        variables.pop("PYTHONPATH", None)
        return subprocess.run(
            list(command), cwd=self.folder, env=variables, capture_output=True, text=True, check=check
        )

    def stage(self, name: str, *overrides: str, **env: str) -> subprocess.CompletedProcess:
        """Run one stage."""
        return self.run(sys.executable, "-m", f"stages.{name}", *overrides, **env)

    def stages(self, *names: str) -> None:
        """Compose and run stages, all of which must succeed."""
        self.run(sys.executable, "-m", "pipeline.compose", check=True)
        for name in names:
            self.stage(name).check_returncode()

    def hashes(self) -> dict[str, bytes]:
        """Return every artifact's bytes by name."""
        base = self.folder / "artifacts"
        return {p.relative_to(base).as_posix(): p.read_bytes() for p in sorted(base.rglob("*")) if p.is_file()}


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """Return a fresh copy of the project with the tiny survey."""
    return Project(tmp_path / "mine", tiny=True)


@pytest.fixture(scope="session")
def traced_project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """Return a copy whose first two stages have run; tests may run stages that fail, none that succeed."""
    project = Project(tmp_path_factory.mktemp("traced") / "mine", tiny=True)
    project.stages("survey", "contours")
    return project


def shared_folder(factory: pytest.TempPathFactory) -> Path:
    """Return a folder that all workers share."""
    return factory.getbasetemp().parent if "PYTEST_XDIST_WORKER" in os.environ else factory.getbasetemp()


@pytest.fixture(scope="session")
def repro(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """Return the tiny survey taken through all stages by `dvc repro`; tests work on copies."""
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
    """Return the embedded survey taken through all six stages; tests work on copies."""
    shared = shared_folder(tmp_path_factory)
    with FileLock(shared / "built.lock"):
        folder = shared / "built" / "mine"
        if folder.is_dir():
            return Project.at(folder)
        project = Project(folder, tiny=False)
        fresh = project.run(sys.executable, "-m", "dvc", "--cd", str(ROOT), "status", "--json")
        if fresh.returncode == 0 and fresh.stdout.strip() == "{}":  # `make all` has built just this
            shutil.rmtree(folder / "artifacts")
            shutil.copytree(ROOT / "artifacts", folder / "artifacts", ignore=shutil.ignore_patterns("bench*"))
        else:
            project.stages(*STAGES)
    return project


def message_of(done: subprocess.CompletedProcess) -> str:
    """Return the one message of a refused command."""
    assert done.returncode == 2, (done.returncode, done.stderr)
    assert "Traceback" not in done.stderr
    return done.stderr.strip()


def random_mine(rng: np.random.Generator, drifts: int) -> Polygon:
    """Return connected workings: drifts of random widths from random stations of the ones before."""
    points = [np.array([0.0, 0.0])]
    shapes = []
    for _ in range(drifts):
        start = points[rng.integers(len(points))]
        heading = rng.uniform(-np.pi, np.pi)
        end = start + rng.uniform(12, 30) * np.array([np.cos(heading), np.sin(heading)])
        shapes.append(LineString([start, end]).buffer(rng.uniform(1.5, 3.0)))
        points.append(end)
    return shapely.union_all(shapes)
