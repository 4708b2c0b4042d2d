"""Simplification of a large mesh in a process of its own."""

import fast_simplification
import numpy as np
import pytest

from pipeline.errors import GeometryError
from pipeline.mjcf import simplify
from pipeline.mjcf.simplify import simplify_mesh


def hills(count):
    """Return a square of hills of count x count points, and its faces."""
    x, y = np.meshgrid(np.arange(count) / 10, np.arange(count) / 10)
    points = np.column_stack([x.ravel(), y.ravel(), np.sin(x.ravel()) * np.cos(y.ravel())]).astype(np.float32)
    first = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    one, two = (first, first + 1, first + count), (first + 1, first + count + 1, first + count)
    return points, np.concatenate([np.column_stack(one), np.column_stack(two)]).astype(np.int32)


def test_a_process_of_its_own_makes_the_same_mesh(monkeypatch):
    monkeypatch.setattr(simplify, "_FEW_FACES", 1000)
    points, faces = hills(60)
    found, wanted = simplify_mesh(points, faces, 0.7), fast_simplification.simplify(points, faces, 0.7)
    assert all((one == two).all() for one, two in zip(found, wanted, strict=True))
    assert len(found[1]) < 0.35 * len(faces)


def test_a_failed_process_names_the_faces_and_its_error(monkeypatch):
    monkeypatch.setattr(simplify, "_FEW_FACES", 1000)
    points, faces = hills(60)
    with pytest.raises(GeometryError, match=r"simplification of 6962 faces: ValueError: .* be 2 dimensional"):
        simplify_mesh(points.ravel(), faces, 0.7)
