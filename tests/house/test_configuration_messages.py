"""What a broken file of the configuration says."""

import pytest

from benchmarks.fuzzing.library_words import library_words
from pipeline.errors import ParamsError
from pipeline.params.composed import composed_section, root_overrides


@pytest.mark.parametrize("text", ['{"survey": 3}', '{"survey": {"kind": "plan"}}', '{"a": [', "[]", "[" * 20_000])
def test_a_broken_composed_configuration_is_refused_in_one_line_of_our_own_words(tmp_path, monkeypatch, text):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "artifacts").mkdir()
    (tmp_path / "artifacts/params.json").write_text(text)
    with pytest.raises(ParamsError, match="not a composed configuration") as caught:
        composed_section("survey")
    assert "\n" not in str(caught.value)
    assert library_words(str(caught.value)) == []
    assert "Input" not in str(caught.value)


@pytest.mark.parametrize(
    "text", ["overrides: [1]\n", "overrides: 5\n", "overides: ''\n", "overrides: 'a=\"b'\n", "a: [\n", "- 3\n"]
)
def test_a_file_without_a_line_of_overrides_is_refused_in_our_own_words(tmp_path, monkeypatch, text):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "params.yaml").write_text(text)
    with pytest.raises(ParamsError) as caught:
        root_overrides()
    assert str(caught.value) == 'params.yaml: want one line `overrides: "..."`, quoted as in a shell'
