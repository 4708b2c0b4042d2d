"""Pictures of what a world does not have: their files say so, and the report leaves them out."""

from pathlib import Path

import numpy as np

from pipeline.report.page import _pictures
from pipeline.store.codecs import encode
from pipeline.types import NO_PICTURE


def test_the_report_shows_what_was_drawn_and_leaves_out_a_picture_that_says_it_was_not(tmp_path):
    drawn = np.random.default_rng(0).integers(0, 255, NO_PICTURE.shape).astype(np.uint8)
    for name, picture in (("drawn.png", drawn), ("not.png", NO_PICTURE)):
        (tmp_path / name).write_bytes(encode(Path(name), picture))
    shown = _pictures(tmp_path, [("drawn.png", "one"), ("not.png", "other")])
    assert [caption for _, caption, _ in shown] == ["one"]


def test_a_picture_that_was_not_drawn_is_a_readable_line(tmp_path):
    assert NO_PICTURE.shape[1] > 300
    assert (NO_PICTURE < 128).mean() > 0.01
