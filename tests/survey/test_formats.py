"""Files of other programs: which program turns them into a format that is read."""

from pathlib import Path

import pytest

from pipeline.errors import InputError
from pipeline.survey.formats import _CONVERTED, FORMATS, kind_of


@pytest.mark.parametrize(
    ("suffix", "program"),
    [
        (".lox", "Therion"),
        (".TOP", "PocketTopo"),
        (".bt", "gdal_translate"),
        (".bt", "octree of OctoMap"),
        (".dwg", "dxf"),
        (".kml", "QGIS"),
        (".pgm", "yaml"),
        (".webp", "png"),
    ],
)
def test_a_file_that_another_program_converts_is_refused_with_that_program(suffix, program):
    with pytest.raises(InputError, match=rf"cave\{suffix}: \{suffix.lower()} is not read: .*{program}"):
        kind_of(Path(f"cave{suffix}"))


def test_no_format_that_is_read_needs_another_program():
    assert not set(_CONVERTED) & set(FORMATS)
