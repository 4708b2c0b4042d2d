"""The metadata of both distributions, the version, and the source distribution."""

import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from importlib import import_module

import gymnasium
import pytest
import yaml

import minexplore
from tests.project import ROOT, modules_below

PROJECTS = ("pyproject.toml", "packaging/pyproject.toml")
APART = ("baselines", "benchmarks", "minesurveys", "pieces")  # distributions of their own


def project_of(name):
    return tomllib.loads((ROOT / name).read_text())


def test_the_version_stands_in_one_place_and_the_citation_agrees():
    for name in PROJECTS:
        record = project_of(name)
        assert "version" not in record["project"]
        assert record["tool"]["hatch"]["version"]["path"] == "minexplore/__init__.py"
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text())["version"] == minexplore.__version__
    for package in ("pipeline", "baselines"):
        assert "__version__ =" not in (ROOT / package / "__init__.py").read_text()


@pytest.mark.parametrize("name", PROJECTS)
def test_a_console_script_is_a_function_that_exists(name):
    for target in project_of(name)["project"]["scripts"].values():
        module, function = target.split(":")
        assert callable(getattr(import_module(module), function))


def test_both_distributions_have_the_same_authors_addresses_and_classifiers():
    one, other = (project_of(name)["project"] for name in PROJECTS)
    for key in ("authors", "urls", "classifiers", "keywords", "requires-python"):
        assert one[key] == other[key]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert [author["name"] for author in one["authors"]] == [author["name"] for author in citation["authors"]]
    assert one["urls"]["Repository"] == citation["repository-code"]


@pytest.mark.parametrize("package", ["minexplore", "pipeline", "baselines"])
def test_a_package_says_that_it_is_typed(package):
    assert (ROOT / package / "py.typed").is_file()


@pytest.mark.parametrize("package", APART)
def test_a_distribution_apart_has_the_version_of_the_others_and_a_wheel_without_tests(package, tmp_path):
    record = project_of(f"{package}/pyproject.toml")
    project = package if package == "minesurveys" else f"minexplore-{package}"
    assert record["project"]["name"] == project
    assert record["tool"]["hatch"]["version"]["path"] == "../minexplore/__init__.py"
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT / package, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (wheel,) = tmp_path.glob("*.whl")
    assert wheel.name.startswith(f"{project.replace('-', '_')}-{minexplore.__version__}-")
    names = set(zipfile.ZipFile(wheel).namelist())
    modules = {path.relative_to(ROOT).as_posix() for path in modules_below(package)}
    assert {name for name in names if name.endswith(".py")} == modules
    assert not [name for name in names if not name.startswith((f"{package}/", f"{project.replace('-', '_')}-"))]


def test_what_baselines_need_is_what_the_lock_is_made_of():
    root, apart = project_of("pyproject.toml")["project"], project_of("baselines/pyproject.toml")["project"]
    train, locked = (set(apart["optional-dependencies"]["train"]), set(root["optional-dependencies"]["baselines"]))
    assert locked == train - set(root["dependencies"])
    assert set(apart["dependencies"]) - {"minexplore", "minexplore-pieces"} <= {*root["dependencies"], *locked}


def test_every_link_on_the_page_of_the_wheel_is_absolute(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "packaging"))
    monkeypatch.chdir(ROOT)
    build_wheel = import_module("build_wheel")
    from minexplore.page import page

    links = re.findall(r"\]\(([^)]+)\)", build_wheel.with_absolute_links(page()))
    assert links
    assert all(link.startswith(("https://", "#")) for link in links), links


def test_gymnasium_imports_the_package_before_the_colon_of_an_id():
    program = "import gymnasium; env = gymnasium.make('minexplore:MineXplore/World-v0', world='no-such-folder')"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True)
    assert "no-such-folder" in done.stderr.splitlines()[-1]  # the environment was found; the world was not


@pytest.mark.skipif(
    not (ROOT / "artifacts/realism/world/world.json").is_file(), reason="the default world is not built: `make all`"
)
def test_the_default_mine_is_made_by_the_id_with_the_package_before_a_colon():
    env = gymnasium.make("minexplore:MineXplore/ChileanMine-v0")
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    env.close()


@pytest.mark.slow
def test_the_source_distribution_is_built_and_holds_the_packages(tmp_path):
    command = [sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=dict(os.environ))
    assert done.returncode == 0, done.stderr
    (archive,) = tmp_path.glob("*.tar.gz")
    assert archive.name == f"minexplore_pipeline-{minexplore.__version__}.tar.gz"
    with tarfile.open(archive) as packed:
        names = {name.partition("/")[2] for name in packed.getnames()}
    assert {"pyproject.toml", "minexplore/__init__.py", "pipeline/py.typed", "conf/config.yaml", "Makefile"} <= names
    assert not any(name.startswith(("artifacts/realism", ".venv")) for name in names)


def test_the_page_of_dependencies_has_every_package_with_the_versions_of_the_locks():
    from benchmarks.tables.dependencies import PAGE, asked, locked

    rows = re.findall(r"^\| ([a-z][^|]*) \| ([^|]*) \| ([^|]*) \|", (ROOT / PAGE).read_text(), flags=re.M)[1:]
    versions = locked()
    assert len(rows) > 60
    wanted = {(name, limits, ", ".join(versions.get(name, []))) for name, limits in asked().items()}
    assert {tuple(cell.strip() for cell in row) for row in rows} == wanted
