"""The rule that training begins with: drive to fresh ground nearby, straight ahead."""

from __future__ import annotations

import numpy as np

from baselines.graph.features import NAMES

# Metres of way that each is worth. Found by trying seventeen such rules in six training mines, four robots each: the
# nearest cluster saw 50.0 % of the cells, this rule 55.4 %, `frontier-tour` 48.0 %.
_WORTH_M = {"unknown": 25.0, "unknown_beyond": 15.0, "unknown_beyond_14_m": 15.0, "present": 5.0}
_TURN_M = 2.0  # a radian of turning
_STILL_M, _STILL = -30.0, 0.5  # the present goal, once the robot has stood still for 5 s


def fresh_ground(tokens: np.ndarray) -> np.ndarray:
    """Return what each cluster of a scene is worth, m of way (k,): unknown ground less the way to it.

    Parameters
    ----------
    tokens : (k, len(NAMES))
    """
    told = dict(zip(NAMES, tokens.T, strict=True))
    turn = np.arctan2(told["first_turn_sin"], told["first_turn_cos"])
    worth = -20.0 * told["path"] - _TURN_M * turn + sum(worth * told[name] for name, worth in _WORTH_M.items())
    return worth + _STILL_M * told["present"] * (told["still"] >= _STILL)
