"""Many pieces of work: results once and in order, whole in every store, and failures that end nothing else."""

import argparse
import multiprocessing
import os
import signal
import sys
import threading
import time
from functools import partial
from http.server import ThreadingHTTPServer
from pkgutil import resolve_name

import pytest

from benchmarks.speed.pieces import FailingStore, into_failing_store
from pieces.results import PiecesError, Results
from pieces.run import map_pieces
from pieces.work import Where, Work, add_options, where_of


def square(log, number):
    with log.open("a") as lines:
        lines.write(f"{number}\n")
    if number == 7:
        raise ValueError("seven is refused")
    return {"of": number, "square": number * number / 3}


def end_process(number):
    if number == 2:
        os._exit(9)
    return number


def sleep(folder, number):
    (folder / f"begun-{number}").touch()
    time.sleep(60)


def write_folder(folder, number):
    square(folder.parent / "log", number)
    (folder_of(folder, number) / "inner").mkdir(parents=True)
    (folder_of(folder, number) / "inner" / "world.txt").write_text(str(number))


def folder_of(folder, number):
    return folder / str(number)


def folders(folder, holds=None):
    return Work("f", partial(write_folder, folder), None, "1", folder=partial(folder_of, folder), holds=holds)


def squares(tmp_path, **changed):
    given = {"title": "squares", "do": partial(square, tmp_path / "log"), "result": dict, "code": "1", **changed}
    return Work(**{"kept": str(tmp_path / "kept"), **given})


def begun(tmp_path):
    return sorted(map(int, (tmp_path / "log").read_text().split()))


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_are_in_order_and_those_that_are_kept_are_not_made_again(tmp_path, jobs):
    first = map_pieces(squares(tmp_path), [3, 1, 2], Where(jobs))
    assert first == [{"of": n, "square": n * n / 3} for n in (3, 1, 2)]
    assert map_pieces(squares(tmp_path), [3, 1, 2, 4], Where(jobs))[:3] == first
    assert begun(tmp_path) == [1, 2, 3, 4]
    for other in ({"code": "2"}, {"inputs": [1]}):
        map_pieces(squares(tmp_path, **other), [3], Where(jobs))
    assert begun(tmp_path) == [1, 2, 3, 3, 3, 4]


def test_a_piece_that_fails_is_listed_with_its_command_and_ends_no_other(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("sys.orig_argv", ["/usr/bin/python3", "-m", "some.command", "--count", "9"])
    with pytest.raises(PiecesError, match="1 of 9 pieces failed, squares: n7: ValueError: seven is refused"):
        map_pieces(squares(tmp_path, label="n{}".format), range(9), Where())
    assert "\n  again: python -m some.command --count 9 --piece n7\n" in capsys.readouterr().err
    assert begun(tmp_path) == list(range(9))
    with pytest.raises(PiecesError):
        map_pieces(squares(tmp_path, label="n{}".format), range(9), Where(2))
    assert begun(tmp_path).count(7) == 2  # only what failed is made again
    assert len(begun(tmp_path)) == 10


def test_one_piece_is_repeated_alone_although_it_is_kept(tmp_path, capsys):
    map_pieces(squares(tmp_path), [1, 2], Where())
    with pytest.raises(SystemExit) as ended:
        map_pieces(squares(tmp_path), [1, 2], Where(2, piece="2"))
    assert ended.value.code == 0
    assert begun(tmp_path) == [1, 2, 2]
    assert "'of': 2" in capsys.readouterr().out
    with pytest.raises(PiecesError, match="--piece 9: no piece of squares has this label"):
        map_pieces(squares(tmp_path), [1, 2], Where(piece="9"))


def test_a_process_that_ends_fails_its_own_piece_only():
    found = []
    work = Work("ends", end_process, int, "1", kept=None)
    with pytest.raises(PiecesError, match="1 of 6 pieces failed, ends: 2: its process was ended, perhaps for"):
        map_pieces(work, range(6), Where(2), lambda item, result: found.append(item))
    assert sorted(found) == [0, 1, 3, 4, 5]


def test_an_interrupt_ends_the_processes(tmp_path):
    def interrupt(kind, frame):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    threading.Thread(target=_interrupt_when_begun, args=(tmp_path,), daemon=True).start()
    try:
        with pytest.raises(KeyboardInterrupt):
            map_pieces(Work("sleeps", partial(sleep, tmp_path), None, "1", kept=None), range(4), Where(2))
    finally:
        signal.signal(signal.SIGALRM, before)
    assert multiprocessing.active_children() == []


def _interrupt_when_begun(folder):
    while len(list(folder.glob("begun-*"))) < 2:
        time.sleep(0.05)
    os.kill(os.getpid(), signal.SIGALRM)


def test_half_a_result_counts_as_none(tmp_path):
    results = Results(str(tmp_path))
    results.write("kind/a", b"[1, 2]")
    assert results.read("kind/a") == b"[1, 2]"
    file = tmp_path / "kind" / "a"
    file.write_bytes(file.read_bytes()[:-1])
    assert results.read("kind/a") is None
    assert results.read("kind/b") is None


def test_a_store_that_fails_every_tenth_write_loses_nothing():
    found = into_failing_store(60, "local")
    assert (found["lost"], found["half"]) == (0, 0)
    assert found["writes"] > 60


def test_a_store_that_fails_always_is_named_and_an_unknown_one_too(monkeypatch):
    monkeypatch.setattr("pieces.results._WAITS_S", (0.001, 0.001))
    monkeypatch.setattr(FailingStore, "do_PUT", lambda self: self._answer(500, b""))
    with ThreadingHTTPServer(("127.0.0.1", 0), FailingStore) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with pytest.raises(PiecesError, match=r"http://127\.0\.0\.1:\d+/kind: ClientResponseError: 500"):
            Results(f"http://127.0.0.1:{server.server_port}/kind").write("a", b"1")
        server.shutdown()
    with pytest.raises(PiecesError, match="1 of 1 pieces failed, ends: 1: ValueError: Protocol not known: nowhere"):
        map_pieces(Work("ends", end_process, int, "1"), [1], Where(to="nowhere://x"))


def test_a_folder_is_kept_with_its_result_and_brought_where_it_is_missing(tmp_path):
    for place in ("one", "other"):
        work = folders(tmp_path / place)
        map_pieces(work, [5], Where(to=str(tmp_path / "store")))
        assert (tmp_path / place / "5" / "inner" / "world.txt").read_text() == "5"
    assert sorted(path.name for path in (tmp_path / "other").iterdir()) == ["5"]
    assert (tmp_path / "log").read_text() == "5\n"


def test_options_are_those_of_where_and_no_process_is_refused():
    parser = argparse.ArgumentParser()
    add_options(parser, 3)
    assert where_of(parser.parse_args([])) == Where(3)
    given = ["--jobs", "2", "--on", "ray", "--to", "s3://a/b", "--piece", "x"]
    assert where_of(parser.parse_args(given)) == Where(2, "ray", "s3://a/b", "x")
    with pytest.raises(PiecesError, match="jobs = 0: want 1 or more"):
        where_of(parser.parse_args(["--jobs", "0"]))


def test_ray_that_is_not_installed_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(PiecesError, match="--on ray: Ray is not installed; `make setup-baselines` installs it"):
        map_pieces(squares(tmp_path), [1], Where(on="ray"))


@pytest.mark.slow
@pytest.mark.ray
def test_pieces_on_a_cluster_that_is_started_here_are_those_of_local_processes(tmp_path, monkeypatch):
    pytest.importorskip("ray", reason="Ray comes with `make setup-baselines`")
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    do = partial(resolve_name("tests.pieces.test_map_pieces:square"), tmp_path / "log")  # as nodes import it
    local = map_pieces(squares(tmp_path, do=do), range(5), Where(2))
    (tmp_path / "log").unlink()
    work = squares(tmp_path, do=do, kept=str(tmp_path / "again"))
    assert map_pieces(work, range(5), Where(2, "ray")) == local
    with pytest.raises(PiecesError, match="seven is refused"):
        map_pieces(work, range(8), Where(2, "ray"))
    assert begun(tmp_path) == [*range(5), 5, 6, 7]


def test_a_folder_here_that_is_of_another_result_is_not_taken_for_it(tmp_path):
    file = tmp_path / "one" / "5" / "inner" / "world.txt"
    work, where = folders(tmp_path / "one", lambda number, made: file.is_file()), Where(to=str(tmp_path / "store"))
    map_pieces(work, [5], where)
    map_pieces(work, [5], where)
    assert (tmp_path / "log").read_text() == "5\n"
    file.unlink()
    with pytest.raises(PiecesError, match=r"one.5: is not what was made; move it away"):
        map_pieces(work, [5], where)
    (tmp_path / "one" / "5").rename(tmp_path / "away")
    map_pieces(work, [5], where)
    assert file.is_file()
