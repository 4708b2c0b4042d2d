"""Pieces of work on two nodes of Ray, of one processor each on this machine, beside the local pool in the same run.

Light worlds of the four styles are built by both, and once more while a node and the driver are killed. Small results
are written to a store that fails every tenth write. Pieces without work are scheduled.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from baselines.base.markdown import markdown_table, write_table
from benchmarks.results import run_benchmark
from pieces.results import PiecesError, Results
from pieces.run import map_pieces
from pieces.work import Where, Work
from pipeline.build.family import Member, MemberOutcome, generated, make_member, problem_of, without_rock

PAGE = Path("docs/evidence/parts/pieces.md")
_SMALL = ["survey.mine.size_m=[60,70]"]  # m; a world of it takes a third of one of the splits
_PORT, _APART, _TRIES, _START_S = 6700, 20, 4, 90.0
_STORED, _EMPTY = 1000, 100_000
_FAILS = 10  # of so many writes one fails
_STARTED = "Ray runtime started"
_DRIVER = [sys.executable, "-m", "benchmarks.speed.pieces", "--drive"]


def build_counted(folder: Path, member: Member) -> MemberOutcome:
    """Build a world, and note that it was begun, and the processor time."""
    with (folder / "begun.txt").open("a") as begun:
        begun.write(f"{member.folder}\n")
    before = sum(os.times()[:4])
    outcome = make_member(folder / "families", "", member)
    with (folder / "processor_s.txt").open("a") as spent:
        spent.write(f"{sum(os.times()[:4]) - before}\n")
    return outcome


def double(number: int) -> list[int]:
    """Return a small result."""
    return [2 * number] * 200


def nothing(number: int) -> int:
    """Return at once."""
    return number


def worlds_of(folder: Path) -> Work:
    """Return the worlds that are built into a folder."""
    return Work("worlds", partial(build_counted, folder), MemberOutcome, "1", label=_folder_of, problem=problem_of)


def _folder_of(member: Member) -> str:
    return member.folder


def drive(what: str, folder: Path, count: int, on: str) -> None:
    """Do pieces and print what came of them: hashes and seconds, or the rate and the memory that the driver took."""
    where = Where(2, on, str(folder / "store"))
    folder.mkdir(exist_ok=True)
    start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    if what == "worlds":
        members = without_rock(generated("validation", count, _SMALL), 0)
        made = map_pieces(worlds_of(folder), members, where)
        spent = sum(map(float, (folder / "processor_s.txt").read_text().split()))
        found: dict[str, Any] = {"hashes": [outcome.world_sha256 for outcome in made], "processor_s": spent}
    else:
        map_pieces(Work("nothing", nothing, int, "1", kept=None), range(count), Where(2, on))
        found = {"memory_mb": (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024}
    print(json.dumps(found | {"seconds": time.perf_counter() - start}))


def run_driver(what: str, folder: Path, count: int, on: str) -> dict[str, Any]:
    """Run a driver to its end and return what it found."""
    done = subprocess.run([*_DRIVER, what, str(folder), str(count), on], stdout=subprocess.PIPE, text=True)
    if done.returncode:
        raise PiecesError(f"pieces: the driver of {count} {what} on {on} ended with {done.returncode}")
    return dict(json.loads(done.stdout.splitlines()[-1]))


def start_node(number: int) -> subprocess.Popen[str]:
    """Start a node with one processor; the first is the head. Ray gives up after 15 s on a busy machine, so try again.

    Ports are stated, as the nodes share a machine.
    """
    first, of = _PORT + _APART * number, ("--head", f"--port={_PORT}", "--include-dashboard=false")
    named = ("dashboard-agent-grpc", "dashboard-agent-listen", "metrics-export", "runtime-env-agent")
    ports = [f"--{name}-port={first + k}" for k, name in enumerate(named, start=1)]
    join = (f"--address=127.0.0.1:{_PORT}",) if number else of
    ray = str(Path(sys.prefix) / "bin" / "ray")
    words = [ray, "start", *join, "--num-cpus=1", "--node-ip-address=127.0.0.1", "--block", *ports]
    for _ in range(_TRIES):
        node = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        assert node.stdout is not None
        timer = threading.Timer(_START_S, node.kill)
        timer.start()
        started = any(_STARTED in line for line in iter(node.stdout.readline, ""))
        timer.cancel()
        if started:
            return node
        node.kill()
        node.wait()
    raise PiecesError(f"pieces: a node of Ray did not start in {_TRIES} tries")


@contextmanager
def two_nodes() -> Iterator[list[subprocess.Popen[str]]]:
    """Run two nodes on this machine, which end with the block."""
    os.environ |= {"RAY_ADDRESS": f"127.0.0.1:{_PORT}", "RAY_AUTH_MODE": "disabled", "RAY_USAGE_STATS_ENABLED": "0"}
    os.environ["RAY_worker_niceness"] = "0"  # noqa: SIM112  Ray has 15, so that other work would slow these pieces only
    os.environ["PYTHONPATH"] = str(Path.cwd())
    nodes: list[subprocess.Popen[str]] = []
    try:
        for number in range(2):
            nodes.append(start_node(number))
        yield nodes
    finally:
        for node in reversed(nodes):  # what a node started ends with it
            node.send_signal(signal.SIGTERM)
            with suppress(subprocess.TimeoutExpired):
                node.wait(20)
            node.kill()


def killed(folder: Path, count: int, node: subprocess.Popen[str]) -> tuple[dict[str, Any], int]:
    """Kill a node at a third and the driver at two thirds; return what the next driver found, and what was begun twice.

    Parameters
    ----------
    folder : Path
    count : int
        Worlds.
    node : Popen

    Returns
    -------
    dict
    int
        Begun beyond once, of all worlds.
    """
    driver = subprocess.Popen([*_DRIVER, "worlds", str(folder), str(count), "ray"], stdout=subprocess.DEVNULL)
    for share, victim in ((1 / 3, node), (2 / 3, driver)):
        while len(list((folder / "store" / "worlds").glob("*"))) < share * count and driver.poll() is None:
            time.sleep(0.1)
        victim.kill()
        victim.wait()
    found = run_driver("worlds", folder, count, "ray")
    begun = Counter((folder / "begun.txt").read_text().split())
    return found, sum(begun.values()) - count


def compared(timed: list[tuple[str, dict[str, Any]]], key: str) -> tuple[float, str]:
    """Return the share by which Ray took more than local processes, and its text."""
    ray, local = (sum(found[key] for which, found in timed if which == on) for on in ("ray", "local"))
    return ray / local - 1, f"{ray / local - 1:+.1%} ({ray:.0f} s against {local:.0f} s)"


class FailingStore(BaseHTTPRequestHandler):
    """A store whose every tenth write keeps half of what it got, and fails."""

    objects: dict[str, bytes] = {}  # noqa: RUF012  of the class: each request has a handler of its own
    writes = 0

    def do_PUT(self) -> None:
        """Write an object."""
        data = self.rfile.read(int(self.headers["Content-Length"]))
        FailingStore.writes += 1
        fails = FailingStore.writes % _FAILS == 0
        self.objects[self.path] = data[: len(data) // 2] if fails else data
        self._answer(500 if fails else 201, b"")

    def do_GET(self) -> None:
        """Return an object."""
        self._answer(200 if self.path in self.objects else 404, self.objects.get(self.path, b""))

    def _answer(self, code: int, data: bytes) -> None:
        self.send_response(code)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, format: str, *arguments: Any) -> None:
        """Print nothing."""


def into_failing_store(count: int, on: str) -> dict[str, int]:
    """Write results to a store that fails; return how many are lost and how many are there in half."""
    FailingStore.objects, FailingStore.writes = {}, 0
    with ThreadingHTTPServer(("127.0.0.1", 0), FailingStore) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}/store"
        work = Work("doubles", double, list[int], "1")
        made = map_pieces(work, range(count), Where(2, on, address))
        results = Results(address)
        read = [results.read(path.removeprefix("/store/")) for path in FailingStore.objects]
        server.shutdown()
    lost = count - len({data for data in read if data is not None}) + sum(m != double(k) for k, m in enumerate(made))
    return {"lost": lost, "half": read.count(None), "writes": FailingStore.writes}


def main() -> int:
    """Measure all rows and write the page; exit code 1 if one misses what is wanted."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks pieces", description=__doc__)
    parser.add_argument("--count", type=int, default=48, help="light worlds of small mines")
    parser.add_argument("--drive", nargs=4, metavar=("WHAT", "FOLDER", "COUNT", "ON"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.drive:
        what, folder, count, on = given.drive
        drive(what, Path(folder), int(count), on)
        return 0
    with tempfile.TemporaryDirectory(prefix="pieces-") as name, two_nodes() as nodes:
        root = Path(name)
        halves = [(root / f"{on}-{k}", on) for k, on in enumerate(("local", "ray", "ray", "local"))]
        timed = [(on, run_driver("worlds", folder, given.count // 2, on)) for folder, on in halves]
        same = all(found["hashes"] == timed[0][1]["hashes"] for _, found in timed)
        empty = run_driver("nothing", root / "empty", _EMPTY, "ray")
        stored = into_failing_store(_STORED, "ray")
        again, twice = killed(root / "killed", given.count // 2, nodes[1])
        survived = again["hashes"] == timed[0][1]["hashes"]
    (over, wall), (_, busy) = (compared(timed, key) for key in ("seconds", "processor_s"))
    rate = _EMPTY / empty["seconds"]
    good = [
        over <= 0.10 and same,
        survived and twice <= 4,
        not stored["lost"] and not stored["half"],
        rate >= 500 and empty["memory_mb"] <= 1000,
    ]
    rows = [
        (
            f"{given.count} light worlds of the four styles",
            f"wall {wall}, processor time {busy}, hashes {_equal(same)}",
        ),
        ("a node killed at a third, the driver at two thirds", f"hashes {_equal(survived)}, {twice} begun twice"),
        (
            f"{_STORED:,} results, every tenth write fails",
            f"{stored['lost']} lost, {stored['half']} in half, {stored['writes']:,} writes",
        ),
        (f"{_EMPTY:,} pieces without work", f"{rate:,.0f} a second, {empty['memory_mb']:.0f} MB more in the driver"),
    ]
    wanted = ("at most +10 %, equal", "equal, at most 4 begun twice", "0 lost, 0 in half", "500 a second, 1,000 MB")
    cells = [
        (*row, limit + ("" if held else ": **missed**")) for row, limit, held in zip(rows, wanted, good, strict=True)
    ]
    text = markdown_table(("on two nodes of Ray", "measured", "wanted"), cells)
    write_table(PAGE, text)
    print(text)
    return 0 if all(good) else 1


def _equal(same: bool) -> str:
    return "equal" if same else "DIFFER"


if __name__ == "__main__":
    sys.exit(run_benchmark("pieces", main))
