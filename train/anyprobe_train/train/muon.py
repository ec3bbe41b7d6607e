"""Muon (Jordan et al. 2024) for the matrices of weights inside a network, AdamW for all else, as one optimizer."""

from __future__ import annotations

from typing import Any

import torch
from torch import nn


class MuonAndAdam:
    """One optimizer of both kinds.

    Muon steps along the nearest orthogonal matrix of the mean gradient, so that all directions of a layer's weights
    are learned alike; kernels count as matrices, one row for each output.
    """

    def __init__(
        self, net: nn.Module, learning_rate: float, matrix_rate: float, weight_decay: float, last: tuple[str, ...]
    ) -> None:
        """Take a network's parameters.

        Args:
            matrix_rate: learning rate of matrices; the size of their steps is that of AdamW's.
            last: names of the layers that say the answer, whose matrices AdamW learns.
        """
        inner = {n: p for n, p in net.named_parameters() if p.dim() > 1 and not n.startswith(last)}
        self._matrices = [(weights, nn.Parameter(_matrix(weights.detach()))) for weights in inner.values()]
        others = [p for n, p in net.named_parameters() if n not in inner]
        self._muon = torch.optim.Muon(
            [matrix for _, matrix in self._matrices],
            matrix_rate,
            weight_decay=weight_decay,
            adjust_lr_fn="match_rms_adamw",
        )
        self._adam = torch.optim.AdamW(others, learning_rate, weight_decay=weight_decay, fused=True)
        self._net = net
        self._rates = {self._muon: matrix_rate, self._adam: learning_rate}

    def zero_grad(self) -> None:
        """Forget all gradients."""
        self._net.zero_grad(set_to_none=True)

    def step(self, share: float) -> None:
        """Move all weights that have a gradient, by a share of the learning rates."""
        for weights, matrix in self._matrices:
            matrix.grad = None if weights.grad is None else _matrix(weights.grad)
        for optimizer, rate in self._rates.items():
            for group in optimizer.param_groups:
                group["lr"] = share * rate
            optimizer.step()

    def state_dict(self) -> dict[str, Any]:
        """Return the state of both."""
        return {"muon": self._muon.state_dict(), "adam": self._adam.state_dict()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        self._muon.load_state_dict(state["muon"])
        self._adam.load_state_dict(state["adam"])


def _matrix(weights: torch.Tensor) -> torch.Tensor:
    """Return weights [outputs, ...] as a matrix; kernels [outputs, inputs, H, W] lie channels last."""
    return (weights.permute(0, 2, 3, 1) if weights.dim() == 4 else weights).flatten(1)
