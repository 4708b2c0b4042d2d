"""What a command loads when it starts: libraries that take long to load are loaded by what uses them."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.project import ROOT

# Libraries that one kind of world or survey needs, and the seconds that they took to load, measured with process time.
DEAR_S = {"mujoco": 0.2, "matplotlib": 0.4, "open3d": 0.6, "trimesh": 0.5, "ezdxf": 0.27, "torch": 2.0}
NEEDED = {  # by every world
    "stages.realism": {"mujoco"},
    "stages.validation": {"mujoco"},
    "pipeline.report.page": {"mujoco", "matplotlib", "trimesh"},
    "pipeline.compose": {"mujoco"},  # the robot's measures
}
STARTS = [f"stages.{name}" for name in ("survey", "contours", "compile3d", "surface", "realism", "validation")]


def file_of(module: str) -> Path | None:
    stem = ROOT / module.replace(".", "/")
    return next((path for path in (stem.with_suffix(".py"), stem / "__init__.py") if path.is_file()), None)


def loaded_names(module: str) -> set[str]:
    """Return what a module imports when it is loaded, not inside a function."""
    names: set[str] = set()
    for node in ast.parse(file_of(module).read_text()).body:
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return {".".join(name.split(".")[:depth]) for name in names for depth in range(1, name.count(".") + 2)}


@pytest.fixture(scope="module")
def loaded():
    """Return a function that lists all that a module of the project loads, directly or by others."""
    known: dict[str, set[str]] = {}

    def closure(module: str) -> set[str]:
        found, queue = set(), [module]
        while queue:
            name = queue.pop()
            if name not in known:
                known[name] = loaded_names(name)
            queue += [other for other in known[name] - found if file_of(other)]
            found |= known[name]
        return found

    return closure


@pytest.mark.parametrize("module", [*STARTS, "pipeline.report.page", "pipeline.compose", "pipeline.__main__"])
def test_a_command_loads_no_dear_library_that_only_some_worlds_need(module, loaded):
    names = loaded(module)
    assert "pipeline.errors" in names  # imports are followed
    assert names & DEAR_S.keys() == NEEDED.get(module, set())


def test_importing_the_environment_package_loads_no_physics():
    assert "gymnasium.envs.registration" in loaded_names("minexplore")
    assert not loaded_names("minexplore") & {"mujoco", "scipy"}


def test_make_lets_python_keep_what_it_has_compiled():
    probe = 'probe:; @python3 -c "import sys; print(sys.dont_write_bytecode)"'
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    command = ["make", "-s", "--eval", probe, "probe"]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


@pytest.mark.parametrize("folder", ["minesurveys", "pipeline", "stages", "tests"])
def test_open3d_is_loaded_in_one_place_alone(folder):
    """Elsewhere it would have threads, for which a forked process waits for ever."""
    files = [path for path in (ROOT / folder).rglob("*.py") if re.search(r"^ *import open3d", path.read_text(), re.M)]
    assert not files
    assert 'import_module("open3d")' in (ROOT / "pipeline/geometry/ray_scene.py").read_text()


def test_scenes_for_rays_load_no_web_server():
    code = (
        "import sys, numpy as np; from pipeline.geometry.raycast import RayCaster; "
        "caster = RayCaster(np.array([[[0.0, 0, 2], [4, 0, 2], [0, 4, 2]]])); "
        "assert caster.cast(np.ones((1, 3)), np.array([[0.0, 0, 1]]))[0] == 1; "
        "assert 'open3d' in sys.modules and not {'dash', 'plotly'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


def test_importing_a_mine_or_building_a_volume_loads_only_what_it_needs():
    """Pyogrio loads pandas, and only GeoPackages and Shapefiles are read by it."""
    code = (
        "import sys, pipeline.import_mine; "
        "assert not {'pandas', 'pyogrio', 'pypdfium2'} & set(sys.modules); "
        "import stages.survey; assert 'pypdfium2' not in sys.modules; "
        "import pipeline.volume.world.compile, pipeline.volume.world.proof.certificate, pipeline.survey.load, "
        "pipeline.volume.world.surface.build, pipeline.mjcf.rough_floor; "
        "assert not {'open3d', 'dash'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


FIRST_OBSERVATION = """
import sys, gymnasium, minexplore
gymnasium.make("MineXplore/World-v0", world=sys.argv[1]).reset(seed=0)
print(*(module.__file__ for module in sys.modules.values() if getattr(module, "__file__", None)), sep="\\n")
"""


def test_the_default_environment_loads_at_most_five_thousand_lines():
    bundle = ROOT / "artifacts/realism/world"
    if not bundle.is_dir():
        pytest.skip("the default world is not built (make all)")
    command = [sys.executable, "-c", FIRST_OBSERVATION, str(bundle)]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    files = [Path(line) for line in done.stdout.splitlines() if line.endswith(".py")]
    own = {path.relative_to(ROOT).as_posix(): path for path in files if path.is_relative_to(ROOT / "minexplore")}
    assert "minexplore/envs/env.py" in own
    assert sum(path.read_text().count("\n") for path in own.values()) <= 5_000
    assert not [name for name in own if name.startswith(("minexplore/extra/", "minexplore/pictures/"))]
