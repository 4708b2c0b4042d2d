"""The fit of the network to the expert's labels; this module needs torch."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from baselines.graph.expert import Labels
from baselines.graph.network import Shape
from baselines.graph.settings import FitSettings
from baselines.graph.torch_network import GraphNetwork

_HELD_BACK = 10  # of so many scenes one is not learned from, to measure the fit


def fit(labels: Labels, shape: Shape, settings: FitSettings, seed: int) -> tuple[GraphNetwork, dict[str, float]]:
    """Return a network whose softmax follows that of the cells that each tried cluster brought, and figures of it.

    Figures are of the scenes that were held back: the loss, the cells that the network's choice among the tried
    clusters brought above the nearest tried one, and the same of the best trial, which noise favours.
    """
    torch.manual_seed(seed)
    network = GraphNetwork(shape)
    tokens, apart, real, cells = (torch.from_numpy(np.asarray(a)) for a in _arrays(labels))
    several = (~cells.isnan()).sum(dim=1) > 1
    tokens, apart, real, cells = (a[several] for a in (tokens, apart, real, cells))
    back = torch.arange(len(cells)) % _HELD_BACK == 0
    learned = (~back).nonzero()[:, 0]
    steps = settings.epochs * max(len(learned) // settings.batch, 1)
    optimizer = torch.optim.AdamW(network.parameters(), settings.lr, weight_decay=settings.weight_decay)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, settings.lr, total_steps=steps)
    for _ in range(steps):
        some = learned[torch.randint(len(learned), (settings.batch,))]
        loss = _loss(network, tokens[some], apart[some], real[some], cells[some], settings.temperature_cells)
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        schedule.step()
    with torch.no_grad():
        held = tokens[back], apart[back], real[back]
        scores = network(*held)[0].masked_fill(cells[back].isnan(), -1e9)
        chosen = cells[back].gather(1, scores.argmax(dim=1, keepdim=True))[:, 0]
        first = cells[back][:, 0]
        figures = {
            "scenes": float(len(cells)),
            "loss": float(_loss(network, *held, cells[back], settings.temperature_cells)),
            "chosen_above_nearest": float((chosen - first).nanmean()),
            "best_above_nearest": float((cells[back].nan_to_num(-1).max(dim=1).values - first).nanmean()),
        }
    return network, {name: round(value, 3) for name, value in figures.items()}


def _arrays(labels: Labels) -> tuple[np.ndarray, ...]:
    return labels.tokens, labels.apart_m, labels.real, labels.cells


def _loss(
    network: GraphNetwork, tokens: Tensor, apart: Tensor, real: Tensor, cells: Tensor, temperature: float
) -> Tensor:
    """Return the cross-entropy between the softmax of the scores and that of the cells, over the tried clusters."""
    untried = cells.isnan()
    scores, values = network(tokens, apart, real)
    aim = (cells / temperature).masked_fill(untried, -1e9).softmax(dim=1)
    choice = -(aim * scores.masked_fill(untried, -1e9).log_softmax(dim=1)).sum(dim=1).mean()
    reached = (aim * cells.nan_to_num()).sum(dim=1) / 100.0
    return choice + 0.5 * (values - reached).pow(2).mean()


def arrays_of(network: GraphNetwork) -> dict[str, np.ndarray]:
    """Return the network's weights as plain arrays."""
    return {name: value.detach().numpy().copy() for name, value in network.state_dict().items()}
