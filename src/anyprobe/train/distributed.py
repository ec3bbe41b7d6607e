"""The processes that train one run together, started by torchrun; usually just one."""

from __future__ import annotations

import os
from collections.abc import Iterable

import torch
import torch.distributed as dist
from torch import nn

from anyprobe.errors import InputError

BACKENDS = {"cpu": "gloo", "cuda": "nccl"}
"""What carries the tensors of each kind of device between processes."""


class ProcessGroup:
    """Processes that see different pairs and keep the same weights.

    Every process makes step number * size + rank of the pairs; gradients are averaged, so that
    two processes learn as one with twice the batch would (but for batch normalisation, which
    sees each process's pairs alone).
    """

    def __init__(self, kind: str = "cpu") -> None:
        """As torchrun's RANK and WORLD_SIZE say; a team of one without them.

        kind: of the device that every process trains on, "cpu" or "cuda"; `device` is this process's own.
        Raises:
            InputError: another kind, or one that this machine does not have.
        """
        if kind not in BACKENDS:
            raise InputError(f"--device {kind}: expected one of {', '.join(BACKENDS)}, got another; take cpu")
        if kind == "cuda" and not torch.cuda.is_available():
            raise InputError("--device cuda: expected a GPU that torch can use, found none; take cpu")
        self.rank, self.size = (int(os.environ.get(name, default)) for name, default in SINGLE.items())
        own = kind == "cuda" and self.size > 1
        self.device = f"cuda:{os.environ.get('LOCAL_RANK', '0')}" if own else kind
        if self.size > 1 and not dist.is_initialized():
            dist.init_process_group(BACKENDS[kind])

    @property
    def is_first(self) -> bool:
        """The one that logs and saves."""
        return self.rank == 0

    def average_gradients(self, parameters: Iterable[nn.Parameter], ask: bool = False) -> bool:
        """Replace every gradient by the team's mean; returns what the first process asked."""
        if self.size == 1:
            return ask
        gradients = [p.grad for p in parameters if p.grad is not None]
        asked = gradients[0].new_tensor([float(ask and self.is_first)])
        self._average([*gradients, asked])
        return bool(asked > 0)

    def average_statistics(self, nets: nn.Module) -> None:
        """The same for what batch normalisation has seen; its mean is what one process of all would keep."""
        if self.size > 1:
            self._average([buffer for buffer in nets.buffers() if buffer.is_floating_point()])

    def _average(self, tensors: list[torch.Tensor]) -> None:
        flat = torch.cat([tensor.reshape(-1) for tensor in tensors])
        dist.all_reduce(flat)
        flat /= self.size
        parts = flat.split([tensor.numel() for tensor in tensors])
        for tensor, part in zip(tensors, parts, strict=True):
            tensor.copy_(part.view_as(tensor))

    def leave(self) -> None:
        """Once all is done."""
        if self.size > 1:
            dist.destroy_process_group()


SINGLE = {"RANK": "0", "WORLD_SIZE": "1"}
