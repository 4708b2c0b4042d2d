"""The workflows and the container: pinned, without needless rights, and made of make targets that exist."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from benchmarks.__main__ import BENCHMARKS
from tests.project import ROOT

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
OWN_COMMANDS = (
    r"sh \.github/comment\.sh \|.*",
    r"gh pr comment .*",
    r"cat docs/evidence/parts/env-speed\.md >> .*",
    r"tar -czf dist/docs\.tar\.gz -C artifacts/site \.",
    r"cp artifacts/sbom\.json dist/",
    r"\.venv/bin/python -m hatchling build -t sdist -d dist",
    r"python -m pip install \.",
    r'python -c "import minexplore"',
    r"python -m (minexplore|pipeline) list",
)


def steps_of(workflow):
    """Yield each job's name, the job, and each of its steps."""
    for name, job in yaml.safe_load(workflow.read_text())["jobs"].items():
        for step in job["steps"]:
            yield name, job, step


def make_targets():
    """Return the targets of the Makefile, the stages among them."""
    text = (ROOT / "Makefile").read_text()
    stages = re.search(r"^STAGES := (.*)$", text, flags=re.M)[1].split()
    return {*stages, *re.findall(r"^([a-z][a-z-]*):", text, flags=re.M)}


def test_make_has_at_most_25_targets_and_its_help_fits_30_lines():
    assert len(make_targets()) <= 25, sorted(make_targets())
    done = subprocess.run(["make", "help"], cwd=ROOT, capture_output=True, text=True)
    assert 0 < len(done.stdout.splitlines()) <= 30


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.name)
def test_every_action_is_pinned_by_a_commit_with_its_version_beside_it(workflow):
    lines = [line.strip() for line in workflow.read_text().splitlines() if "uses:" in line]
    assert len(lines) == sum("uses" in step for _, _, step in steps_of(workflow)) > 0
    for line in lines:
        assert re.fullmatch(r"- uses: [\w-]+/[\w-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", line), line


def test_one_action_has_one_version_in_all_workflows():
    pins = {tuple(pin) for path in WORKFLOWS for pin in re.findall(r"uses: (\S+)@(\S+ # \S+)", path.read_text())}
    assert len(pins) == len({name for name, _ in pins})


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_runs_make_targets_that_exist_and_little_else(workflow):
    for name, _, step in steps_of(workflow):
        command = step.get("run")
        if command is None or any(re.fullmatch(own, command) for own in OWN_COMMANDS):
            continue
        words = command.split()
        if words[:3] == [".venv/bin/python", "-m", "benchmarks"]:
            assert words[3] in {b.name for b in BENCHMARKS}, (name, command)
            continue
        assert words[0] == "make", (name, command)
        assert set(words[1:]) <= make_targets(), (name, command)


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.name)
def test_only_a_job_that_runs_no_code_of_the_repository_may_write(workflow):
    record = yaml.safe_load(workflow.read_text())
    assert record["permissions"] == {"contents": "read"}
    assert "pull_request_target" not in workflow.read_text()
    for name, job, step in steps_of(workflow):
        rights = {right for right, value in job.get("permissions", {}).items() if value == "write"}
        if rights:
            assert "checkout" not in step.get("uses", ""), name
            assert re.match(r"gh pr comment ", step.get("run", "gh pr comment ")), name
        if "pull-requests" in rights:
            assert "head.repo.full_name == github.repository" in job["if"], name
        elif rights:  # to sign what another job built, for a tag that a maintainer pushed
            assert rights == {"id-token", "attestations"}, name
            assert record[True] == {"push": {"tags": ["v*"]}}, name  # YAML reads the key `on` as true
        if "checkout" in step.get("uses", ""):
            assert step["with"]["persist-credentials"] is False, name


def test_a_release_attests_the_wheel_the_documentation_and_the_list_of_packages_that_it_built():
    jobs = yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text())["jobs"]
    commands = [step["run"] for step in jobs["build"]["steps"] if "run" in step]
    assert {"make wheel", "make docs", ".venv/bin/python -m benchmarks sbom"} <= set(commands)
    assert jobs["attest"]["needs"] == "build"
    *_, last = jobs["attest"]["steps"]
    assert last["uses"].startswith("actions/attest-build-provenance@")
    assert last["with"]["subject-path"] == "dist/*"


@pytest.mark.parametrize("name", ["SECURITY.md", "CODE_OF_CONDUCT.md", ".github/pull_request_template.md"])
def test_a_file_that_a_host_shows_has_only_links_and_targets_that_exist(name):
    text = (ROOT / name).read_text()
    for link in re.findall(r"\]\((?!https?:)([^)]+)\)", text):
        assert (ROOT / link).is_file(), link
    assert set(re.findall(r"`make ([a-z-]+)`", text)) <= make_targets()


def test_the_container_is_a_debian_where_make_setup_ran():
    text = (ROOT / "Dockerfile").read_text().replace("\\\n", " ")
    runs = [re.sub(r"\s+", " ", command) for command in re.findall(r"^RUN (.*)$", text, flags=re.M)]
    system = "apt-get update && apt-get install -y --no-install-recommends make && rm -rf /var/lib/apt/lists/*"
    assert runs == [system, "make setup"]
    folder = ROOT / ".devcontainer"
    container = json.loads((folder / "devcontainer.json").read_text())
    assert (folder / container["build"]["dockerfile"]).resolve() == ROOT / "Dockerfile"
    assert (folder / container["build"]["context"]).resolve() == ROOT
    assert container["postCreateCommand"] == "make setup"
    assert re.search(rf"^WORKDIR {container['workspaceFolder']}$", text, flags=re.M)


@pytest.fixture
def merged(tmp_path):
    """Return a repository whose HEAD merges a head into a base, with a metrics file in git, and a function to run."""
    settings = {"GIT_CONFIG_GLOBAL": os.devnull, "GITHUB_SERVER_URL": "https://git.example", "GITHUB_REPOSITORY": "a/b"}
    names = {"GIT_AUTHOR_NAME": "t", "GIT_AUTHOR_EMAIL": "t@example.org"}
    names |= {"GIT_COMMITTER_NAME": "t", "GIT_COMMITTER_EMAIL": "t@example.org"}
    tools = str(Path(sys.prefix) / "bin")
    variables = {**os.environ, **settings, **names, "DVC": f"{tools}/dvc"}

    def run(*command):
        done = subprocess.run(command, cwd=tmp_path, env=variables, capture_output=True, text=True)
        assert done.returncode == 0, (command, done.stderr)
        return done.stdout.strip()

    (tmp_path / "docs").mkdir()
    run("git", "init", "-q", "-b", "main")
    run(f"{tools}/dvc", "init", "-q")
    (tmp_path / "dvc.yaml").write_text("metrics:\n- metrics.json\n")
    for name in ("world.jpg", "views.jpg"):
        (tmp_path / "docs" / name).write_bytes(b"before")
    (tmp_path / "metrics.json").write_text('{"iou": 0.98}')
    run("git", "add", "-A")
    run("git", "commit", "-qm", "base")
    run("git", "checkout", "-qb", "head")
    (tmp_path / "docs" / "world.jpg").write_bytes(b"after")
    (tmp_path / "metrics.json").write_text('{"iou": 0.99}')
    run("git", "commit", "-qam", "head")
    run("git", "checkout", "-q", "main")
    run("git", "merge", "-q", "--no-ff", "head", "-m", "merge")
    return tmp_path, run


def test_the_comment_on_a_pull_request_shows_metrics_and_pictures_before_and_after(merged):
    _, run = merged
    base, head = run("git", "rev-parse", "HEAD^1"), run("git", "rev-parse", "HEAD^2")
    text = run("sh", str(ROOT / ".github" / "comment.sh"))
    row = next(line for line in text.splitlines() if "iou" in line)
    assert [cell.strip() for cell in row.strip("|").split("|")] == ["metrics.json", "iou", "0.98", "0.99", "0.01"]
    files = "https://git.example/a/b/raw"
    for name in ("docs/world.jpg", "docs/views.jpg"):
        assert f"| ![before]({files}/{base}/{name}) | ![after]({files}/{head}/{name}) |" in text
    assert "drew other pictures" not in text


def test_the_comment_measures_the_build_and_says_when_it_drew_other_pictures_than_are_committed(merged):
    folder, run = merged
    (folder / "metrics.json").write_text('{"iou": 0.98}')
    (folder / "docs" / "views.jpg").write_bytes(b"as built")
    text = run("sh", str(ROOT / ".github" / "comment.sh"))
    assert "| none changed |" in text
    assert "drew other pictures" in text


def test_setup_on_a_bare_system_asks_for_python_git_and_certificates(tmp_path):
    # A PATH without Python and git, an apt-get that notes what it is asked for, and no library in the linker's cache.
    tools = tmp_path / "bin"
    tools.mkdir()
    for name in ("sh", "cmp", "cat", "env"):
        (tools / name).symlink_to(shutil.which(name))
    stubs = {"apt-get": f'echo "$@" >> {tmp_path}/asked', "ldconfig": "true", "id": "echo 0"}
    for name, script in stubs.items():
        (tools / name).write_text(f"#!{shutil.which('sh')}\n{script}\n")
        (tools / name).chmod(0o755)
    done = subprocess.run(
        [shutil.which("sh"), str(ROOT / "requirements" / "setup.sh"), "dev"],
        cwd=tmp_path,
        env={"PATH": str(tools)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2  # the stub installs nothing
    assert "no Python 3.11, 3.12 or 3.13 found" in done.stderr
    asked = (tmp_path / "asked").read_text().splitlines()[-1].split()
    assert {"python3", "python3-venv", "git", "ca-certificates", "libosmesa6"} <= set(asked)


def set_up(folder):
    """Run setup in a checkout whose packages are installed; it has nothing to download."""
    (folder / "bin").mkdir(exist_ok=True)
    (folder / "bin" / "apt-get").write_text("#!/bin/sh\nexit 0\n")  # a package of the system may be missing
    (folder / "bin" / "apt-get").chmod(0o755)
    path = f"{folder / 'bin'}:{os.environ['PATH']}"
    done = subprocess.run(
        ["sh", "requirements/setup.sh", "dev"], cwd=folder, env={**os.environ, "PATH": path}, capture_output=True
    )
    assert (done.returncode, done.stdout) == (0, b""), done.stderr


def where_is_minexplore(python, folder):
    program = "import minexplore; print(minexplore.__file__)"
    done = subprocess.run([python, "-c", program], cwd=folder, env={}, capture_output=True, text=True)
    return done.stdout.strip()


def test_after_setup_the_environment_is_imported_from_any_folder_also_when_the_checkout_moved(tmp_path):
    checkout, moved, elsewhere = (tmp_path / name for name in ("checkout", "moved", "elsewhere"))
    elsewhere.mkdir()
    shutil.copytree(ROOT / "requirements", checkout / "requirements")
    (checkout / "minexplore").mkdir()
    (checkout / "minexplore" / "__init__.py").touch()
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", checkout / ".venv"], check=True)
    shutil.copy2(checkout / "requirements" / "dev.txt", checkout / ".venv" / ".installed")
    set_up(checkout)
    python = checkout / ".venv" / "bin" / "python"
    assert where_is_minexplore(python, elsewhere) == str(checkout / "minexplore" / "__init__.py")
    shutil.copytree(checkout, moved, ignore=shutil.ignore_patterns(".venv"))
    (moved / ".venv").symlink_to(checkout / ".venv")
    set_up(moved)  # the link's environment belongs to the first checkout
    assert where_is_minexplore(python, elsewhere) == str(checkout / "minexplore" / "__init__.py")
    (moved / ".venv").unlink()
    (checkout / ".venv").rename(moved / ".venv")
    set_up(moved)
    assert where_is_minexplore(moved / ".venv" / "bin" / "python", elsewhere) == str(
        moved / "minexplore" / "__init__.py"
    )
