"""Servers that are slow, lie or break the protocol: each ends in one error, and nothing of the file stays."""

import contextlib
import gzip
import hashlib
import socketserver
import threading
import time

import pytest
import requests

from minexplore.bundle import BundleError
from minexplore.extra import download
from minexplore.extra.download import Transfer, keep_file, read_address
from tests.project import eventually

DATA = b"a world's file"
MOST = 1000


class Server(socketserver.ThreadingTCPServer):
    """Answers each request by what `answer` yields."""

    daemon_threads, allow_reuse_address = True, True

    def __init__(self):
        super().__init__(("127.0.0.1", 0), Handler)
        self.answer, self.listens = list, True
        self.address = f"http://127.0.0.1:{self.server_address[1]}/file"


class Handler(socketserver.StreamRequestHandler):
    def handle(self):
        with contextlib.suppress(OSError):
            while self.server.listens and self.rfile.readline() not in (b"\r\n", b""):
                pass
            for part in self.server.answer():
                self.wfile.write(part)


@pytest.fixture
def server():
    found = Server()
    threading.Thread(target=found.serve_forever, args=(0.01,), daemon=True).start()
    yield found
    found.shutdown()
    found.server_close()


def answer(content=DATA, status=b"200 OK", **headers):
    stated = {
        "Content-Length": b"%d" % len(content),
        **{name.replace("_", "-"): text for name, text in headers.items()},
    }
    lines = [b"HTTP/1.1 " + status, *(name.encode() + b": " + text for name, text in stated.items()), b"", content]
    return b"\r\n".join(lines)


def redirect(target):
    return answer(b"", b"302 Found", Location=target)


def keep(address, folder, transfer=None):
    with requests.Session() as session:
        sha256 = hashlib.sha256(DATA).hexdigest()
        keep_file(session, address, folder / "file", sha256, MOST, transfer or Transfer(), "the file that is wanted")


def slowly(parts, pause_s=0.05):
    """Yield parts with pauses, for 3 s at most."""
    for part in parts[: round(3 / pause_s)]:
        yield part
        time.sleep(pause_s)


def of_bytes(text):
    return [text[k : k + 1] for k in range(len(text))]


def test_a_file_is_kept_once_by_its_hash(server, tmp_path):
    server.answer = lambda: [answer()]
    keep(server.address, tmp_path)
    assert (tmp_path / "file").read_bytes() == DATA
    server.answer = lambda: [answer(b"another")]
    keep(server.address, tmp_path)
    assert read_address(server.address, MOST, Transfer()) == b"another"


def test_a_redirect_is_followed_and_its_content_is_not_read(server):
    answers = iter([redirect(b"/other") + b"x" * 10_000_000, answer()])
    server.answer = lambda: [next(answers)]
    assert read_address(server.address, MOST, Transfer()) == DATA


WRONG = {
    "label over 63 letters": redirect(b"http://" + b"a" * 64 + b".example/"),
    "empty label": redirect(b"http://a..example/"),
    "no host": redirect(b"http:///file"),
    "no UTF-8": redirect(b"http://127.0.0.1/\xff\xfe"),
    "no UTF-8 host": redirect(b"http://\xff/"),
    "zero byte": redirect(b"http://127.0.0.1\x00/"),
    "no address": redirect(b"http://[::1"),
    "port": redirect(b"http://127.0.0.1:99999/"),
    "port of letters": redirect(b"http://127.0.0.1:x/"),
    "other scheme": redirect(b"file:///etc/passwd"),
    "redirects for ever": redirect(b"/file"),
    "redirect without a place": answer(b"", b"302 Found"),
    "nothing": b"",
    "no HTTP": b"hello\r\n\r\n",
    "status of letters": answer(status=b"abc"),
    "not found": answer(status=b"404 Not Found"),
    "no content": answer(b"", status=b"204 No Content"),
    "a part": answer(status=b"206 Partial Content"),
    "broken": answer(status=b"500 Internal Server Error"),
    "long header": answer(X=b"x" * 100_000),
    "many headers": answer(**{f"X{k}": b"x" for k in range(200)}),
    "longer than sent": answer(Content_Length=b"99"),
    "two lengths": answer(Content_Length=b"14, 15"),
    "chunks that are none": answer(b"zz\r\nfile\r\n", Transfer_Encoding=b"chunked"),
    "a chunk that is cut": answer(b"fff\r\nfile", Transfer_Encoding=b"chunked"),
    "no last chunk": answer(b"4\r\nfile\r\n", Transfer_Encoding=b"chunked"),
    "packed": answer(gzip.compress(DATA), Content_Encoding=b"gzip"),
    "a bomb": answer(gzip.compress(b"0" * 50_000_000)[:MOST], Content_Encoding=b"gzip"),
    "packed unheard of": answer(DATA, Content_Encoding=b"\xff"),
    "too large": answer(b"x" * (MOST + 1)),
    "too large in chunks": answer(b"fff\r\n" + b"x" * 0xFFF + b"\r\n0\r\n\r\n", Transfer_Encoding=b"chunked"),
}


@pytest.mark.parametrize("name", WRONG)
def test_each_fault_of_a_server_is_one_error_and_nothing_is_kept(server, tmp_path, name):
    server.answer = lambda: [WRONG[name]]
    with pytest.raises(BundleError) as found:
        keep(server.address, tmp_path)
    assert str(found.value).startswith(f"{server.address}: ")
    assert str(found.value).isprintable()
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(BundleError):  # nor where no hash is known
        read_address(server.address, MOST, Transfer())


@pytest.mark.parametrize(
    "address",
    ["http://" + "a" * 64, "http://a..b", "http://", "https://x:y", "http://\ud800", "http://a\0b", "ftp://a/b"],
)
def test_an_address_that_is_none_is_one_error(address):
    with pytest.raises(BundleError, match="cannot be fetched"):
        read_address(address, MOST, Transfer())


def test_a_server_without_a_certificate_is_one_error(server):
    server.answer, server.listens = lambda: [answer()], False
    with pytest.raises(BundleError, match="SSLError"):
        read_address(server.address.replace("http", "https"), MOST, Transfer())


SLOW = {
    "status": lambda: slowly(of_bytes(answer())),
    "headers": lambda: slowly([b"HTTP/1.1 200 OK\r\n", *[b"X: x\r\n"] * 90]),
    "content": lambda: slowly([answer(b"", Content_Length=b"900"), *[b"x"] * 900]),
    "chunks": lambda: slowly([b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n", *[b"1\r\nx\r\n"] * 900]),
    "more to come": lambda: slowly([b"HTTP/1.1 100 Continue\r\n\r\n"] * 900),
    "redirects": lambda: slowly([b"", redirect(b"/file")], 0.2),
    "silence": lambda: slowly([b""], 1.0),
}


@pytest.mark.parametrize("name", SLOW)
def test_a_transfer_ends_at_its_time_whatever_part_of_it_is_slow(server, tmp_path, name, monkeypatch):
    monkeypatch.setenv("MINEXPLORE_DOWNLOAD_S", "0.4")
    server.answer = SLOW[name]
    with pytest.raises(BundleError, match=r"too slow, .* want an end within 0\.4 s, as MINEXPLORE_DOWNLOAD_S says"):
        keep(server.address, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_transfer_below_the_least_rate_ends_and_names_the_variable_that_allows_it(server, monkeypatch):
    monkeypatch.setattr(download, "START_S", 0.3)
    server.answer = SLOW["content"]
    with pytest.raises(BundleError, match=r"too slow, .* 10,000 bytes/s .* MINEXPLORE_DOWNLOAD_S=SECONDS"):
        read_address(server.address, MOST, Transfer())
    monkeypatch.setenv("MINEXPLORE_DOWNLOAD_S", "600")
    server.answer = lambda: slowly(of_bytes(answer()), 0.01)
    assert read_address(server.address, MOST, Transfer()) == DATA


def test_a_file_that_comes_fast_enough_may_take_longer_than_the_first_minute(server):
    size, transfer = 200 * (1 << 14), Transfer()

    def parts():
        yield answer(b"", Content_Length=b"%d" % size) + b"x" * (size - 1)
        assert eventually(lambda: transfer._received > size / 2)  # 160 s more, at the least rate
        transfer._begun -= 100
        yield b"x"

    server.answer = parts
    assert len(read_address(server.address, size, transfer)) == size


def test_the_time_of_a_world_runs_over_all_its_files(server, tmp_path, monkeypatch):
    monkeypatch.setenv("MINEXPLORE_DOWNLOAD_S", "600")
    server.answer = lambda: [answer()]
    transfer = Transfer()
    keep(server.address, tmp_path / "first", transfer)
    transfer._begun -= 600
    with pytest.raises(BundleError, match="too slow"):
        keep(server.address, tmp_path / "second", transfer)
    assert (tmp_path / "first" / "file").read_bytes() == DATA


@pytest.mark.parametrize("stated", ["", "x", "0", "-1", "nan", "inf", "1e9"])
def test_a_time_that_is_none_is_refused(monkeypatch, stated):
    monkeypatch.setenv("MINEXPLORE_DOWNLOAD_S", stated)
    with pytest.raises(BundleError, match=r"MINEXPLORE_DOWNLOAD_S = .*: want seconds"):
        Transfer()


def test_a_file_that_cannot_be_kept_is_one_error(server, tmp_path):
    server.answer = lambda: [answer()]
    (tmp_path / "place").write_text("")
    with pytest.raises(BundleError, match="cannot be kept"):
        keep(server.address, tmp_path / "place")
