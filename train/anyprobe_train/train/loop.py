"""The training loop: one visible loop, one checkpoint that resumes exactly; in one process or in several."""

from __future__ import annotations

import json
import os
import time
import warnings
from collections.abc import Iterable
from contextlib import nullcontext
from copy import deepcopy
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import Any, TypeVar

import torch
import torch.distributed as dist
from torch import nn

from anyprobe.errors import InputError, ModelError
from anyprobe_train.dataset.pair_source import Batch, PairSource
from anyprobe_train.train.checkpoint import (
    agreed,
    load_init_weights,
    load_weights,
    read_checkpoint,
    resumed,
    save_checkpoint,
)
from anyprobe_train.train.config import RunConfig
from anyprobe_train.train.dataloader import load_assets, name_assets, open_batches
from anyprobe_train.train.lift import Learner, Lift, Normals
from anyprobe_train.train.logger import RunLogger, run_folder
from anyprobe_train.train.muon import MuonAndAdam

CHECKPOINT_SECONDS = 120.0
Net = TypeVar("Net", bound=nn.Module)


def learning_rate(config: Any, step: int) -> float:
    """Return the learning rate: linear warm-up, constant, linear cool-down to zero."""
    falling = config.cooldown * config.steps
    return config.learning_rate * min(1.0, (step + 1) / config.warmup, (config.steps - step) / max(falling, 1.0))


LEARNERS: dict[str, type[Learner]] = {"lift": Lift, "normals": Normals}


def make_learner(config: RunConfig, device: str) -> Learner:
    """Build a run's learner: its networks and their losses by name."""
    kind = LEARNERS[config.model]
    return kind(config.lift if kind is Lift else config, device)


def load_nets(checkpoint: Path) -> torch.nn.ModuleDict:
    """Load the trained networks of a checkpoint for inference; ModelError if there are none, or of another release."""
    stored = read_checkpoint(checkpoint)
    model = json.loads(stored["config"]).get("model", "paper")
    if model not in LEARNERS:
        raise ModelError(
            f"expected a run of this release, got one of {model}; use the release that trained it", source=checkpoint
        )
    nets = LEARNERS[model].networks()
    load_weights(nets, stored["nets"], checkpoint)
    return nets.eval().requires_grad_(False)


def pairs_seen(stored: dict) -> int:
    """Return the number of pairs that a checkpoint has learned from."""
    return stored["pairs"] if "pairs" in stored else stored["step"] * json.loads(stored["config"])["pairs"]["batch"]


def train(
    config: RunConfig,
    *,
    data: Path | None,
    runs: Path,
    device: str = "cpu",
    compiled: bool = True,
    workers: int = 0,
    stop_after: int | None = None,
    pairs: PairSource | None = None,
    start: Path | None = None,
) -> Path:
    """Train a run's networks to config.steps, resuming from its checkpoint if there is one.

    Started by torchrun, its processes train together (ProcessGroup).

    Args:
        data: folder with hdri/train and meshes/train; None trains on procedural assets.
        runs: the checkpoint, log.csv, pictures and TensorBoard events go to runs/<config.name>.
        workers: processes that draw shapes and make pairs ahead of this one; each has lit materials of its own,
            so that a run resumes exactly with as many as it started with. 0: this process makes its pairs.
        stop_after: stop (with a checkpoint) once this many steps are done in all.
        pairs: a source of batches to use in place of one over data.
        start: weights to start from, of train.checkpoint; a resumed run may name those that it started from.
    Returns:
        The checkpoint's path.
    Raises:
        InputError: a device that is not there, or a checkpoint of another run (train.checkpoint).
        ModelError: a damaged checkpoint, or weights of another network.
    """
    warnings.filterwarnings("ignore", message="Dynamo detected a call to a `functools.lru_cache`")
    processes = ProcessGroup(device)
    device = processes.device
    torch.manual_seed(config.seed)
    path = runs / config.name / "checkpoint.pt"
    if workers > 0:
        config = replace(config, pairs=replace(config.pairs, lanes=workers * processes.size))
    learner = make_learner(config, device)
    nets = learner.nets
    optimizer = torch.optim.AdamW(
        [p for p in nets.parameters() if p.requires_grad],
        lr=config.learning_rate,
        betas=(0.9, 0.999),
        weight_decay=config.weight_decay,
    )
    first = num_pairs = 0
    stored, origin = resumed(path, config, {"processes": processes.size}, start, device)
    if stored is not None:
        load_weights(nets, stored["nets"], path)
        optimizer.load_state_dict(stored["optimizer"])
        first, num_pairs = stored["step"], pairs_seen(stored)
    elif start is not None:
        load_init_weights(nets, start)
    folder = run_folder(runs, config.name)
    last = config.steps if stop_after is None else min(stop_after, config.steps)
    if first >= last:
        return path
    steps = range(first * processes.size + processes.rank, last * processes.size + processes.rank, processes.size)
    batches: Iterable[Batch]
    if pairs is not None:
        batches = (pairs.batch(step).to(device) for step in steps)  # of several GPUs each has its own
    else:
        store = load_assets(config.light, data)
        origin = agreed(path, origin, {"assets": name_assets(store)})
        batches = open_batches(config, store, data, runs / "cache", device, compiled, steps, workers)
        del store  # hundreds of maps, of which the batches keep what they need
    logger = RunLogger(folder, config.name, learner.columns, first, last, config.steps, learner)
    saved, pairs_per_step = time.monotonic(), config.pairs.batch * processes.size
    with logger if processes.is_first else nullcontext():
        for step, batch in enumerate(batches, start=first):
            rate = learning_rate(config, step)
            for group in optimizer.param_groups:
                group["lr"] = rate
            losses = learner.losses(batch, step / config.steps)
            optimizer.zero_grad(set_to_none=True)
            reduce(torch.add, losses.values()).backward()
            due = processes.average_gradients(nets.parameters(), time.monotonic() - saved > CHECKPOINT_SECONDS)
            for net in nets.values():
                torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
            optimizer.step()
            num_pairs += pairs_per_step
            if processes.is_first:
                logger.see(batch)
                logger.note(step + 1, num_pairs, pairs_per_step, losses, rate)
            if due or step + 1 == last:
                processes.average_statistics(nets)
                if processes.is_first:
                    state = {"nets": nets.state_dict(), "optimizer": optimizer.state_dict(), "pairs": num_pairs}
                    save_checkpoint(path, config, step + 1, origin, state)
                    logger.draw(step + 1)
                saved = time.monotonic()
    processes.leave()
    return path


BACKENDS = {"cpu": "gloo", "cuda": "nccl"}
"""Backend that carries tensors between processes, by kind of device."""


class ProcessGroup:
    """Group of processes that see different pairs and keep the same weights.

    Every process makes step number * size + rank of the pairs; gradients are averaged, so that two processes learn as
    one with twice the batch would (but for batch normalisation, which sees each process's pairs alone).
    """

    def __init__(self, kind: str = "cpu") -> None:
        """Join the group that torchrun's RANK and WORLD_SIZE describe; without them, a group of one.

        kind: of the device that every process trains on, "cpu" or "cuda"; `device` is this process's own.
        Raises:
            InputError: another kind, or one that this machine does not have.
        """
        if kind not in BACKENDS:
            raise InputError(
                f"expected one of {', '.join(BACKENDS)}, got another; use cpu", subject="device", source=kind
            )
        if kind == "cuda" and not torch.cuda.is_available():
            raise InputError("no GPU that torch can use; use cpu", subject="device", source="cuda")
        self.rank, self.size = int(os.environ.get("RANK", 0)), int(os.environ.get("WORLD_SIZE", 1))
        own = kind == "cuda" and self.size > 1
        self.device = f"cuda:{os.environ.get('LOCAL_RANK', '0')}" if own else kind
        if self.size > 1 and not dist.is_initialized():
            dist.init_process_group(BACKENDS[kind])

    @property
    def is_first(self) -> bool:
        """Whether this process logs and saves."""
        return self.rank == 0

    def average_gradients(self, parameters: Iterable[nn.Parameter], ask: bool = False) -> bool:
        """Replace every gradient by the group's mean; return what the first process asked."""
        if self.size == 1:
            return ask
        gradients = [p.grad for p in parameters if p.grad is not None]
        asked = gradients[0].new_tensor([float(ask and self.is_first)])
        self._average([*gradients, asked])
        return bool(asked > 0)

    def average_statistics(self, nets: nn.Module) -> None:
        """Average the statistics of batch normalisation; their mean is what one process would keep."""
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
        """Leave the group at the end."""
        if self.size > 1:
            dist.destroy_process_group()


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
