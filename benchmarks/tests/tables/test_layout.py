"""The table of the layout, on a project of five modules."""

from benchmarks.tables.layout import ProjectFiles, Way, layout_table
from stages.__main__ import STAGES

TEXTS = {
    "pipeline/a/__init__.py": '"""A."""\n',
    "pipeline/a/read.py": "LIMITS = {'a': 1, 'b': 2}\nFORMATS = {}\nplan = 1\n",
    "pipeline/b/cut.py": "class Cut:\n    def solid(self, plan): ...\n",
    "minexplore/world.py": "class World:\n    pass\n",
    "tests/test_a.py": "plan = 2\n",
    "pipeline/tests/test_b.py": "plan = 3\n\n",
}


def test_constants_that_are_numbers_and_modules_that_one_other_imports_are_counted():
    files = ProjectFiles(
        {
            **TEXTS,
            "pipeline/a/read.py": "A, B = 1, -2.5\nC: int = 1 << 20\nD = E = 3\nF = 'text'\nG = (1, 2)\nH = True\n",
            "pipeline/b/cut.py": "def cut():\n    from pipeline.a import read\n",
        }
    )
    assert files.number_constants() == 4
    assert files.with_one_importer() == 2  # pipeline.a and pipeline.a.read


def test_a_stage_that_enters_a_folder_again_returns_to_it():
    def importing(*modules):
        texts = {f"stages/{stage}.py": f"from {name} import x\n" for stage, name in zip(STAGES, modules, strict=True)}
        return ProjectFiles({**TEXTS, **texts})

    read, cut = "pipeline.a.read", "pipeline.b.cut"
    assert importing(read, cut, cut, read, read, read).way("plan") == Way(modules=2, folders=2, returns=1)
    assert importing(read, cut, cut, cut, cut, cut).way("plan").returns == 0


def test_a_folder_of_sixteen_modules_is_counted():
    few = TEXTS | {f"stages/{stage}.py": "" for stage in STAGES}
    many = few | {f"pipeline/b/m{number}.py": "" for number in range(15)}
    assert ProjectFiles(many).crowded() == 1
    assert "| folders of more than 15 modules | 0 | 1 |" in layout_table(ProjectFiles(few), ProjectFiles(many))
