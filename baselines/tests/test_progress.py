from baselines.base.progress import progress_bar


def test_progress_is_a_line_every_while_where_there_is_no_terminal(capsys, monkeypatch):
    with progress_bar("run", 2000, 500) as bar:
        bar.update(100)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr("baselines.base.progress.EVERY_S", 0.0)
    with progress_bar("run", 2000, 500) as bar:
        bar.set_postfix({"coverage": "12.5 %"})
        bar.update(100)
    assert "600/2000" in (err := capsys.readouterr().err)
    assert "coverage=12.5 %" in err
