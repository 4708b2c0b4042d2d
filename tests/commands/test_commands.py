"""Commands end with one message: after errors of the operating system, signals, and with broken artifacts."""

import json
import os
import signal

import cv2
import mujoco
import numpy as np
import pytest

from minesurveys.errors import lacks_memory
from pipeline.errors import ArtifactError, InputError, ParamsError, run_command
from pipeline.own_mines import require_name
from pipeline.params.validation import ValidationParams
from pipeline.report.results import read_metrics
from pipeline.store.manifest import read_params
from tests.forked import run_forked
from tests.project import message_of


@pytest.fixture(autouse=True)
def _handlers():
    before = {kind: signal.getsignal(kind) for kind in (signal.SIGTERM, signal.SIGINT)}
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a command of another test may have left its own
    yield
    for kind, handler in before.items():
        signal.signal(kind, handler)


def test_an_error_of_the_operating_system_is_one_line_with_the_file(tmp_path, capsys):
    for path, reason in ((tmp_path / "none" / "x", "No such file"), (tmp_path, "Is a directory")):
        assert run_command("new", path.read_bytes) == 2
        text = capsys.readouterr().err
        assert text.startswith(f"new: {path}: {reason}")
        assert text.count("\n") == 1
    assert run_command("new", lambda: os.open("/dev/full\n" + "a" * 300, os.O_RDONLY)) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_signal_to_end_runs_the_cleaning_up(capsys):
    cleaned = []

    def work():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            signal.pause()
        finally:
            cleaned.append(True)

    assert run_command("new", work) == 130
    assert cleaned == [True]
    assert capsys.readouterr().err == "new: interrupted\n"


def test_an_import_that_a_signal_breaks_is_an_interrupt_and_no_traceback(capsys):
    def load():
        try:
            os.kill(os.getpid(), signal.SIGINT)
            signal.pause()
        except KeyboardInterrupt as error:
            raise ImportError("initialization failed") from error  # as NumPy's C code does

    assert run_command("new", load) == 130
    assert capsys.readouterr().err == "new: interrupted\n"


def test_an_unexpected_error_stays_one():
    with pytest.raises(ZeroDivisionError):
        run_command("new", lambda: 1 / 0)


def _simulate_in_a_terabyte():
    spec = mujoco.MjSpec()
    spec.memory = 1 << 46
    mujoco.MjData(spec.compile())


@pytest.mark.parametrize(
    "work",
    [
        lambda: np.zeros(1 << 50),
        lambda: bytearray(1 << 50),
        lambda: cv2.resize(np.zeros((4, 4), np.float64), (1 << 30, 1 << 20)),
        _simulate_in_a_terabyte,
    ],
)
def test_a_lack_of_memory_is_one_line_whichever_library_meets_it(work, capsys):
    assert run_command("surface", work) == 2
    text = capsys.readouterr().err
    assert text.startswith("surface: not enough memory")
    assert text.count("\n") == 1


def test_an_error_that_quotes_a_file_is_no_lack_of_memory():
    assert not lacks_memory(InputError("out of memory.csv: empty file"))
    assert not lacks_memory(KeyboardInterrupt("Unable to allocate"))


def test_an_expected_error_is_its_message(capsys):
    def fail():
        raise InputError("a.png: empty file")

    assert run_command("new", fail) == 2
    assert capsys.readouterr().err == "new: a.png: empty file\n"


@pytest.mark.parametrize("name", ["Family", "Family-train-0007", "Family-x"])
def test_a_world_cannot_take_the_id_of_the_family(name):
    with pytest.raises(ParamsError, match=f"MineXplore/{name}-v0 is an environment of this project"):
        require_name(name)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[]", "want a mapping of figures, not"),
        ("null", "want a mapping of figures"),
        ("[" * 100_000, "not JSON"),
        ('{"a": NaN}', "'a' = nan: not a figure"),
        ('{"a": 1e999}', "'a' = inf: not a figure"),
        ('{"a": "\\u001b[31m"}', "not a figure"),
        ('{"a\\n": 1}', "not a figure"),
        ("", r"not JSON from line 1, character 1 on; stage 6 writes it anew \(`make all`\)$"),
    ],
)
def test_broken_figures_are_refused_with_the_file(tmp_path, text, message):
    (tmp_path / "metrics.json").write_text(text)
    (tmp_path / "certificate.json").write_text('{"world_sha256": "0"}')
    with pytest.raises(ArtifactError, match=rf"metrics\.json: .*{message}|metrics\.json: {message}"):
        read_metrics(tmp_path)


def test_parameters_of_a_manifest_that_are_none_are_refused(tmp_path):
    fields = {"stage": "validation", "version": "1", "code_sha256": "0", "inputs": {}, "outputs": {}}
    (tmp_path / "manifest.json").write_text(json.dumps({**fields, "params": {"limits": {"a": "x"}}}))
    with pytest.raises(ArtifactError, match=r"manifest\.json: params: '[a-z_.]+' is missing, unknown or of"):
        read_params(tmp_path / "manifest.json", ValidationParams)


@pytest.mark.parametrize(
    "command", ["new x --from plan.dxf --dry-run", "set-overrides", "list", "export default --to usd"]
)
def test_a_command_in_another_folder_names_it_and_does_nothing(tmp_path, command):
    (tmp_path / "plan.dxf").write_text("no drawing")
    message = message_of(run_forked("pipeline", tuple(command.split()), tmp_path))
    assert message == (
        f"{command.split()[0]}: {tmp_path}: not the project's folder, as it has no conf/config.yaml; "
        "run the command in the project's folder"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["plan.dxf"]


@pytest.mark.parametrize("command", ["certify --bundle none", "parity --bundle none"])
def test_a_command_that_reads_a_bundle_works_in_every_folder(tmp_path, command):
    assert "project's folder" not in message_of(run_forked("pipeline", tuple(command.split()), tmp_path))
