"""The figures of the layout, on a project of four modules."""

from benchmarks.tables.layout import figures_of


def test_lines_classes_constants_and_the_fullest_folder_are_counted():
    found = figures_of(
        {
            "pipeline/a/__init__.py": '"""A."""\n',
            "pipeline/a/read.py": "A, B = 1, -2.5\nC: int = 1 << 20\nD = E = 3\nF = 'text'\nG = (1, 2)\nH = True\n",
            "minexplore/world.py": "class World:\n    class Part: ...\n",
            "baselines/tests/test_a.py": "plan = 2\n\n",
        }
    )
    assert (found["lines of `pipeline/`"], found["lines of `tests/`"], found["lines of all but `tests/`"]) == (7, 2, 9)
    assert (found["classes"], found["module constants that are numbers"]) == (2, 4)
    assert found["most modules in a folder"] == 1
