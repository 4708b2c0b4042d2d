"""Nothing is removed but what this project wrote."""

import json
import os
import signal
import subprocess
import sys

import pytest

from pipeline.errors import ArtifactError
from pipeline.store.files import recover_folder, replace_folder, write_atomically
from pipeline.store.hashing import sha256_bytes
from pipeline.store.written import remove_written, take_back
from tests.project import ROOT

OLD = {"a.txt": b"old", "sub/b.txt": b"old"}
OURS = {name: sha256_bytes(data) for name, data in OLD.items()}


def tree(folder):
    """Return the content of every file, and the names of folders and links."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")
    }


def add_note(folder):
    (folder / "notes.txt").write_text("mine")


def add_hidden_note(folder):
    (folder / "sub" / ".notes").write_text("mine")


def add_empty_folder(folder):
    (folder / "drafts").mkdir()


def add_link(folder):
    (folder / "link").symlink_to("/etc/hostname")


def make_a_checkout(folder):
    subprocess.run(["git", "init", "-q", folder], check=True)


def change(folder):
    (folder / "a.txt").write_text("edited by hand")


def link_instead(folder):
    (folder / "a.txt").unlink()
    (folder / "a.txt").symlink_to(folder.parent / "elsewhere")


FOREIGN = [add_note, add_hidden_note, add_empty_folder, add_link, make_a_checkout, change, link_instead]


INTERRUPT = """
import os, signal, sys
from pathlib import Path
from pipeline.store.files import replace_folder

folder = Path(sys.argv[1])

def replaced(text, at):
    events = []
    def interrupt(event, words):
        if event in ("open", "os.mkdir", "os.rename", "os.remove", "os.rmdir") and ".out.partial" in str(words[0]):
            events.append(event)
            if len(events) == at + 1:
                os.kill(os.getpid(), signal.SIGTERM)
    def end(kind, frame):
        raise KeyboardInterrupt
    signal.signal(signal.SIGTERM, end)
    sys.addaudithook(interrupt)
    try:
        replace_folder(folder, {"a.txt": text, "sub/c.txt": text}, {"a.txt": None, "sub/c.txt": None})
    except KeyboardInterrupt:
        os._exit(130)
    os._exit(0)

moments = 0
for text in (b"new 1", b"new 2"):
    for at in range(100):
        if not (child := os.fork()):
            replaced(text, at)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        assert code in (0, 130), (text, at, code)
        found = sorted(path.name for path in folder.parent.iterdir())
        assert found in ([], ["out"]), (text, at, found)
        if code == 0:
            break
        moments += 1
print(moments)
"""


@pytest.mark.parametrize("make", FOREIGN)
@pytest.mark.parametrize(
    "end", [lambda at: replace_folder(at, {"a.txt": b"new"}, OURS), lambda at: remove_written(at, OURS)]
)
def test_a_folder_with_anything_else_is_kept_and_the_file_is_named(tmp_path, make, end):
    folder = tmp_path / "out"
    (tmp_path / "elsewhere").write_bytes(b"old")
    replace_folder(folder, OLD, {})
    make(folder)
    before = tree(tmp_path)
    with pytest.raises(ArtifactError, match=rf"^{folder}/\S+: .*; move it away and run again$"):
        end(folder)
    assert tree(tmp_path) == before


def test_a_folder_of_ours_is_replaced_and_removed(tmp_path):
    folder = tmp_path / "out"
    replace_folder(folder, OLD, {})
    replace_folder(folder, {"c.txt": b"new"}, OURS)
    assert tree(tmp_path) == {"out": None, "out/c.txt": b"new"}
    remove_written(folder, {"c.txt": sha256_bytes(b"new")})
    assert tree(tmp_path) == {}


def test_a_linked_folder_is_refused(tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "out").symlink_to(tmp_path / "disk")
    with pytest.raises(ArtifactError, match=r"out: a link or a file, where a folder is written"):
        replace_folder(tmp_path / "out", OLD, {})
    assert (tmp_path / "out").is_symlink()


@pytest.mark.parametrize("content", [{"new/thesis.txt": "mine"}, {"journal.json": "[]"}, {"journal.json": "{}"}])
def test_a_hidden_folder_of_the_user_is_kept_and_named(tmp_path, content):
    hidden = tmp_path / ".out.partial"
    hidden.mkdir()
    for name, text in content.items():
        (hidden / name).parent.mkdir(exist_ok=True)
        (hidden / name).write_text(text)
    before = tree(tmp_path)
    with pytest.raises(ArtifactError, match=rf"^{hidden}.*; move it away and run again$"):
        replace_folder(tmp_path / "out", OLD, {})
    assert tree(tmp_path) == before


def test_a_file_of_the_user_in_our_hidden_folder_is_kept_and_named(tmp_path):
    hidden = tmp_path / ".out.partial"
    (hidden / "new").mkdir(parents=True)
    (hidden / "journal.json").write_text(json.dumps({"new": {"a.txt": [OURS["a.txt"], 3]}, "old": {}}))
    (hidden / "new" / "a.txt").write_text("mine, and longer than what was to be written")
    before = tree(tmp_path)
    with pytest.raises(ArtifactError, match=r"new/a\.txt: was changed since it was written"):
        recover_folder(tmp_path / "out")
    assert tree(tmp_path) == before


KILL = """
import os, pathlib, signal, sys
from pathlib import Path
from pipeline.store.files import replace_folder
calls = []
def killing(real):
    def call(*words, **named):
        calls.append(1)
        if len(calls) == {at}:
            os.kill(os.getpid(), signal.SIGKILL)
        return real(*words, **named)
    return call
{moment} = killing({moment})
replace_folder(Path(sys.argv[1]), {{"a.txt": b"new", "sub/c.txt": b"new" * 9999}}, {ours!r})
"""


def test_an_interrupt_at_any_moment_leaves_no_hidden_folder(tmp_path):
    """The interrupt comes at each call of the system that writes, renames or removes, in turn."""
    done = subprocess.run([sys.executable, "-c", INTERRUPT, tmp_path / "out"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert int(done.stdout) > 15  # moments
    assert tree(tmp_path) == {"out": None, "out/a.txt": b"new 2", "out/sub": None, "out/sub/c.txt": b"new 2"}


@pytest.mark.parametrize(
    ("moment", "at"),
    [*(("os.fsync", k) for k in (2, 3)), *((f"pathlib.Path.{end}", k) for end in ("rename", "unlink") for k in (1, 2))],
)
def test_the_state_that_a_killed_command_leaves_is_repaired(tmp_path, moment, at):
    folder = tmp_path / "out"
    replace_folder(folder, OLD, {})
    before = tree(folder)
    program = KILL.format(moment=moment, at=at, ours=OURS)
    done = subprocess.run([sys.executable, "-c", program, folder], cwd=ROOT)
    assert done.returncode == -signal.SIGKILL
    assert {path.name for path in tmp_path.iterdir()} > {".out.partial"} or not folder.exists()
    recover_folder(folder)
    after = tree(folder)
    assert after == before or (moment == "pathlib.Path.unlink" and after["a.txt"] == b"new")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_file_that_the_user_has_beside_one_that_is_written_is_kept(tmp_path):
    for name in (".a.txt.partial", "a.txt.partial", ".a.txt"):
        (tmp_path / name).write_text("mine")
    write_atomically(tmp_path / "a.txt", b"new")
    assert {name: data for name, data in tree(tmp_path).items() if name != "a.txt"} == dict.fromkeys(
        (".a.txt.partial", "a.txt.partial", ".a.txt"), b"mine"
    )


def test_only_files_that_are_as_they_were_written_are_taken_back(tmp_path):
    folder = tmp_path / "mine"
    replace_folder(folder, OLD, {})
    change(folder)
    left = take_back({folder / name: digest for name, digest in OURS.items()}, [folder, folder / "sub"])
    assert left == [folder / "a.txt", folder]
    assert tree(tmp_path) == {"mine": None, "mine/a.txt": b"edited by hand"}
    assert os.path.lexists(folder / "a.txt")
