"""The documentation as a whole: few pages, short lines, links that hold, and tables that are those of the code."""

import re
from pathlib import Path

import pytest
import yaml

from baselines.base.errors import BaselineError
from baselines.base.markdown import BEGIN, END, with_table, write_table
from benchmarks.tables.include_parts import on_page_markdown
from benchmarks.tables.reference import TABLES, options_table
from pipeline.params.config import Config
from tests.project import ROOT, modules_below

DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
PARTS = sorted((DOCS / "evidence/parts").glob("*.md"))
MOST_ENTRIES, MOST_HOW_TO, MOST_LINES, MOST_EVIDENCE, WIDEST = 30, 12, 80, 10, 160


def entries(nav):
    """Yield the pages of the index of the site."""
    for entry in nav:
        for target in entry.values():
            if isinstance(target, str):
                yield target
            else:
                yield from entries(target)


def index_of_the_site():
    """Return the pages that the site's index lists."""
    text = re.sub(r"^theme:.*?^plugins:", "plugins:", (ROOT / "mkdocs.yml").read_text(), flags=re.M | re.S)
    return list(entries(yaml.safe_load(text)["nav"]))


def links_of(page):
    """Return the files that a page links to."""
    found = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text())
    return [page.parent / link for link in found if not link.startswith(("http:", "https:"))]


def test_the_index_lists_every_page_but_decisions_and_parts_in_at_most_thirty_entries():
    listed = index_of_the_site()
    pages = {page.relative_to(DOCS).as_posix() for page in PAGES if page not in PARTS}
    decisions = {name for name in pages if re.match(r"adr/\d", name)}
    assert sorted(listed) == sorted(pages - decisions)
    assert len(listed) <= MOST_ENTRIES


def test_the_index_of_decisions_lists_all():
    decisions = sorted((DOCS / "adr").glob("0*.md"))
    assert sorted(map(Path.resolve, links_of(DOCS / "adr/index.md"))) == decisions


def test_how_to_pages_are_few_and_short():
    pages = sorted((DOCS / "how-to").glob("*.md"))
    assert 0 < len(pages) <= MOST_HOW_TO
    assert [page.name for page in pages if len(page.read_text().splitlines()) > MOST_LINES] == []


def test_evidence_has_one_page_a_subject_and_each_part_is_on_one_of_them():
    pages = sorted((DOCS / "evidence").glob("*.md"))
    assert 0 < len(pages) <= MOST_EVIDENCE
    shown = [link.resolve() for page in pages for link in links_of(page) if link.parent.name == "parts"]
    assert sorted(shown) == PARTS


@pytest.mark.parametrize("page", [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"], ids=lambda page: page.name)
def test_no_line_of_a_page_is_too_long(page):
    lines = page.read_text().splitlines()
    if page in PARTS or page.name == "results.md":  # the measured tables that commands write
        lines = [line for line in lines if not line.startswith("|")]
    assert [line for line in lines if len(line) > WIDEST] == []


@pytest.mark.parametrize(
    "page", [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "LEADERBOARD.md"], ids=lambda page: page.name
)
def test_every_link_leads_to_a_file(page):
    assert [link for link in links_of(page) if not link.exists()] == []


def test_code_and_configuration_name_only_pages_that_exist():
    files = [file for folder in ("pipeline", "minexplore", "baselines", "benchmarks") for file in modules_below(folder)]
    named = {
        (file.relative_to(ROOT).as_posix(), name)
        for file in [*files, *ROOT.glob("conf/**/*.yaml")]
        for name in re.findall(r"docs/[\w./-]+\.md", file.read_text())
    }
    assert named
    assert [(file, name) for file, name in sorted(named) if not (ROOT / name).is_file()] == []


@pytest.mark.parametrize("name", TABLES)
def test_a_table_of_the_reference_is_that_of_the_code(name):
    page = (DOCS / name).read_text()
    assert page == with_table(page, TABLES[name]()), "run `python -m benchmarks.tables.reference`"


@pytest.mark.parametrize(
    "name", ["how-to/drawings.md", "how-to/heights.md", "reference/formats.md", "reference/heights.md"]
)
def test_every_option_that_a_page_on_surveys_names_is_one_of_new(name):
    named = set(re.findall(r"`(--[a-z-]+)", (DOCS / name).read_text()))
    assert named
    assert sorted(named - set(re.findall(r"--[a-z-]+", options_table()))) == []


@pytest.mark.parametrize(
    "page", [*sorted(DOCS.glob("evidence/parts/*.md")), ROOT / "LEADERBOARD.md"], ids=lambda p: p.stem
)
def test_every_page_that_a_measurement_writes_has_one_place_for_its_tables(page):
    text = page.read_text()
    assert (text.count(BEGIN), text.count(END)) == (1, 1)
    table = text.partition(BEGIN)[2].partition(END)[0]
    assert with_table(text, table) == text
    assert re.search(r"\n\| ?---", table)


def test_every_key_of_the_configuration_has_a_description():
    schemas = Config.model_json_schema()["$defs"]
    keys = {
        f"{schema}.{key}": leaf for schema, node in schemas.items() for key, leaf in node.get("properties", {}).items()
    }
    assert len(keys) > 100
    assert sorted(key for key, leaf in keys.items() if not leaf.get("description")) == []


def test_a_table_is_written_between_the_marks_or_into_a_new_page(tmp_path):
    page = tmp_path / "new" / "page.md"
    write_table(page, "| a |\n")
    assert page.read_text() == f"{BEGIN}\n\n| a |\n\n{END}\n"
    page.write_text(f"# Title\n\n{BEGIN}\n| a |\n{END}\n\nProse.\n")
    write_table(page, "| b |\n")
    assert page.read_text() == f"# Title\n\n{BEGIN}\n\n| b |\n\n{END}\n\nProse.\n"


def test_a_page_without_marks_has_no_place_for_a_table():
    with pytest.raises(BaselineError, match="needs the marks"):
        with_table(f"{END}\n{BEGIN}\n", "| a |")


def test_the_site_shows_a_part_in_place_of_the_link_with_its_links_from_there(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/fuzz.md").write_text("# Fuzzing\n\n## Readers\n\n![A](../../a.jpg) [B](../b.md)\n")

    class File:
        abs_src_path = str(tmp_path / "page.md")

    class Page:
        file = File

    shown = on_page_markdown("Before\n\n[The table](parts/fuzz.md)\n\n[In](parts/fuzz.md) a sentence\n", page=Page)
    assert shown == "Before\n\n### Readers\n\n![A](../a.jpg) [B](b.md)\n\n[In](parts/fuzz.md) a sentence\n"
