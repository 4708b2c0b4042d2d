"""Walls projects: what Survex gets of them, and their places under a version that solves them."""

import re
import shutil
import subprocess

import numpy as np
import pytest

from benchmarks.fuzzing.surveys import WALLS
from minesurveys.solved_surveys import solve_file, survey_files
from minesurveys.walls.project import copy_of
from minesurveys.walls.sections import _passages
from pipeline.errors import InputError
from tests.solved import position_of, read_passages, write

SHOTS = WALLS["sub/north/main.srv"].decode()
PROJECT = WALLS["mine.wpj"].decode()
FILES = {name: data.decode() for name, data in WALLS.items()}


def version():
    if shutil.which("cavern") is None:
        return ()
    said = subprocess.run(["cavern", "--version"], check=True, capture_output=True, text=True).stdout
    return tuple(int(part) for part in re.search(r"Survex ([\d.]+)", said)[1].split("."))


NO_WALLS = "Survex 1.4.9 or newer is not installed (Debian 13: survex; older systems: survex.com/download.html)"
needs_walls = pytest.mark.skipif(version() < (1, 4, 9), reason=NO_WALLS)


@needs_walls
def test_a_project_is_solved_from_its_files_in_folders_of_any_case(tmp_path):
    at = position_of(solve_file(write(tmp_path, {name: text.replace("\n", "\r\n") for name, text in FILES.items()})))
    last = {name.rpartition(":")[2]: place for name, place in at.items()}
    places = [(100, 200, 30), (110, 200, 30), (110, 200, 35), (110, 207, 35)]
    np.testing.assert_allclose([last[name] for name in "ABCD"], places, atol=0.006)


@needs_walls
def test_one_survey_file_is_solved_and_an_error_names_its_line(tmp_path):
    assert len(solve_file(write(tmp_path, {"a.srv": SHOTS})).legs) == 2
    with pytest.raises(InputError, match=r"a\.srv:5: .* \(Survex\)"):
        solve_file(write(tmp_path, {"a.srv": SHOTS + "C D x y z\n"}))
    with pytest.raises(InputError, match=r"south\.srv:3: .* \(Survex\)"):
        solve_file(write(tmp_path, {**FILES, "south.srv": FILES["south.srv"] + "C D x y z\n"}))


@pytest.mark.skipif(not () < version() < (1, 4, 9), reason="Survex is not installed (Debian: survex), or reads Walls")
def test_an_older_survex_is_named_as_the_reason(tmp_path):
    installed = ".".join(str(part) for part in version())
    with pytest.raises(InputError, match=rf"a Walls survey needs Survex 1\.4\.9 or newer to be solved; {installed} is"):
        solve_file(write(tmp_path, {"a.srv": SHOTS}))


def test_survex_gets_copies_whose_names_lead_to_no_other_file(tmp_path, capsys):
    path = write(tmp_path / "mine", FILES)
    copy = copy_of(path)
    (tmp_path / "made").mkdir()
    main = copy.write(tmp_path / "made")
    made = main.read_text().splitlines()
    assert [line for line in made if line.startswith((".NAME", ".PATH"))] == [
        ".NAME none", ".NAME none", ".NAME file0", ".NAME none", ".NAME none", ".NAME none", ".NAME file1"
    ]  # fmt: skip
    assert len(made) == len(PROJECT.splitlines())
    assert sorted(file.name for file in (tmp_path / "made").iterdir()) == ["file0.srv", "file1.srv", "made.wpj"]
    assert (tmp_path / "made/file0.srv").read_text() == SHOTS
    assert copy.origin(tmp_path / "made/file1.srv", 4) == (tmp_path / "mine/south.srv", 4)
    assert copy.origin(main, 9) == (path, 9)
    assert survey_files(path) == [path, tmp_path / "mine/sub/north/main.srv", tmp_path / "mine/south.srv"]
    assert "1 survey files lie in folders that are not there; they are left out" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("project", "message"),
    [
        (".SURVEY x\n.STATUS 8\n.NAME ../outside\n", r"mine\.wpj:3: '\.\./outside' is outside the survey's folder"),
        (".SURVEY x\n.STATUS 8\n.PATH ..\n.NAME outside\n", r"mine\.wpj:3: '\.\.' is outside the survey's folder"),
        (".SURVEY x\r\n.PATH a\\..\\..\r\n", "is outside the survey's folder"),
        (".SURVEY x\n.STATUS 8\n.NAME /etc/passwd\n", "is outside the survey's folder"),
        (".SURVEY x\n.STATUS 8\n.NAME linked\n", r"'linked\.srv' is outside the survey's folder"),
        (".SURVEY x\n.STATUS 8\n.NAME none\n", r"mine\.wpj:3: \.NAME 'none': no such file"),
        (".SURVEY x\n.STATUS 8\n.NAME mine.wpj\n", r"\.NAME 'mine\.wpj': no such file"),
        (101 * ".BOOK x\n", r"books are nested more than 100 deep \(survex_depth in"),
        (5001 * ".SURVEY x\n.STATUS 8\n.NAME a\n", r"5000 files or more \(survex_files in"),
    ],
)
def test_a_project_that_leads_elsewhere_is_refused(tmp_path, project, message):
    path = write(tmp_path / "mine", {"mine.wpj": project, "a.srv": SHOTS, "a/b.srv": SHOTS, "../outside.srv": SHOTS})
    (tmp_path / "mine/linked.srv").symlink_to(tmp_path / "outside.srv")
    with pytest.raises(InputError, match=message):
        copy_of(path)


SECTIONS = """#units feet order=dav lrud=F:UDLR
#prefix X
A1 A2 100 0 0 <5,6,7,8>  ; a note <9,9,9,9>
A2 A3 100 90 0 *1,2,--,4m*
A3 <3i6 3 2 1>
#[
A3 A4 9 9 9 <1,1,1,1>
#]
#units save meters lrud=T:LRUD
A3 Y:B1 50 0 0 <2,3,4,5>
Y:B1 - 5 0 0 <9,9,9,9>
#units restore
A3 A5 10 0 0 <1,1,1,1>
"""


def test_cross_sections_have_their_units_order_and_station(tmp_path):
    (tmp_path / "a.srv").write_text(SECTIONS)
    first, second = _passages(tmp_path / "a.srv", "")
    foot = 0.3048
    assert [name for name, _ in first] == ["X:A1", "X:A2", "X:A3", "Y:B1"]
    np.testing.assert_allclose(
        [lrud for _, lrud in first],
        [
            (7 * foot, 8 * foot, 5 * foot, 6 * foot),
            (np.nan, 4, 1 * foot, 2 * foot),
            (2 * foot, 1 * foot, 3.5 * foot, 3 * foot),
            (2, 3, 4, 5),
        ],
    )
    assert [name for name, _ in second] == ["X:A3", "X:A5"]


def test_a_distance_that_is_no_number_is_not_measured(tmp_path):
    (tmp_path / "a.srv").write_text("A B 1 0 0 <.,.i.,1.i,.5>\nB C 1 0 0 <i,f,--,2>\n")
    ((_, first), (_, second), _) = _passages(tmp_path / "a.srv", "")[0]
    np.testing.assert_allclose(first, (np.nan, np.nan, 0.3048, 0.5))
    np.testing.assert_allclose(second, (np.nan, np.nan, np.nan, 2))


@needs_walls
def test_walls_sections_are_the_measured_widths_of_the_passages(tmp_path, capsys):
    survey = solve_file(write(tmp_path, {"a.srv": SHOTS}))
    (passage,) = survey.passages
    assert [survey.names[k] for k in passage.stations] == ["A", "B", "C"]
    np.testing.assert_array_equal(passage.lrud_m[0], (1, 2, 3, 4))
    legs, _ = read_passages(tmp_path / "a.srv")
    np.testing.assert_array_equal(legs[0].walls_m[0], (1, 2))
    feet = PROJECT.replace(".NAME\tsouth", ".NAME\tsouth\n.OPTIONS\tfeet")
    files = {**FILES, "mine.wpj": feet, "south.srv": "C D 10 0 0 <10,10,10,0>\n"}
    survey = solve_file(write(tmp_path, files))
    assert max(float(np.nanmax(passage.lrud_m)) for passage in survey.passages) == pytest.approx(4)
    assert "no station" not in capsys.readouterr().err
