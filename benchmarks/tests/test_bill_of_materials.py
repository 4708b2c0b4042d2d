"""The list of packages of a release."""

import json
import sys
from importlib.metadata import distributions

import pytest

import minexplore


@pytest.mark.slow  # it reads the metadata of all packages
def test_the_list_names_the_project_with_its_version_and_all_packages_and_nothing_that_changes(project):
    project.run(sys.executable, "-m", "benchmarks.bill_of_materials", check=True)
    bill = json.loads((project.folder / "artifacts/sbom.json").read_bytes())
    root = bill["metadata"]["component"]
    assert (root["name"], root["version"]) == ("minexplore-pipeline", minexplore.__version__)
    assert bill["bomFormat"] == "CycloneDX"
    assert "serialNumber" not in bill
    assert "timestamp" not in bill["metadata"]
    assert str(project.folder) not in json.dumps(bill)
    found = {(part["name"], part["version"]) for part in bill["components"]}
    assert found == {(part.name, part.version) for part in distributions()}
