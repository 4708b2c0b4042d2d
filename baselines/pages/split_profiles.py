"""Performance profiles over the mines of a split: in what share of the mines a policy sees more than each level."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

from baselines.explorers import EXPLORERS
from baselines.scoring.split_statistics import INTERVAL, draws, profile, strata_of

matplotlib.use("Agg")
import matplotlib.pyplot as plt

_LEVELS = np.linspace(0.0, 1.0, 201)
_COLOURS = [matplotlib.colormaps["tab20"](number) for number in (*range(0, 20, 2), *range(1, 20, 2))]  # dark ones first


def draw_profiles(shares: dict[str, np.ndarray], path: Path) -> None:
    """Draw the profile of each policy with the 95 % interval of each point; classical explorers are dashed.

    Parameters
    ----------
    shares : dict of str to (mines,)
        Of the bound of each mine, by policy.
    path : Path
        Of the picture.
    """
    figure, axis = plt.subplots(figsize=(9.5, 4.6), layout="constrained")
    for number, (policy, of_mines) in enumerate(shares.items()):
        colour = _COLOURS[number % len(_COLOURS)]
        rows = draws(strata_of(len(of_mines)))
        low, high = np.percentile([profile(of_mines[drawn], _LEVELS) for drawn in rows], INTERVAL, axis=0)
        style = "--" if policy in EXPLORERS else "-"
        axis.plot(100 * _LEVELS, 100 * profile(of_mines, _LEVELS), style, color=colour, lw=1.5, label=policy)
        axis.fill_between(100 * _LEVELS, 100 * low, 100 * high, color=colour, alpha=0.12, lw=0)
    axis.set(xlabel="share of the bound, %", ylabel="mines in which more is seen, %", xlim=(0, 100), ylim=(0, 100))
    figure.legend(frameon=False, fontsize=8, loc="outside right upper")
    figure.savefig(path, dpi=110)
    plt.close(figure)
