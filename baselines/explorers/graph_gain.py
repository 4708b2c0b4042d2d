"""Drives to where most is unseen, on a graph."""

from __future__ import annotations

import numpy as np

from baselines.explorers.frontier import _GAIN_DECAY_PER_M, _unseen_in_view
from baselines.explorers.graph_explorer import GraphExplorer, Situation


class GraphInformationGain(GraphExplorer):
    """Drives to the cluster with the most unseen cells in view, discounted by distance, as `InformationGain` does."""

    def choose(self, situation: Situation) -> int:
        """Return the index of the cluster with the greatest gain * exp(-path / 20 m)."""
        graph, gains = situation.graph, []
        for (col, row, *_), own in zip(graph.cells[situation.goals].tolist(), graph.maps(situation.goals), strict=True):
            gains.append(_unseen_in_view(own, np.array([row, col]) - own.low[::-1], self._task.range_m[1]))
        return int((np.array(gains) * np.exp(-_GAIN_DECAY_PER_M * situation.costs)).argmax())
