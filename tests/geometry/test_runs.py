import numpy as np
import pytest
from scipy.ndimage import label

from pipeline.geometry.runs import connected_runs


@pytest.mark.parametrize(("share", "size"), [(0.3, (60, 70)), (0.6, (1500, 9)), (0.9, (3, 2000))])
def test_runs_have_the_parts_that_labels_have(share: float, size: tuple[int, int]) -> None:
    mask = np.random.default_rng(7).random(size) < share
    labels, parts = label(mask)
    runs = connected_runs(mask)
    painted = np.zeros(size, int)
    for row, start, stop, part in zip(runs.row, runs.start, runs.stop, runs.part, strict=True):
        painted[row, start:stop] = part + 1
    assert runs.parts == parts
    assert (painted == labels).all()
    assert (runs.sizes == np.bincount(labels.ravel())[1:]).all()


@pytest.mark.parametrize("full", [False, True])
def test_a_mask_of_one_value_has_no_part_or_one(full: bool) -> None:
    assert connected_runs(np.full((3, 4), full)).parts == int(full)
