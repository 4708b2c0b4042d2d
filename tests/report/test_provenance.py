"""The RO-Crate of a built world is valid and matches the files."""

import hashlib
import json
import shutil
from urllib.parse import unquote

import pytest

from pipeline.errors import ArtifactError
from pipeline.report.provenance import flatten, last_commit_date
from tests.crates import cached_context, crate_issues
from tests.project import Project, message_of


@pytest.fixture(scope="module")
def crate(repro, tmp_path_factory):
    """Return the folder of a crate, made by the command from the tiny survey's world."""
    project = repro.copy(tmp_path_factory.mktemp("crate") / "mine")
    project.run("python", "-m", "pipeline", "provenance", check=True)
    return project.folder / "artifacts" / "provenance"


@pytest.fixture(scope="module")
def graph(crate):
    """Return the crate's entities by id."""
    return {entity["@id"]: entity for entity in json.loads((crate / "ro-crate-metadata.json").read_bytes())["@graph"]}


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return cached_context(tmp_path_factory.mktemp("cache"))


def issues_of(folder, cache, severity="REQUIRED"):
    """Return the validator's messages for the profile of process runs and for RO-Crate itself."""
    return crate_issues(folder, cache, "process-run-crate", severity)


@pytest.mark.slow
def test_the_validator_accepts_the_crate(crate, cache):
    assert issues_of(crate, cache) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "message"),
    [("instrument", "instrument"), ("license", "license"), ("sha256", "sha256"), ("file", "stages/survey.py")],
)
def test_the_validator_refuses_a_crate_with_one_fault(crate, cache, tmp_path, fault, message):
    broken = shutil.copytree(crate, tmp_path / "crate")
    metadata = broken / "ro-crate-metadata.json"
    record = json.loads(metadata.read_bytes())
    entities = {entity["@id"]: entity for entity in record["@graph"]}
    match fault:
        case "instrument":
            del entities["#run-survey"]["instrument"]
        case "license":
            del entities["./"]["license"]
        case "sha256":
            record["@context"] = record["@context"][0]
        case "file":
            (broken / "stages/survey.py").unlink()
    metadata.write_text(json.dumps(record))
    issues = issues_of(broken, cache)
    assert issues
    assert all(message in issue for issue in issues)


@pytest.mark.slow
def test_every_file_of_the_crate_has_its_stated_hash_and_size(crate, graph):
    stated = {unquote(name): entity for name, entity in graph.items() if "File" in entity["@type"]}
    found = {p.relative_to(crate).as_posix() for p in crate.rglob("*") if p.is_file()}
    assert found == {*stated, "ro-crate-metadata.json"}
    for name, entity in stated.items():
        data = (crate / name).read_bytes()
        assert (hashlib.sha256(data).hexdigest(), str(len(data))) == (entity["sha256"], entity["contentSize"]), name


@pytest.mark.slow
def test_every_run_names_the_code_parameters_inputs_and_outputs_of_its_manifest(crate, graph):
    runs = [graph[part["@id"]] for part in graph["./"]["mentions"]]
    assert len(runs) == 6
    for run in runs:
        stage = run["@id"].removeprefix("#run-")
        manifest = json.loads((crate / "artifacts" / stage / "manifest.json").read_bytes())
        code = graph[run["instrument"]["@id"]]
        assert (code["name"], code["version"]) == (f"stages/{stage}.py", manifest["code_sha256"])
        assert {unquote(part["@id"]) for part in run["result"]} == set(manifest["outputs"])
        used = [graph[part["@id"]] for part in run["object"]]
        assert {e["name"] for e in used if e["@type"] != "PropertyValue"} == set(manifest["inputs"])
        stated = {e["name"]: e["value"] for e in used if e["@type"] == "PropertyValue"}
        assert stated == dict(flatten(manifest["params"]))


@pytest.mark.slow
def test_the_world_in_the_crate_has_the_worlds_own_hash(crate, graph):
    world = json.loads((crate / "artifacts/realism/world/world.json").read_bytes())
    assert graph["artifacts/realism/world/"]["identifier"] == world["world_sha256"]


@pytest.mark.slow
def test_only_inputs_with_a_stated_licence_are_copied(repro, crate, graph, tmp_path):
    name = "data/chilean_mine/tiny.csv"
    assert graph[f"#{name}"]["sha256"] == hashlib.sha256((repro.folder / name).read_bytes()).hexdigest()
    assert not (crate / name).exists()
    project = repro.copy(tmp_path / "mine")
    registry = project.folder / "data" / "registry.txt"
    lines = [
        line.replace("none stated", "CC-BY-4.0") if "tiny.csv" in line else line
        for line in registry.read_text().splitlines()
    ]
    registry.write_text("\n".join(lines) + "\n")
    project.run("python", "-m", "pipeline", "provenance", check=True)
    licensed = project.folder / "artifacts" / "provenance"
    assert (licensed / name).is_file()
    entities = {e["@id"]: e for e in json.loads((licensed / "ro-crate-metadata.json").read_bytes())["@graph"]}
    assert entities[name]["license"] == {"@id": "https://spdx.org/licenses/CC-BY-4.0"}


@pytest.mark.slow
def test_equal_artifacts_give_equal_bytes(crate):
    metadata = crate / "ro-crate-metadata.json"
    before = metadata.read_bytes()
    Project.at(crate.parents[1]).run("python", "-m", "pipeline", "provenance", check=True)
    assert metadata.read_bytes() == before


@pytest.mark.slow
def test_no_crate_is_written_for_a_world_with_an_edited_file(repro, tmp_path):
    project = repro.copy(tmp_path / "mine")
    plan = project.folder / "artifacts" / "contours" / "free_space.geojson"
    plan.write_bytes(plan.read_bytes() + b" ")
    message = message_of(project.run("python", "-m", "pipeline", "provenance"))
    assert message.startswith("provenance: artifacts/contours/free_space.geojson: sha256")
    assert not (project.folder / "artifacts" / "provenance").exists()


def test_without_git_history_the_error_requests_a_date(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    with pytest.raises(ArtifactError, match="give --date"):
        last_commit_date()


def test_nested_parameters_get_dotted_names_and_lists_stay_whole():
    nested = {"a": {"b": 1, "c": [1, 2]}, "d": None, "e": "text", "f": True}
    assert dict(flatten(nested)) == {"a.b": 1, "a.c": "[1, 2]", "d": "null", "e": "text", "f": True}
