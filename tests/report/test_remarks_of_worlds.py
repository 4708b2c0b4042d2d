"""Remarks of a world's making are kept with it, for its report and for the next command."""

from pathlib import Path

from minesurveys.remarks import Remark, collect_remarks, hand_on, record_remarks, warn_user
from pipeline.report.remarks import remarks_of, write_detected
from pipeline.store.codecs import decode, encode
from pipeline.store.manifest import Manifest


def manifest(*remarks):
    return Manifest("survey", "1", "0" * 64, {}, {}, {}, list(remarks))


def test_a_manifest_keeps_its_remarks_and_one_without_them_is_read_too(tmp_path):
    path = tmp_path / "manifest.json"
    path.write_bytes(encode(path, manifest(Remark("what", "3", "--option"))))
    assert decode(path, Manifest).remarks == [Remark("what", "3", "--option")]
    path.write_text(
        '{"stage": "survey", "version": "1", "code_sha256": "0", "params": {}, "inputs": {}, "outputs": {}}'
    )
    assert decode(path, Manifest).remarks == []


def test_what_a_stage_remarks_reaches_the_user_and_is_recorded_also_if_it_fails():
    with collect_remarks() as user:
        try:
            with record_remarks() as recorded:
                warn_user("3 stations are guessed")
                raise OSError
        except OSError:
            pass
    assert user == recorded == [Remark("3 stations are guessed")]


def test_remarks_of_detection_and_stages_are_listed_once_with_the_figures_of_the_stage(tmp_path):
    write_detected(
        tmp_path, [Remark("stations have no roof", "4 of 9", of="cave.3d"), Remark("read as a station survey")]
    )
    stage = manifest(
        Remark("stations have no roof", "5 of 9", of="cave.3d"), Remark("ends are closed", "2", of="compile3d")
    )
    found = remarks_of(tmp_path, [stage], "cave.3d")
    assert [(remark.value, remark.what) for remark in found] == [
        ("", "read as a station survey"),
        ("5 of 9", "stations have no roof"),
        ("2", "ends are closed"),
    ]


def test_a_world_that_no_detection_made_has_the_remarks_of_its_stages(tmp_path: Path):
    hand_on([])
    assert [remark.what for remark in remarks_of(tmp_path, [manifest(Remark("guessed"))], "x")] == ["guessed"]
