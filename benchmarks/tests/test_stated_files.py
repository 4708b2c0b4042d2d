"""Files that state something beside their coordinates: the table has the right values beside ours."""

import pytest

from benchmarks.stated_files import CASES, judge
from tests.project import shared_file


@pytest.mark.parametrize(
    ("file", "ours"),
    [
        ("heights-plan.geojson", "394.0 to 400.0 m"),
        ("map-alpha.yaml", "304 m2"),
        ("clipped-int32.las", "refused: clipped-int32.las: 25 % of its Y are 2147483647"),
    ],
)
def test_the_table_has_what_was_read_or_why_not(file, ours):
    folder = shared_file(file).parent
    case = next(case for case in CASES if case.file == file)
    _, _, found, _ = judge(case, folder)
    assert found.startswith(ours)
