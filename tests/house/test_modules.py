"""The size of modules: one idea fits 150 lines, and none has more than 300 but those that say why."""

from tests.project import ROOT

PACKAGES = ("minexplore", "pipeline", "stages", "baselines", "benchmarks", "examples", "packaging")
MOST_LINES = 300
LONGER = {  # and why
    "minexplore/bundle.py": "the contract of a bundle: every name that the pipeline and the environment share",
    "minexplore/schema/model.py": "one table of the elements of mine.xml",
    "pipeline/mjcf/bundle.py": "what world.json states, beside its reading and sealing",
    "pipeline/types.py": "the types that stages hand on",
    "pipeline/proof/texture.py": "the paper's six scores with their two readings, which share their points",
    "pipeline/survey/load.py": "stage 1: one reader a kind of survey",
    "benchmarks/faults/injection.py": "the faults of the mutants, a function each",
    "benchmarks/pictures/draw_sheet.py": "a drawing sheet with all that surrounds workings on paper",
    "pipeline/proof/rebuilt/visible.py": "the visible rock made again, a check a function",
}


def test_no_module_is_over_300_lines_but_the_listed_ones():
    lines = {
        path.relative_to(ROOT).as_posix(): len(path.read_text().splitlines())
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        if "__pycache__" not in path.parts
    }
    assert len(lines) > 500
    assert {path: count for path, count in lines.items() if count > MOST_LINES and path not in LONGER} == {}
    assert LONGER.keys() <= lines.keys()
