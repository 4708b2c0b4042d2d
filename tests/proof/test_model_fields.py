"""Every field of MuJoCo's model is compared, and every field of a level world's files is made again or is a claim."""

from typing import Any

import numpy as np
import pytest

from benchmarks.faults.judge import CAUGHT, CLAIM, judge_fields
from minexplore.bundle import MODEL
from pipeline.mjcf.loading import load_model
from pipeline.proof.rebuilt.same_model import model_difference

# A checksum, where files lie, and the trees that speed up collisions, which follow from the rest.
NOT_COMPARED = {
    "signature",
    "paths",
    "npaths",
    "nbuffer",
    "hfield_pathadr",
    "mesh_pathadr",
    "skin_pathadr",
    "tex_pathadr",
}
NOT_COMPARED |= {"body_bvhadr", "body_bvhnum", "flex_bvhadr", "flex_bvhnum", "mesh_bvhadr", "mesh_bvhnum"}
NOT_COMPARED |= {"bvh_aabb", "bvh_child", "bvh_depth", "bvh_nodeid", "nbvh", "nbvhdynamic", "nbvhstatic"}


class Other:
    """A record of which one field differs, that of a path."""

    def __init__(self, own: Any, path: str) -> None:
        self._own, (self._name, _, self._rest) = own, path.partition(".")

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._own, name)
        if name != self._name:
            return value
        return Other(value, self._rest) if self._rest else other(value)


class Only:
    """A model of which only the field of a path is listed: the comparison of all takes seconds."""

    def __init__(self, own: Any, path: str) -> None:
        self._own, self._name = own, path.partition(".")[0]

    def __dir__(self) -> list[str]:
        return [self._name]

    def __getattr__(self, name: str) -> Any:
        return getattr(self._own, name)


def other(value: Any) -> Any:
    """Return another value of the same kind."""
    if isinstance(value, np.ndarray):
        if not value.size:
            return np.zeros((1, *value.shape[1:]), value.dtype)
        changed = value.copy()
        changed.flat[value.size // 2] = not changed.flat[value.size // 2] if value.dtype.kind == "b" else 7
        if np.array_equal(changed, value):
            changed.flat[value.size // 2] = 8
        return changed
    if isinstance(value, str):
        return f"{value}x"
    return value + (b"x" if isinstance(value, bytes) else 1)


def fields_of(record: Any, above: str = "") -> list[str]:
    """Return the path of each field of a model, and of the records in it."""
    found = []
    for name in (name for name in dir(record) if not name.startswith("_")):
        value = getattr(record, name)
        if callable(value):
            continue
        plain = isinstance(value, np.ndarray | int | float | str | bytes)
        found += [f"{above}{name}"] if plain else fields_of(value, f"{above}{name}.")
    return found


@pytest.fixture(scope="module")
def model(small_world):
    return load_model(small_world / MODEL)


def test_every_field_of_the_model_is_compared_but_those_that_follow_from_others(model):
    """A field that a later MuJoCo adds is compared, or fails this until somebody decides."""
    fields = fields_of(model)
    assert len(fields) > 500
    unseen = {path for path in fields if model_difference(Other(model, path), Only(model, path)) is None}
    assert unseen == NOT_COMPARED & set(fields)


def test_one_change_of_ninety_of_a_level_world_is_refused_or_a_claim(small_world):
    judged = list(judge_fields(small_world, every=90))
    assert len(judged) > 4
    assert not [verdict for verdict in judged if verdict[1] not in (CAUGHT, CLAIM)]


@pytest.mark.slow
def test_every_change_of_a_level_world_is_refused_or_a_claim(small_world):
    judged = list(judge_fields(small_world))
    assert not [verdict for verdict in judged if verdict[1] not in (CAUGHT, CLAIM)]
    assert sum(outcome == CAUGHT for _, outcome, _ in judged) > 400
