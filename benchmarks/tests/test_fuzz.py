"""A few of the broken files of `python -m benchmarks fuzz`, and its hostile files."""

import json
import shutil
import time
from pathlib import Path

import numpy as np
import pytest

from benchmarks.fuzz import TimeLimits, fuzz_reader, mutate, try_case
from benchmarks.fuzzing.hostile import HOSTILE
from benchmarks.fuzzing.library_words import library_words
from benchmarks.fuzzing.readers import READERS, registry_beside
from benchmarks.fuzzing.samples import SAMPLES
from minesurveys import limits as reader_limits
from minesurveys.errors import UnexpectedError
from minesurveys.formats import FORMATS, suffix_of
from minesurveys.guard import reading_process as child
from pipeline.errors import InputError, MineError

SOLVED_BY_SURVEX = ("survex project", "therion", "compass data")
# Instructive hostile files that a reader refuses at once: the limit that each must name.
FAST = [
    ("png", "header of 10^10 px", "100000 x 100000 px, the limit is 16384 px a side"),
    (
        "png",
        "bomb of 16 bits and alpha",
        "1,568,000,000 bytes when decoded, the limit is 800,000,000 (decoded_bytes in",
    ),
    ("tiff", "sixty thousand channels", "it is none of PNG, JPEG, TIFF, BMP, PNM and GIF"),
    ("tiff", "BigTIFF of 2^60 tags", "header is broken"),
    ("pdf", "page of 10^9 points", "the limits are 16384 px a side"),
    ("map.yaml", "aliases", "aliases and tags are not allowed"),
    ("map.yaml", "deep within the size", "nested more than 32 deep (nesting in"),
    ("world file", "digits without end", "expected six finite numbers"),
    ("dxf", "blocks that hold each other", "contains itself"),
    ("dxf", "empty blocks, ten to the tenth", "entities with blocks resolved, the limit is 100000 (dxf_entities in"),
    ("geojson", "collections 500 deep", "collections are nested more than 32 deep, the limit (nesting in"),
    ("geojson", "star of 20,000 rays", "its lines cross more than 50000 times, the limit (crossings in"),
    ("geopackage", "view without end", "shapes or more, the limit is 100000 (shapes in"),
    ("solved .3d", "label of 4 GB", "a name of more than 1000 bytes (survex_name_bytes in"),
    ("survex project", "file above, after blanks that Survex knows", "is outside the survey's folder"),
    ("survex project", "begin a hundred thousand deep", "nested more than 100 deep (survex_depth in"),
    ("survex project", "file above, after a control character that ends a line", "a control character, 0x1a"),
    ("survex project", "file above, after a mark of UTF-8", "is outside the survey's folder"),
    ("survex project", "file above, in a file of another format", "only .svx files are included"),
    ("ply", "more points than stated", "500 rows, its header states 3"),
    ("compass data", "file above, its name over two lines", "is outside the survey's folder"),
    ("compass data", "file above, in what looks like a comment", "is outside the survey's folder"),
    ("therion", "last line continued", "ends within a continued line"),
    ("therion", "imported file above", "is outside the survey's folder"),
    ("compass data", "two files in a line, the second outside", "is outside the survey's folder"),
    ("compass data", "hundred thousand files", "5000 files or more (survex_files in"),
    ("survey section", "deep", "nested more than 32 deep"),
]


def test_broken_copies_differ_between_seeds_and_repeat_for_the_same_seed():
    data = b"leg,station\nA,a 1 2 3\n" * 20
    copies = [mutate(data, np.random.default_rng(seed)) for seed in range(50)]
    assert len(set(copies)) > 45
    assert copies[7] == mutate(data, np.random.default_rng(7))


@pytest.mark.parametrize(("reader", "name", "message"), FAST, ids=[f"{reader}-{name}" for reader, name, _ in FAST])
def test_a_hostile_file_is_refused_with_the_limit_that_it_exceeds(tmp_path, reader, name, message):
    if reader in SOLVED_BY_SURVEX and shutil.which("cavern") is None:
        pytest.skip("Survex is not installed (Debian: survex)")
    folder = tmp_path / "data"
    folder.mkdir()
    registry_beside(folder)
    files = {**SAMPLES[reader](), **HOSTILE[reader][name]()}
    for file, data in files.items():
        (folder / file).parent.mkdir(exist_ok=True)
        (folder / file).write_bytes(data)
    with pytest.raises(MineError) as caught:
        READERS[reader](folder / next(iter(files)))
    assert message in str(caught.value)
    assert next(iter(files)).split(".")[0] in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not isinstance(caught.value, UnexpectedError)
    assert library_words(str(caught.value)) == []


@pytest.mark.parametrize(
    ("message", "verdict"),
    [
        ("a.dxf: cannot be read (ValueError: attempt to get argmax of an empty sequence)", "ValueError, argmax"),
        ("a.pdf: cannot be read as PDF (Failed to load document (PDFium: Data format error).)", "PDFium"),
        ("a.json: 'NoneType' object has no attribute 'get'", "NoneType, has no attribute"),
        ("a.png: not an image that OpenCV can read (9 bytes)", "OpenCV"),
        ("a.csv:3: easting_m = 'x' is not a number", "refused"),
    ],
)
def test_a_message_with_the_words_of_a_library_is_a_finding_of_the_fuzzer(tmp_path, message, verdict):
    def refuse(path):
        raise InputError(message)

    assert verdict in try_case(refuse, {"a": b"x"}, tmp_path, TimeLimits(10.0, 10.0)).verdict


def test_a_case_that_computes_too_long_or_sleeps_without_end_is_a_finding_of_the_fuzzer(tmp_path):
    def compute(path):
        end = time.process_time() + 0.4
        while time.process_time() < end:
            pass

    assert "of the processors" in try_case(compute, {"a": b"x"}, tmp_path, TimeLimits(0.2, 30.0)).verdict
    assert try_case(lambda path: time.sleep(9), {"a": b"x"}, tmp_path, TimeLimits(30.0, 0.3)).verdict == "hang"


def test_work_without_end_is_ended_by_the_limit_on_time(tmp_path, monkeypatch):
    short = reader_limits.reader_limits().model_copy(update={"time_s": 1.0})
    monkeypatch.setattr(child, "reader_limits", lambda: short)
    monkeypatch.setattr(child, "_CLOCK", 100.0)  # or a machine with five times as much to do ends it by the clock
    (tmp_path / "data").mkdir()
    path = tmp_path / "data" / "mine.gpkg"
    path.write_bytes(HOSTILE["geopackage"]["view that counts without end"]()["mine.gpkg"])
    with pytest.raises(MineError, match=r"mine\.gpkg: not read within 1 s of processor time, the limit \(time_s in"):
        READERS["geopackage"](path)
    assert [p.name for p in path.parent.iterdir()] == ["mine.gpkg"]


def test_every_reader_has_a_sample_and_hostile_files_are_of_readers():
    assert set(READERS) == set(SAMPLES)
    assert set(HOSTILE) <= set(SAMPLES)


def test_every_format_of_a_survey_has_a_sample():
    sampled = [FORMATS.get(suffix_of(Path(next(iter(make()))))) for make in SAMPLES.values()]
    assert [suffix for suffix, form in FORMATS.items() if form not in sampled] == []


@pytest.mark.slow
@pytest.mark.parametrize("reader", list(SAMPLES))
def test_a_reader_survives_broken_and_hostile_files(reader):
    result = fuzz_reader(reader, len(HOSTILE.get(reader, {})) + 12)
    assert json.dumps(result["failed"]) == "{}"
    assert result["refused"] > 0
