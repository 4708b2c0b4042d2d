"""Rules by which simulated and real robots choose a cluster; the learned one is used by both."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from baselines.explorers.graph_explorer import Situation
from baselines.graph.features import Context, describe
from baselines.graph.network import Shape, scores

Rule = Callable[[Situation, Context], int]  # returns the index of a cluster of the situation

COMMIT_S = 5.0  # for which a goal is kept while its cluster is unseen and the robot moves
_STILL_S, _STILL_M = 4.0, 30.0  # a goal that a robot stands still before for so long counts as so much farther away


def keeps_goal(situation: Situation, context: Context, commit_s: float = COMMIT_S) -> bool:
    """Return whether the present goal is kept without a decision."""
    return situation.present >= 0 and context.held_s < commit_s and context.still_s < COMMIT_S


def choose_nearest(situation: Situation, context: Context) -> int:
    """Return the nearest cluster; one that the robot does not get nearer to counts as farther away."""
    costs = situation.costs.copy()
    if situation.present >= 0 and context.still_s > _STILL_S:
        costs[situation.present] += _STILL_M
    return int(costs.argmin())


class LearnedChoice:
    """The cluster that a network scores highest; with `rng`, one drawn by the softmax of the scores."""

    def __init__(self, arrays: dict[str, np.ndarray], shape: Shape, rng: np.random.Generator | None = None) -> None:
        """Take a network's arrays."""
        self._arrays, self._shape, self._rng = arrays, shape, rng

    def __call__(self, situation: Situation, context: Context) -> int:
        """Return the index of a cluster of the situation."""
        if keeps_goal(situation, context):
            return situation.present
        scene = describe(situation, context)
        found = scores(self._arrays, self._shape, scene.tokens, scene.apart_m)
        if self._rng is not None:
            found = found + self._rng.gumbel(size=len(found))
        return int(scene.clusters[found.argmax()])
