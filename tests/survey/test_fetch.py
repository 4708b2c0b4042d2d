import hashlib
import http.server
import threading
from functools import partial

import pytest

from pipeline.errors import InputError
from pipeline.store.registry import Entry
from pipeline.survey.fetch import fetch_raw

DATA = b"a plan"


@pytest.fixture
def server(tmp_path):
    site = tmp_path / "site"
    site.mkdir()
    (site / "plan.jpg").write_bytes(DATA)

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *args):
            pass

    httpd = http.server.ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(site)))
    threading.Thread(target=httpd.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{httpd.server_address[1]}", site
    httpd.shutdown()


def entry(name="raw/plan.jpg", data=DATA):
    return {name: Entry(name, hashlib.sha256(data).hexdigest(), len(data), "https://example.org/x.jpg", "none stated")}


def test_a_registered_file_is_downloaded_and_its_hash_is_checked(server, tmp_path):
    address, _ = server
    (path,) = fetch_raw(entry(), tmp_path / "data", address)
    assert path.read_bytes() == DATA


def test_an_existing_file_is_not_downloaded_again(server, tmp_path):
    address, site = server
    fetch_raw(entry(), tmp_path / "data", address)
    (site / "plan.jpg").unlink()
    assert fetch_raw(entry(), tmp_path / "data", address)


def test_a_changed_file_is_refused_and_not_kept(server, tmp_path):
    address, site = server
    for content, message in ((b"b plan", "not the registered file"), (b"another plan", "more than 6 bytes")):
        (site / "plan.jpg").write_bytes(content)
        with pytest.raises(InputError, match=message):
            fetch_raw(entry(), tmp_path / "data", address)
    assert not (tmp_path / "data" / "raw" / "plan.jpg").exists()


def test_a_missing_file_and_an_unreachable_server_are_named(server, tmp_path):
    address, _ = server
    with pytest.raises(InputError, match=r"other\.jpg: cannot be fetched"):
        fetch_raw(entry("raw/other.jpg"), tmp_path / "data", address)
    with pytest.raises(InputError, match="cannot be fetched"):
        fetch_raw(entry(), tmp_path / "data2", "http://127.0.0.1:9")


def test_a_folder_serves_as_mirror(server, tmp_path):
    _, site = server
    (path,) = fetch_raw(entry(), tmp_path / "data", str(site))
    assert path.read_bytes() == DATA
    (site / "plan.jpg").write_bytes(b"changed")
    path.unlink()
    with pytest.raises(InputError, match="not the registered file"):
        fetch_raw(entry(), tmp_path / "data", str(site))


def test_tracked_files_are_not_downloaded(tmp_path):
    local = {"chilean_mine/stations.csv": Entry("chilean_mine/stations.csv", "0" * 64, 1, "this project", "Apache-2.0")}
    assert fetch_raw(local, tmp_path, "http://127.0.0.1:9") == []
