"""Facts of others: the scripts of `findings/`, and the programs that tests compare with."""

import os
import re
import subprocess

import pytest

from tests.project import ROOT

SCRIPTS = sorted((ROOT / "findings").glob("*.sh"))
CODE = ("minesurveys", "pipeline", "minexplore", "stages", "baselines", "benchmarks", "docs")


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_finding_is_short_cleans_up_and_does_not_use_our_code(script):
    text = script.read_text()
    assert len(text.splitlines()) <= 60
    assert os.access(script, os.X_OK)
    assert 'work=$(mktemp -d)\ntrap \'rm -rf "$work"\' EXIT\ncd "$work"\n' in text
    assert not re.search(r"import (minexplore|pipeline|stages)|from (minexplore|pipeline|stages)", text)
    text = re.sub(r'"\s*\n\s*"|" \\\n\s*"', "", text)
    for word in ("version:", "behaviour:", "a good guess says", "seen:"):
        assert word in text, word


def test_the_page_lists_every_finding_once():
    listed = re.findall(r"^\| `([a-z0-9-]+\.sh)` \|", (ROOT / "findings" / "README.md").read_text(), flags=re.M)
    assert sorted(listed) == [path.name for path in SCRIPTS]


def test_a_finding_that_the_code_names_exists():
    pages = (path for folder in CODE for kind in ("*.py", "*.md") for path in (ROOT / folder).rglob(kind))
    named = {name for path in pages for name in re.findall(r"findings/([a-z0-9-]+\.sh)", path.read_text())}
    assert len(named) > 10
    assert named <= {path.name for path in SCRIPTS}


def test_make_findings_lists_what_changed_or_was_not_run_and_fails(tmp_path):
    (tmp_path / "findings").mkdir()
    for name, seen, status in (("holds", "seen: 1", 0), ("missing", "no such package", 1), ("other", "seen: 2", 1)):
        script = f"echo 'version: {name} 1'\necho '{seen}'\nexit {status}\n"
        (tmp_path / "findings" / f"{name}.sh").write_text(script)
    recipe = ["make", "--no-print-directory", "-f", ROOT / "Makefile", "findings", "-o", "setup"]
    alone = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    done = subprocess.run(recipe, cwd=tmp_path, env=alone, capture_output=True, text=True)
    assert done.stdout.splitlines() == [
        "holds: holds (holds 1)",
        "missing: NOT RUN (missing 1)",
        "other: CHANGED (other 1)",
    ]
    assert done.returncode != 0


def test_the_tests_that_compare_with_programs_of_others_exist():
    page = (ROOT / "CONTRIBUTING.md").read_text().split("## Programs of others")[1].split("\n## ")[0]
    named = re.findall(r"`((?:tests|benchmarks)/[a-z0-9_/]+\.py)`", page)
    assert len(named) > 15
    assert [name for name in named if not (ROOT / name).is_file()] == []
