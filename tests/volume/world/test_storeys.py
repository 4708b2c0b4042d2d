"""Storeys by array code against a queue that takes one span at a time."""

from collections import deque

import numpy as np
import pytest

from pipeline.volume.world.cells import storeys_of


def by_queue(column, row, usable, pairs):
    """Return storeys as a queue finds them, span by span."""
    key = [*zip(column.tolist(), row.tolist(), strict=True)]
    beside = [[] for _ in usable]
    for one, other in pairs.tolist():
        if usable[one] and usable[other]:
            beside[one].append(other)
            beside[other].append(one)
    storey, count = np.full(len(usable), -1), 0
    for start in np.flatnonzero(usable).tolist():
        if storey[start] >= 0:
            continue
        taken, queue = {key[start]}, deque([start])
        storey[start] = count
        while queue:
            for other in beside[queue.popleft()]:
                if storey[other] < 0 and key[other] not in taken:
                    taken.add(key[other])
                    storey[other] = count
                    queue.append(other)
        count += 1
    sizes = np.bincount(storey[usable], minlength=count)
    rank = np.empty(count, int)
    rank[np.argsort(-sizes, kind="stable")] = np.arange(count)
    return np.array([rank[number] if number >= 0 else -1 for number in storey.tolist()])


def layers(rng, side, deep, share):
    """Return spans in columns of a square, up to `deep` over each other, and pairs of some that are side by side."""
    column, row, layer = np.indices((side, side, deep)).reshape(3, -1)
    kept = rng.random(len(column)) < 0.8
    column, row, layer = column[kept], row[kept], layer[kept]
    near = np.abs(column[:, None] - column) + np.abs(row[:, None] - row) == 1
    near &= np.abs(layer[:, None] - layer) <= 1
    pairs = np.argwhere(np.triu(near))
    pairs = pairs[rng.random(len(pairs)) < share]
    return column, row, rng.random(len(column)) < 0.9, rng.permutation(pairs)


@pytest.mark.parametrize("seed", range(40))
def test_storeys_are_those_of_a_queue_where_floors_pass_over_themselves(seed):
    rng = np.random.default_rng(seed)
    column, row, usable, pairs = layers(rng, 12, int(rng.integers(1, 5)), rng.uniform(0.2, 1))
    found = storeys_of(column, row, usable, pairs)
    assert found.tolist() == by_queue(column, row, usable, pairs).tolist()
    assert found.max() > 0


def test_a_helix_of_three_turns_is_cut_where_it_would_lie_over_itself():
    turn = np.array([(x, 0) for x in range(6)] + [(5, y) for y in range(1, 6)])
    ring = np.concatenate([turn[:-1], (np.array([5, 5]) - turn)[:-1]])
    column, row = np.tile(ring, (3, 1)).T
    pairs = np.column_stack([np.arange(len(column) - 1), np.arange(1, len(column))])
    found = storeys_of(column, row, np.ones(len(column), bool), pairs)
    assert np.bincount(found).tolist() == [20, 20, 20]
    assert found.tolist() == by_queue(column, row, np.ones(len(column), bool), pairs).tolist()


def test_no_usable_span_has_a_storey():
    none = np.zeros(3, int)
    assert storeys_of(none, none, np.zeros(3, bool), np.zeros((0, 2), int)).tolist() == [-1] * 3
