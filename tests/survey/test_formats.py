"""Files of other programs: which program turns them into a format that is read."""

from pathlib import Path

import pytest

from minesurveys.converters import CONVERTED
from minesurveys.formats import FORMATS, kind_of
from pipeline.errors import InputError


@pytest.mark.parametrize(
    ("suffix", "program"),
    [
        (".TOP", "PocketTopo"),
        (".dwg", "dxf"),
        (".e00", "QGIS"),
        (".skp", "SketchUp"),
        (".blend", "Blender"),
        (".00t", "Vulcan"),
        (".rcp", "ReCap"),
        (".fls", "FARO SCENE"),
        (".rvt", "FreeCAD"),
        (".pgm", "yaml"),
        (".webp", "png"),
    ],
)
def test_a_file_that_another_program_converts_is_refused_with_that_program(suffix, program):
    with pytest.raises(InputError, match=rf"cave\{suffix}: \{suffix.lower()} is not read: .*{program}"):
        kind_of(Path(f"cave{suffix}"))


def test_no_format_that_is_read_needs_another_program():
    assert not set(CONVERTED) & set(FORMATS)
