"""Networks of many loops are solved as `cavern` solves them, in seconds."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from minesurveys.remarks import collect_remarks
from minesurveys.solved.model import SolvedSurvey
from minesurveys.solved.survex_3d import read_3d
from minesurveys.solved_surveys import solve_file
from minesurveys.survex import large_network
from minesurveys.survex.network_text import read_network
from pipeline.errors import InputError

pytestmark = pytest.mark.skipif(shutil.which("cavern") is None, reason="Survex is not installed (Debian: survex)")


class Grid:
    """Readings of a level of rooms and pillars, with errors."""

    def __init__(self, side: int, deviation_m: float, seed: int = 1) -> None:
        self.side, self.deviation_m, self.rng = side, deviation_m, np.random.default_rng(seed)
        even = 15.0 * np.stack(np.meshgrid(range(side), range(side), [0], indexing="ij"), -1)[:, :, 0]
        self.places = even + self.rng.normal(0.0, 1.5, even.shape)

    def vector(self, a: tuple[int, int], b: tuple[int, int]) -> np.ndarray:
        return self.places[b] - self.places[a] + self.rng.normal(0.0, self.deviation_m, 3)

    def shot(self, a: tuple[int, int], b: tuple[int, int], tape: float = 1.0, circle: float = 360.0) -> str:
        vector = self.vector(a, b)
        length, turn = np.linalg.norm(vector), np.arctan2(vector[0], vector[1]) / (2.0 * np.pi) % 1.0
        return f"{length * tape:.2f} {turn * circle:.2f} {np.degrees(np.arcsin(vector[2] / length)):.2f}"

    def legs(self) -> list[tuple[tuple[int, int], tuple[int, int]]]:
        every = [(i, j) for i in range(self.side) for j in range(self.side)]
        near = [((i, j), other) for i, j in every for other in ((i + 1, j), (i, j + 1))]
        return [(a, b) for a, b in near if max(b) < self.side]


def grid(side: int, deviation_m: float) -> list[str]:
    """Return the lines of a grid in one file and one survey."""
    made = Grid(side, deviation_m)
    shots = [f"s{a[0]}_{a[1]} s{b[0]}_{b[1]} {made.shot(a, b)}" for a, b in made.legs()]
    return ["*begin grid", "*fix s0_0 1000.123 2000.456 50.001", *shots, "*end grid"]


def in_surveys(folder: Path, system: bool) -> Path:
    """Write a grid whose rows are files, with what moves stations and weighs legs; return the main file."""
    made, side = Grid(20, 0.08), 20
    lines = ["*cs EPSG:4326", "*cs out EPSG:32632"] if system else []
    lines += ["*begin Mine"]
    declination = "*declination auto 9.0 46 500" if system else "*calibrate declination -3"
    for i in range(side):
        lines.append(f"*include row{i}")
        names = " ".join(f"p{j}" for j in range(side))
        row = [f"*begin S{i}", f"*export {names}", "*units tape feet", "*units compass grads", "*date 2020.05.01"]
        row += [declination, "*sd tape 0.4 feet" if i % 3 == 0 else "*calibrate tape 0.5"]
        row += ["*sd compass 3 degrees"] if i % 4 == 0 else []
        for j in range(side - 1):
            shot = made.shot((i, j), (i, j + 1), 1.0 / 0.3048, 400.0)
            row += [f"p{j} P{j + 1} {shot}", "p0 . 5 100 0 ; a splay"]
            row += [f"p{j} P{j + 1} {shot}"] if j % 5 == 0 else []  # a second reading
            row += ["*flags duplicate"] if j == 4 else ["*flags not duplicate"] if j == 5 else []
        row += ["*data passage station left right up down", *(f"p{j} 1 1 1 1" for j in range(side)), f"*end S{i}"]
        (folder / f"row{i}.svx").write_text("\n".join(row) + "\n")
    lines += ["*date 2019.05.01", declination]
    for i in range(side - 1):
        lines += [f"*begin x{i}", "*export " + " ".join(f"a{j} b{j}" for j in range(side))]
        cartesian = i == 9
        lines += ["*data cartesian from to dx dy dz" if cartesian else "*data normal to from clino compass tape"]
        for j in range(side):
            ends = (i, j), (i + 1, j)
            east, north, up = made.vector(*ends)
            readings = [f"{east:.2f} {north:.2f} {up:.2f}"] if cartesian else made.shot(*ends).split()[::-1]
            lines.append(" ".join([f"a{j} b{j}" if cartesian else f"b{j} a{j}", *readings]))
        lines.append(f"*end x{i}")
        lines += [
            line for j in range(side) for line in (f"*equate x{i}.a{j} s{i}.p{j}", f"*equate x{i}.b{j} s{i + 1}.P{j}")
        ]
    first, last = ("9.001 46.0012 500", "9.00452 46.00423 500") if system else ("500.123 100.004 3", "785 385.555 2")
    lines += [f"*fix s0.p0 {first}", f"*fix s19.p19 {last}", "*entrance s0.p3", "*end Mine"]
    (folder / "mine.svx").write_text("\n".join(lines) + "\n")
    return folder / "mine.svx"


def require_same(ours: SolvedSurvey, theirs: SolvedSurvey) -> None:
    """Require the same stations within the rounding of both, the same flags of legs and as many passages."""
    place = dict(zip(theirs.names, theirs.positions_m, strict=True))
    named = [k for k, name in enumerate(ours.names) if name]
    assert {ours.names[k] for k in named} == set(theirs.names) - {""}
    off = ours.positions_m[named] - [place[ours.names[k]] for k in named]
    assert np.abs(off).max() < 0.0101  # both are whole centimetres
    assert np.abs(off.mean(axis=0)).max() < 0.002
    assert sorted(ours.leg_flags) == sorted(theirs.leg_flags)
    assert len(ours.passages) == len(theirs.passages)


def compare(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Compare stations and legs with those of `cavern` alone; the survey must be solved as a large one."""
    result = path.with_suffix(".3d")
    subprocess.run(["cavern", "-q", "-o", result, path], check=True, stdout=subprocess.DEVNULL)
    theirs = read_3d(result)
    monkeypatch.setattr(large_network, "_LEAST_LOOPS", 100)
    with collect_remarks() as remarks:
        ours = solve_file(path)
    assert any("loops are closed by sparse least squares" in remark.line() for remark in remarks)
    require_same(ours, theirs)


@pytest.mark.parametrize("side", [20, 30])
def test_a_grid_is_where_cavern_has_it(tmp_path, monkeypatch, side):
    (tmp_path / "grid.svx").write_text("\n".join(grid(side, 0.05)) + "\n")
    compare(tmp_path / "grid.svx", monkeypatch)


@pytest.mark.parametrize("system", [False, True])
def test_a_grid_of_many_surveys_is_where_cavern_has_it(tmp_path, monkeypatch, system):
    compare(in_surveys(tmp_path, system), monkeypatch)


def test_a_grid_of_therion_is_where_cavern_has_it(tmp_path, monkeypatch):
    made = Grid(14, 0.05)
    shots = [f"{a[0]}'{a[1]} {b[0]}'{b[1]} {made.shot(a, b)}" for a, b in made.legs()]
    head = ["survey mine", "centreline", "cs UTM33", "fix 0'0 400000 5000000 300", "date 2015.6.1"]
    head += ["data normal from to length compass clino"]
    (tmp_path / "mine.th").write_text("\n".join([*head, *shots, "endcentreline", "endsurvey"]) + "\n")
    alone = solve_file(tmp_path / "mine.th")
    monkeypatch.setattr(large_network, "_LEAST_LOOPS", 100)
    with collect_remarks() as remarks:
        together = solve_file(tmp_path / "mine.th")
    assert any("169 loops are closed by sparse least squares" in remark.line() for remark in remarks)
    require_same(together, alone)


def test_a_grid_that_is_refused_with_its_junctions_fixed_is_solved_as_it_is(tmp_path, monkeypatch):
    lines = ["*begin", *grid(14, 0.05)]  # without its end
    (tmp_path / "grid.svx").write_text("\n".join(lines) + "\n")
    monkeypatch.setattr(large_network, "_LEAST_LOOPS", 100)
    with pytest.raises(InputError, match=r"grid\.svx:\d+: .*BEGIN.*\(Survex\)"):
        solve_file(tmp_path / "grid.svx")


def test_a_grid_without_a_fixed_station_is_where_cavern_has_it(tmp_path, monkeypatch):
    lines = [line for line in grid(20, 0.05) if not line.startswith("*fix")]
    (tmp_path / "grid.svx").write_text("\n".join(lines) + "\n")
    compare(tmp_path / "grid.svx", monkeypatch)


def test_a_large_mine_of_rooms_and_pillars_is_solved_in_seconds(tmp_path):
    (tmp_path / "grid.svx").write_text("\n".join(grid(60, 0.0)) + "\n")
    survey = solve_file(tmp_path / "grid.svx")  # `cavern` alone takes 20 minutes
    place = dict(zip(survey.names, survey.positions_m, strict=True))
    places = Grid(60, 0.0).places
    fixed = np.array([1000.123, 2000.456, 50.001]) - places[0, 0]
    off = [place[f"grid.s{i}_{j}"] - fixed - places[i, j] for i in range(60) for j in range(60)]
    assert len(survey.legs) == 2 * 60 * 59
    assert np.abs(off).max() < 0.03  # readings of 1 cm and 0.01 deg


def test_a_computed_declination_is_stated_for_a_large_network_too(tmp_path, monkeypatch):
    path = in_surveys(tmp_path, system=True)
    monkeypatch.setattr(large_network, "_LEAST_LOOPS", 10**9)
    alone = solve_file(path, 10.0)
    monkeypatch.setattr(large_network, "_LEAST_LOOPS", 100)
    together = solve_file(path, 10.0)
    require_same(together, alone)


@pytest.mark.parametrize(
    "line",
    ["*prefix a", "*fix s0_0 0 0 0 1 1 1", "*set separator /", "*data normal station newline tape compass clino",
     "*alias station x ..", "*infer equates on", "*equate s0_0 \\grid.s1_0"],
)  # fmt: skip
def test_a_project_that_states_more_is_solved_by_cavern_alone(tmp_path, line):
    (tmp_path / "grid.svx").write_text("\n".join([line, *grid(3, 0.05)]) + "\n")
    assert read_network(tmp_path / "grid.svx") is None
    (tmp_path / "grid.svx").write_text("\n".join(grid(3, 0.05)) + "\n")
    assert read_network(tmp_path / "grid.svx") is not None
