"""The training loop: one visible loop, one checkpoint that resumes exactly."""

from __future__ import annotations

import dataclasses
import json
import time
import warnings
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import torch

from anyprobe.dataset.pairs import PairSource
from anyprobe.errors import ModelError
from anyprobe.files.atomic import atomic_path
from anyprobe.train.chain import Chain
from anyprobe.train.config import RunConfig
from anyprobe.train.designs import IMAGE, IMAGE_RATE, Designs
from anyprobe.train.journal import Journal, run_folder
from anyprobe.train.lift import Lift, LiftConfig
from anyprobe.train.normals import Normals
from anyprobe.train.start import load_start
from anyprobe.train.supply import open_batches
from anyprobe.train.team import Team
from anyprobe.train.tiny_designs import TinyDesigns

CHECKPOINT_SECONDS = 120.0


def learning_rate(config: RunConfig, step: int) -> float:
    """Linear warm-up, constant, linear cool-down to zero."""
    falling = config.cooldown * config.steps
    return config.learning_rate * min(
        1.0, (step + 1) / config.warmup, (config.steps - step) / max(falling, 1.0)
    )


def parameter_groups(nets: torch.nn.ModuleDict) -> list[dict]:
    """For the optimizer: all networks in one group, but for one that learns slower, by "share" of the rate."""
    groups: list[dict] = [
        {"params": [p for name, net in nets.items() if name != IMAGE for p in net.parameters()]}
    ]
    if IMAGE in nets:
        groups.append({"params": list(nets[IMAGE].parameters()), "share": IMAGE_RATE})
    return groups


LEARNERS = {
    "paper": Chain,
    "lift": Lift,
    "normals": Normals,
    "designs": Designs,
    "tiny_designs": TinyDesigns,
}


def make_learner(config: RunConfig, device: str) -> Chain | Lift | Normals | Designs | TinyDesigns:
    """What trains: networks, and their losses by name."""
    return LEARNERS[config.model](config.lift if config.model == "lift" else config, device)


def load_nets(checkpoint: Path) -> torch.nn.ModuleDict:
    """The trained networks of a checkpoint, ready to run; ModelError if there is none."""
    if not checkpoint.is_file():
        raise ModelError(f"{checkpoint}: expected a run's checkpoint, found none; train first")
    stored = torch.load(checkpoint, map_location="cpu", weights_only=True)
    config = json.loads(stored["config"])
    model = config.get("model", "paper")
    if model == "lift":
        nets = Lift.networks(LiftConfig(**config["lift"]))
    elif model == "designs":
        nets = Designs.networks(config.get("irradiance_learns", False))
    else:
        nets = LEARNERS[model].networks()
    nets.load_state_dict(stored["nets"])
    return nets.eval().requires_grad_(False)


def pairs_seen(stored: dict) -> int:
    """How many pairs a checkpoint has learned from."""
    return stored.get("pairs", stored["step"] * json.loads(stored["config"])["pairs"]["batch"])


def save_checkpoint(
    path: Path,
    nets: torch.nn.ModuleDict,
    config: RunConfig,
    optimizer: torch.optim.Optimizer,
    step: int,
    pairs: int,
) -> None:
    """Everything that the next step depends on; pairs depend on the step's number alone."""
    with atomic_path(path) as temporary:
        torch.save(
            {
                "nets": nets.state_dict(),
                "optimizer": optimizer.state_dict(),
                "step": step,
                "pairs": pairs,
                "config": json.dumps(dataclasses.asdict(config)),
            },
            temporary,
        )


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
    """Train a run's networks to config.steps, going on from its checkpoint when there is one.

    Started by torchrun, its processes train together (train.team).

    Args:
        data: folder with hdri/train and meshes/train; None trains on procedural assets.
        runs: the checkpoint, log.csv and TensorBoard events go to runs/<config.name>.
        workers: processes that draw shapes and make pairs ahead of this one; each has lit materials of its own,
            so that a run goes on exactly with as many as it began with. 0: this process makes its pairs.
        stop_after: stop (with a checkpoint) once this many steps are done in all.
        pairs: the batches, when they are at hand already.
        start: weights to begin from, of train.start, where there is no checkpoint yet.
    Returns:
        The checkpoint's path.
    """
    warnings.filterwarnings("ignore", message="Dynamo detected a call to a `functools.lru_cache`")
    torch.manual_seed(config.seed)
    team = Team()
    device = team.device(device)
    folder = run_folder(runs, config.name)
    path = folder / "checkpoint.pt"
    if workers > 0:
        config = replace(config, pairs=replace(config.pairs, lanes=workers * team.size))
    learner = make_learner(config, device)
    nets = learner.nets
    optimizer = torch.optim.AdamW(
        parameter_groups(nets), lr=config.learning_rate, betas=(0.9, 0.999), weight_decay=config.weight_decay
    )
    first = seen = 0
    if path.is_file():
        stored = torch.load(path, map_location=device, weights_only=True)
        if "optimizer" not in stored:
            raise ModelError(
                f"{path}: expected a run's checkpoint, got weights that were kept to be scored; train in another "
                "folder with --start"
            )
        nets.load_state_dict(stored["nets"])
        optimizer.load_state_dict(stored["optimizer"])
        first, seen = stored["step"], pairs_seen(stored)
    elif start is not None:
        load_start(nets, start)
    last = config.steps if stop_after is None else min(stop_after, config.steps)
    if first >= last:
        return path
    steps = range(first * team.size + team.rank, last * team.size + team.rank, team.size)
    if pairs is not None:
        batches = map(pairs.batch, steps)
    else:
        batches = open_batches(config, data, runs / "cache", device, compiled, steps, workers)
    journal = Journal(folder, config.name, learner.columns, first, last, config.steps)
    saved, each = time.monotonic(), config.pairs.batch * team.size
    with journal if team.is_first else nullcontext():
        for step, batch in enumerate(batches, start=first):
            rate = learning_rate(config, step)
            for group in optimizer.param_groups:
                group["lr"] = rate * group.get("share", 1.0)
            losses = learner.losses(batch, step / config.steps)
            optimizer.zero_grad(set_to_none=True)
            sum(losses.values()).backward()
            due = team.average_gradients(nets.parameters(), time.monotonic() - saved > CHECKPOINT_SECONDS)
            for net in nets.values():
                torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
            optimizer.step()
            seen += each
            if team.is_first:
                journal.note(step + 1, seen, each, losses, rate)
            if due or step + 1 == last:
                team.average_statistics(nets)
                if team.is_first:
                    save_checkpoint(path, nets, config, optimizer, step + 1, seen)
                saved = time.monotonic()
    team.leave()
    return path
