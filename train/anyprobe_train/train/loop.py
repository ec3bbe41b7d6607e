"""Parts of every run's loop: its learning rate, the running mean of its weights, and how it is stopped."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import nn

from anyprobe_train.train.checkpoint import load_weights
from anyprobe_train.train.muon import MuonAndAdam

CHECKPOINT_SECONDS = 120.0
Net = TypeVar("Net", bound=nn.Module)


@contextmanager
def asked_to_stop() -> Iterator[Callable[[], bool]]:
    """Say whether the process was asked to end (SIGTERM, SIGINT), which then waits for a checkpoint."""
    asked = []
    old = {
        kind: signal.signal(kind, lambda number, _: asked.append(number)) for kind in (signal.SIGTERM, signal.SIGINT)
    }
    try:
        yield lambda: bool(asked)
    finally:
        for kind, handler in old.items():
            signal.signal(kind, handler)


def learning_rate(config: Any, step: int) -> float:
    """Return the learning rate: linear warm-up, constant, linear cool-down to zero."""
    falling = config.cooldown * config.steps
    return config.learning_rate * min(1.0, (step + 1) / config.warmup, (config.steps - step) / max(falling, 1.0))


def mean_of(
    net: Net, optimizer: torch.optim.Optimizer | MuonAndAdam, stored: dict[str, Any] | None, path: Path
) -> tuple[Net, int]:
    """Return the running mean of a network's weights and the number of steps done; all as the checkpoint at path has
    them, if it is not None."""
    mean = deepcopy(net)
    if stored is None:
        return mean, 0
    load_weights(mean, stored["net"], path)
    load_weights(net, stored["moving"], path)
    optimizer.load_state_dict(stored["optimizer"])
    return mean, stored["step"]


@torch.no_grad()
def move_mean(mean: torch.nn.Module, net: torch.nn.Module, decay: float) -> None:
    """Move the running mean of the weights, and of the statistics, towards those of now."""
    kept, new = list(mean.state_dict().values()), list(net.state_dict().values())
    floating = [k for k, one in enumerate(kept) if one.is_floating_point()]
    torch._foreach_lerp_([kept[k] for k in floating], [new[k] for k in floating], 1.0 - decay)
    for k in set(range(len(kept))) - set(floating):
        kept[k].copy_(new[k])
