"""Which model a mine is built in is asked in one place, of its survey; of a bundle alone where there is no survey."""

import re
from collections import Counter
from pathlib import Path

from tests.house.test_modules import PACKAGES, modules_of
from tests.project import ROOT

QUESTION = re.compile(
    r"\bMineModel\.(?:LEVEL|VOLUME)\b|\bis_volume\(|\bVOLUME\)\.is_file\(|\bVOLUME_FORMAT ?==|== VOLUME_FORMAT\b"
    r"|\bNO_(?:LEGS|SOLID|FLOORS|PICTURE)\b|none\.txt|\blen\((?:network|level_legs|floors)\)"
)
OF_A_SURVEY = {"pipeline/stage.py": 1, "pipeline/store/mine_survey.py": 1}  # the table, and what it is asked of
OF_A_BUNDLE = {  # that anybody may bring, without its survey
    "minexplore/__main__.py": 1,
    "minexplore/bundle.py": 2,
    "minexplore/sealed/record.py": 1,
    "minexplore/sealed/world.py": 1,
    "pipeline/commands/proofs.py": 1,
    "pipeline/mjcf/bundle.py": 1,
    "pipeline/proof/groups.py": 3,
    "benchmarks/faults/judge.py": 1,
}


def questions_in(text: str) -> int:
    """Return how many lines ask whether something is level or one volume."""
    return sum(bool(QUESTION.search(line)) for line in text.splitlines())


def test_the_question_stands_in_the_listed_places_alone():
    files: list[Path] = modules_of(PACKAGES)
    found = Counter({file.as_posix(): questions_in((ROOT / file).read_text()) for file in files})
    assert {file: count for file, count in found.items() if count} == OF_A_SURVEY | OF_A_BUNDLE


def test_a_stage_that_asks_for_itself_is_found():
    assert questions_in("if mine.model is MineModel.LEVEL:\n    pass\n") == 1
    assert questions_in("if len(floors) or len(network) or len(solid):\n") == 1
    assert questions_in("if (volume / VOLUME).is_file():\n") == 1
