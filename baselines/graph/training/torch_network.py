"""The network in torch, for training: the same arrays by the same names as `baselines.graph.network` takes."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from baselines.graph.features import NAMES
from baselines.graph.network import APART_M, FARTHEST, Shape, unused


class _Block(nn.Module):
    def __init__(self, shape: Shape) -> None:
        super().__init__()
        w = shape.width
        self.heads, self.attention = shape.heads, shape.attention
        if shape.attention:
            self.mix_norm, self.mix, self.merge = nn.LayerNorm(w), nn.Linear(w, 3 * w), nn.Linear(w, w)
            self.near = nn.Parameter(torch.linspace(0.0, 2.0, shape.heads))
        self.norm, self.first, self.second = nn.LayerNorm(w), nn.Linear(w, 2 * w), nn.Linear(2 * w, w)

    def forward(self, x: Tensor, apart: Tensor, real: Tensor) -> Tensor:
        if self.attention:
            n, k, w = x.shape
            q, key, v = self.mix(self.mix_norm(x)).view(n, k, 3, self.heads, w // self.heads).permute(2, 0, 3, 1, 4)
            weights = q @ key.transpose(2, 3) / (w // self.heads) ** 0.5 - self.near[:, None, None] * apart[:, None]
            weights = weights.masked_fill(~real[:, None, None, :], -1e9).softmax(dim=3)
            x = x + self.merge((weights @ v).transpose(1, 2).reshape(n, k, w))
        return x + self.second(self.first(self.norm(x)).relu())


class GraphNetwork(nn.Module):
    """Scores the clusters of scenes, and says what the best of them is worth."""

    def __init__(self, shape: Shape) -> None:
        """Make a network with random weights."""
        super().__init__()
        self.shape = shape
        self.enter, self.score = nn.Linear(len(NAMES), shape.width), nn.Linear(shape.width, 2)
        self.blocks = nn.ModuleList(_Block(shape) for _ in range(shape.blocks))

    def forward(self, tokens: Tensor, apart_m: Tensor, real: Tensor) -> tuple[Tensor, Tensor]:
        """Return scores (n, k), and values (n,), of scenes.

        Parameters
        ----------
        tokens : (n, k, features)
        apart_m : (n, k, k)
        real : (n, k) bool
            Scenes with fewer clusters are filled up; what is filled in scores -1e9.
        """
        tokens = tokens.clone()
        for part in unused(self.shape):
            tokens[..., part] = 0.0
        x, apart = self.enter(tokens), (apart_m / APART_M).clamp(max=FARTHEST)
        for block in self.blocks:
            x = block(x, apart, real)
        out = self.score(x)
        value = (out[..., 1] * real).sum(dim=1) / real.sum(dim=1)
        return out[..., 0].masked_fill(~real, -1e9), value
