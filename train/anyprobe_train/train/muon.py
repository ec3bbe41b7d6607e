"""Muon (Jordan et al. 2024) for the matrices of weights inside a network, AdamW for all else, as one optimizer."""

from typing import Any

import torch
from torch import nn

MOMENTUM = 0.95
NEWTON_SCHULZ, ROUNDS = (3.4445, -4.7750, 2.0315), 5
"""Coefficients of Muon's iteration, each of which brings singular values nearer to 1, and how often it is done."""
OF_ADAMW = 0.2
"""Root mean square of AdamW's steps over its learning rate, which Muon's steps get."""


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
        self._weights = list(inner.values())
        self._means = [torch.zeros_like(weights) for weights in self._weights]
        others = [p for n, p in net.named_parameters() if n not in inner]
        self._adam = torch.optim.AdamW(others, learning_rate, weight_decay=weight_decay, fused=True)
        self._net = net
        self._rate, self._matrix_rate, self._decay = learning_rate, matrix_rate, weight_decay

    def zero_grad(self) -> None:
        """Forget all gradients."""
        self._net.zero_grad(set_to_none=True)

    @torch.no_grad()
    def step(self, share: float) -> None:
        """Move all weights that have a gradient, by a share of the learning rates."""
        rate = share * self._matrix_rate
        for weights, mean in zip(self._weights, self._means, strict=True):
            if weights.grad is None:
                continue
            mean.lerp_(weights.grad, 1 - MOMENTUM)
            way = orthogonal(_matrix(weights.grad.lerp(mean, MOMENTUM)))
            moved = _matrix(weights.detach())  # the same memory
            moved.mul_(1 - rate * self._decay).sub_(way, alpha=rate * OF_ADAMW * max(moved.shape) ** 0.5)
        for group in self._adam.param_groups:
            group["lr"] = share * self._rate
        self._adam.step()

    def state_dict(self) -> dict[str, Any]:
        """Return the state of both."""
        return {"means": self._means, "adam": self._adam.state_dict()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        for mean, stored in zip(self._means, state["means"], strict=True):
            mean.copy_(stored)
        self._adam.load_state_dict(state["adam"])


def orthogonal(matrix: torch.Tensor) -> torch.Tensor:
    """Return about U V^T of a matrix U S V^T: singular values between .7 and 1.2.

    Muon's iteration X' = (a + b A + c A A) X with A = X X^T, carried out on A alone, the smaller of both sides.
    """
    wide = matrix if matrix.shape[0] <= matrix.shape[1] else matrix.T
    wide = wide / wide.norm().clamp(min=1e-7)
    a, b, c = NEWTON_SCHULZ
    gram = wide @ wide.T
    factor = None
    for k in range(ROUNDS):
        one = torch.addmm(gram, gram, gram, beta=b, alpha=c)
        one.diagonal().add_(a)
        factor = one if factor is None else one @ factor
        if k < ROUNDS - 1:
            gram = one @ gram @ one
    wide = factor @ wide
    return wide if matrix.shape[0] <= matrix.shape[1] else wide.T


def _matrix(weights: torch.Tensor) -> torch.Tensor:
    """Return weights [outputs, ...] as a matrix; kernels [outputs, inputs, H, W] lie channels last."""
    return (weights.permute(0, 2, 3, 1) if weights.dim() == 4 else weights).flatten(1)
