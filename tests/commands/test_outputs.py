"""Files at paths that the user chose are replaced only if they are an earlier output of the same kind."""

import json

import pytest

from pipeline.commands.new import _require_place
from pipeline.errors import ArtifactError, InputError
from pipeline.store.files import write_report


@pytest.mark.parametrize("content", ["mine", "[]", '{"title": "mine"}', ""])
def test_another_file_at_the_place_of_figures_is_kept_and_named(tmp_path, content):
    path = tmp_path / "certificate.json"
    path.write_text(content)
    with pytest.raises(ArtifactError, match=r"certificate\.json: there is another file; move it away"):
        write_report(path, json.dumps({"holds": True}).encode())
    assert path.read_text() == content


def test_earlier_figures_of_the_same_kind_are_replaced(tmp_path):
    path = tmp_path / "certificate.json"
    for holds in (True, False):
        write_report(path, json.dumps({"holds": holds}).encode())
    assert json.loads(path.read_text()) == {"holds": False}


def test_a_picture_of_the_user_is_not_replaced_by_what_was_detected(tmp_path):
    (tmp_path / "holiday.png").write_bytes(b"mine")
    with pytest.raises(InputError, match=r"holiday\.png: there is a file; choose another name"):
        _require_place(tmp_path / "holiday.png", tmp_path / "plan.png")
    _require_place(tmp_path / "found.png", tmp_path / "plan.png")
