import re
import time

from baselines.base.progress import Progress


def test_progress_is_a_line_every_while_where_there_is_no_terminal(capsys, monkeypatch):
    monkeypatch.setattr("baselines.base.progress.EVERY_S", 0.2)
    progress = Progress("run", 2000, 500)
    progress.figures = {"coverage": "12.5 %"}
    progress.add(100)
    time.sleep(0.3)
    progress.close()
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert re.fullmatch(r"run: 600 of 2,000 steps \(30.0 %\), \d+ steps/s, coverage 12.5 %", lines[0])
    time.sleep(0.3)
    assert capsys.readouterr().err == ""
