"""The training loop: one visible loop, one checkpoint that resumes exactly."""

from __future__ import annotations

import csv
import dataclasses
import json
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import torch
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from anyprobe.dataset.lighting import Illuminator
from anyprobe.dataset.pairs import PairSource
from anyprobe.dataset.stock import load_stock, own_map
from anyprobe.dataset.surfaces import build_surfaces
from anyprobe.dataset.variants import draw_variant
from anyprobe.errors import ModelError
from anyprobe.files.atomic import atomic_path
from anyprobe.train.chain import Chain
from anyprobe.train.config import RunConfig
from anyprobe.train.lift import Lift

CHECKPOINT_SECONDS = 120.0
LOG_STEPS = 25


def make_pairs(
    config: RunConfig, data: Path | None, cache: Path, device: str, compiled: bool = True
) -> PairSource:
    """The endless pairs of a run: real assets of data/{hdri,meshes} when given, and our own.

    Files that cannot be used are listed on stderr.
    """

    def warn(line: str) -> None:
        print(f"warning: {line}", file=sys.stderr)

    light = config.light
    stock = load_stock(data, "train", commercial_only=light.commercial_only, report=warn)
    radiance = [asset.radiance for asset in stock.maps.values()] if light.real else []
    radiance += [own_map(light.seed, index).radiance for index in range(light.procedural)]
    rng = np.random.default_rng(light.seed)
    radiance += [draw_variant(rng, radiance) for _ in range(light.variants)]
    surfaces = build_surfaces(list(stock.shapes.values()), config.surfaces, cache)
    return PairSource(Illuminator(radiance, device, compiled), surfaces, config.pairs)


def learning_rate(config: RunConfig, step: int) -> float:
    """Linear warm-up, constant, linear cool-down to zero."""
    falling = config.cooldown * config.steps
    return config.learning_rate * min(
        1.0, (step + 1) / config.warmup, (config.steps - step) / max(falling, 1.0)
    )


def make_learner(config: RunConfig, device: str) -> Chain | Lift:
    """What trains: networks, and their losses by name."""
    return Lift(config.lift, device) if config.model == "lift" else Chain(config, device)


def load_nets(checkpoint: Path) -> torch.nn.ModuleDict:
    """The trained networks of a checkpoint, ready to run; ModelError if there is none."""
    if not checkpoint.is_file():
        raise ModelError(f"{checkpoint}: expected a run's checkpoint, found none; train first")
    stored = torch.load(checkpoint, map_location="cpu", weights_only=True)
    model = json.loads(stored["config"]).get("model", "paper")
    nets = (Lift if model == "lift" else Chain).networks()
    nets.load_state_dict(stored["nets"])
    return nets.eval().requires_grad_(False)


def save_checkpoint(
    path: Path, nets: torch.nn.ModuleDict, config: RunConfig, optimizer: torch.optim.Optimizer, step: int
) -> None:
    """Everything that the next step depends on; pairs depend on the step's number alone."""
    with atomic_path(path) as temporary:
        torch.save(
            {
                "nets": nets.state_dict(),
                "optimizer": optimizer.state_dict(),
                "step": step,
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
    stop_after: int | None = None,
    pairs: PairSource | None = None,
) -> Path:
    """Train a run's networks to config.steps, going on from its checkpoint when there is one.

    Args:
        data: folder with hdri/train and meshes/train; None trains on procedural assets.
        runs: the checkpoint, log.csv and TensorBoard events go to runs/<config.name>.
        stop_after: stop (with a checkpoint) once this many steps are done in all.
        pairs: the batches, when they are at hand already.
    Returns:
        The checkpoint's path.
    """
    from torch.utils.tensorboard import SummaryWriter

    warnings.filterwarnings("ignore", message="Dynamo detected a call to a `functools.lru_cache`")
    torch.manual_seed(config.seed)
    folder = runs / config.name
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "checkpoint.pt"
    learner = make_learner(config, device)
    nets = learner.nets
    optimizer = torch.optim.AdamW(
        nets.parameters(), lr=config.learning_rate, betas=(0.9, 0.999), weight_decay=config.weight_decay
    )
    first = 0
    if path.is_file():
        stored = torch.load(path, map_location=device, weights_only=True)
        nets.load_state_dict(stored["nets"])
        optimizer.load_state_dict(stored["optimizer"])
        first = stored["step"]
    last = config.steps if stop_after is None else min(stop_after, config.steps)
    if first >= last:
        return path
    source = pairs or make_pairs(config, data, runs / "cache", device, compiled)
    log_path = folder / "log.csv"
    forget_after(log_path, first)
    columns = (
        TextColumn(config.name),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
    )
    saved = since = time.monotonic()
    history: list[torch.Tensor] = []
    with (
        SummaryWriter(str(folder / "tensorboard"), purge_step=first) as writer,
        Progress(*columns, console=Console(stderr=True)) as progress,
        log_path.open("a", newline="", encoding="utf-8") as log,
    ):
        rows = csv.writer(log)
        if first == 0:
            rows.writerow(["step", "pairs", *learner.columns, "learning_rate", "pairs_per_second"])
        task = progress.add_task("", total=config.steps, completed=first)
        for step in range(first, last):
            rate = learning_rate(config, step)
            for group in optimizer.param_groups:
                group["lr"] = rate
            losses = learner.losses(source.batch(step), step / config.steps)
            optimizer.zero_grad(set_to_none=True)
            sum(losses.values()).backward()
            for net in nets.values():
                torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
            optimizer.step()
            history.append(torch.stack([losses[stage].detach() for stage in learner.columns]))
            progress.advance(task)
            if (step + 1) % LOG_STEPS == 0 or step + 1 == last:
                means = dict(zip(learner.columns, torch.stack(history).mean(dim=0).tolist(), strict=True))
                speed = len(history) * config.pairs.batch / (time.monotonic() - since)
                values = [f"{means[stage]:.6f}" for stage in learner.columns]
                rows.writerow(
                    [step + 1, (step + 1) * config.pairs.batch, *values, f"{rate:.2e}", f"{speed:.1f}"]
                )
                log.flush()
                for stage, mean in means.items():
                    writer.add_scalar(f"loss/{stage}", mean, step + 1)
                progress.update(task, description=f"{' '.join(values)}  {speed:.0f} pairs/s")
                history, since = [], time.monotonic()
            if time.monotonic() - saved > CHECKPOINT_SECONDS or step + 1 == last:
                save_checkpoint(path, nets, config, optimizer, step + 1)
                saved = time.monotonic()
    return path


def forget_after(log: Path, step: int) -> None:
    """Drop logged rows that a kill left after the last checkpoint."""
    if not log.is_file():
        return
    lines = log.read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not line[:1].isdigit() or int(line.split(",")[0]) <= step]
    log.write_text("".join(line + "\n" for line in (kept if step else [])), encoding="utf-8")
