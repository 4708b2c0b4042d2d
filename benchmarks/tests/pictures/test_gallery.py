"""The pictures of the gallery stand in the docs."""

import re

import pytest

from benchmarks.__main__ import BENCHMARKS
from benchmarks.pictures.gallery import PICTURES
from tests.project import ROOT

PAGES = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_a_file_that_a_page_shows(name):
    path, _ = PICTURES[name]
    assert (ROOT / path).is_file()
    assert any(path.name in page.read_text() for page in PAGES)


def test_every_picture_has_a_command():
    commands = "\n".join([(ROOT / "Makefile").read_text(), *(b.command for b in BENCHMARKS)])
    assert set(re.findall(r"benchmarks\.pictures\.gallery ([a-z]+)", commands)) == set(PICTURES)
