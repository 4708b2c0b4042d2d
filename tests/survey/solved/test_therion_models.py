"""Therion's binary models and project files; Therion 6.1.6 wrote `therion/cave.lox` from the files beside it."""

import shutil
import struct
from pathlib import Path

import numpy as np
import pytest

from benchmarks.fuzzing.surveys import ring_lox
from minesurveys.remarks import collect_remarks
from minesurveys.solved.model import LegFlag, StationFlag
from minesurveys.solved_surveys import solve_file, survey_files
from pipeline.errors import InputError
from pipeline.params.stated import StatedOptions
from pipeline.survey.detect import detect_survey

needs_cavern = pytest.mark.skipif(shutil.which("cavern") is None, reason="Survex is not installed (Debian: survex)")
FOLDER = Path(__file__).parent / "therion"


def placed(survey):
    return {name: tuple(place) for name, place in zip(survey.names, survey.positions_m.round(2).tolist(), strict=True)}


def flagged(survey):
    places = [tuple(place) for place in survey.positions_m.round(2).tolist()]
    legs = zip(survey.legs.tolist(), survey.leg_flags.tolist(), strict=True)
    return {(frozenset((places[a], places[b])), flag) for (a, b), flag in legs}


def walls(survey):
    return {
        (survey.names[station], *lrud)
        for passage in survey.passages
        for station, lrud in zip(passage.stations.tolist(), passage.lrud_m.tolist(), strict=True)
    }


@needs_cavern
def test_a_model_of_therion_has_the_stations_legs_and_flags_of_its_source():
    model, source = solve_file(FOLDER / "cave.lox"), solve_file(FOLDER / "cave.th")
    assert placed(model) == placed(source)
    assert flagged(model) == flagged(source)
    assert sorted(model.leg_flags.tolist()) == [0, 0, 0, LegFlag.SURFACE, LegFlag.DUPLICATE, LegFlag.SPLAY]
    entrance = model.station_flags[model.names.index("cave.upper.0")]
    assert entrance & StationFlag.ENTRANCE
    assert entrance & StationFlag.FIXED
    assert model.station_flags[model.names.index("")] & StationFlag.ANONYMOUS


@needs_cavern
def test_a_model_of_therion_has_the_measured_distances_to_walls():
    found, expected = walls(solve_file(FOLDER / "cave.lox")), walls(solve_file(FOLDER / "cave.th"))
    assert [len(passage.stations) for passage in solve_file(FOLDER / "cave.lox").passages] == [5]
    # A leg has its own at both ends: so the first end of the last leg has those of the leg before.
    assert found ^ expected == {("cave.upper.3", 1.0, 1.0, 1.0, 1.0)}


def test_a_model_of_therion_says_what_of_it_is_not_read():
    with collect_remarks() as remarks:
        solve_file(FOLDER / "cave.lox")
    assert [remark.line() for remark in remarks] == ["cave.lox: not read: 2 wall surfaces of scraps"]


def test_a_model_of_therion_is_detected_as_a_survey(tmp_path):
    shutil.copy(FOLDER / "cave.lox", tmp_path)
    assert detect_survey(tmp_path / "cave.lox", StatedOptions()).values["kind"] == "passages"


@pytest.mark.parametrize("size", [8, 300, 1000])
def test_a_model_of_therion_that_is_cut_off_is_refused_with_the_byte(tmp_path, size):
    (tmp_path / "a.lox").write_bytes((FOLDER / "cave.lox").read_bytes()[:size])
    with pytest.raises(InputError, match=r"a\.lox: byte \d+: .*cut off"):
        solve_file(tmp_path / "a.lox")


def test_a_leg_of_a_station_that_the_model_lacks_is_refused(tmp_path):
    data = bytearray((FOLDER / "cave.lox").read_bytes())
    at = data.index(np.array([3, 552, 6, 0], "<u4").tobytes()) + 16  # the block of legs
    data[at : at + 4] = (77).to_bytes(4, "little")
    (tmp_path / "a.lox").write_bytes(data)
    with pytest.raises(InputError, match=r"a\.lox: a leg of station number 77"):
        solve_file(tmp_path / "a.lox")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (struct.pack("<6I", 0, 0, 5, 0, 0, 0), struct.pack("<6I", 0, 2**32 - 9, 5, 0, 0, 0), "a name that lies behind"),
        (struct.pack("<3I", 0, 2, 2), struct.pack("<3I", 0, 2, 2**32 - 1), "a name that lies behind the texts"),
        (struct.pack("<d", 2.5), struct.pack("<d", np.inf), r"a wall inf m beside its station, at most 300"),
        (struct.pack("<d", 2.5), struct.pack("<d", 1e9), r"a wall 1e\+09 m beside its station, at most 300"),
        (struct.pack("<4I", 3, 0, 6, 2), struct.pack("<4I", 2, 0, 6, 2), "two stations have one number"),
        (struct.pack("<4I", 2, 208, 4, 8), struct.pack("<4I", 2, 0, 2**32 - 1, 0), "no block of a .lox file"),
    ],
)
def test_a_model_of_therion_that_would_lose_a_name_or_a_wall_is_refused(tmp_path, old, new, message):
    data = ring_lox()
    assert old in data
    (tmp_path / "a.lox").write_bytes(data)
    assert solve_file(tmp_path / "a.lox").names == ("mine.0", "mine.1", "mine.2", "mine.3")
    (tmp_path / "a.lox").write_bytes(data.replace(old, new))
    with pytest.raises(InputError, match=message):
        solve_file(tmp_path / "a.lox")


@needs_cavern
@pytest.mark.parametrize("name", ["thconfig", "thconfig.plan", "cave.thconfig"])
def test_the_file_of_a_therion_project_is_read_by_its_sources(tmp_path, name):
    shutil.copy(FOLDER / "cave.th", tmp_path)
    shutil.copy(FOLDER / "thconfig", tmp_path / name)
    with collect_remarks() as remarks:
        assert placed(solve_file(tmp_path / name)) == placed(solve_file(FOLDER / "cave.th"))
    assert [remark.line() for remark in remarks] == [f"{name}: `select cave` is not applied; all sources are read"]
    assert survey_files(tmp_path / name) == [tmp_path / name, tmp_path / "cave.th"]
    assert detect_survey(tmp_path / name, StatedOptions()).values["file"] == name


@needs_cavern
def test_lines_of_a_survey_may_stand_in_the_file_of_the_project(tmp_path):
    text = (FOLDER / "cave.th").read_text().replace("encoding utf-8\n", "")
    (tmp_path / "thconfig").write_text(f"cs UTM33\nsource\n{text}endsource\nexport map -o a.pdf\n")
    assert placed(solve_file(tmp_path / "thconfig")) == placed(solve_file(FOLDER / "cave.th"))
