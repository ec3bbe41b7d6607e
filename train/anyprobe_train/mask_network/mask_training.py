"""The mask network's training: its own small loop, one checkpoint that resumes exactly."""

import json
import time
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch.nn import functional as F

from anyprobe.errors import InputError
from anyprobe_train.mask_network.examples import MaskBatch, SceneSource
from anyprobe_train.mask_network.mask_net import MaskNet
from anyprobe_train.nets.blocks import autocast
from anyprobe_train.train.checkpoint import (
    agreed,
    load_weights,
    read_checkpoint,
    read_init_weights,
    resumed,
    save_checkpoint,
)
from anyprobe_train.train.logger import RunLogger, run_folder
from anyprobe_train.train.loop import CHECKPOINT_SECONDS, learning_rate, mean_of, move_mean
from anyprobe_train.world.batch import World


@dataclass(frozen=True, kw_only=True, slots=True)
class MaskRunConfig:
    """Settings of a run.

    name: of the run's folder; the learning rate rises over warmup steps and falls over the last cooldown share.

    small: side of the pictures in the first small_steps steps, which cost a third there and teach what an
    object is as well; the rest are at full size and teach its edge. averaged: decay of the running mean of the
    weights, which is what is exported. batch, prompts, scenes, fresh: of SceneSource. views: files of views of the
    world that the first scenes are drawn from.
    """

    name: str = "mask"
    steps: int = 9_000
    small: int = 96
    small_steps: int = 4_500
    learning_rate: float = 1e-3
    weight_decay: float = 1e-4
    warmup: int = 50
    cooldown: float = 0.7
    averaged: float = 0.998
    seed: int = 5
    batch: int = 16
    prompts: int = 2
    scenes: int = 320
    fresh: int = 1
    views: int = 32


def small_mask_run(config: MaskRunConfig, steps: int) -> MaskRunConfig:
    """Return the same run made small: a dry run for any machine."""
    return replace(config, name=f"{config.name}-dry", steps=steps, warmup=2, batch=4, scenes=4, views=2)


def scenes_of(config: MaskRunConfig, world: World) -> SceneSource:
    """Return the endless scenes of a run."""
    given = {name: getattr(config, name) for name in ("seed", "batch", "prompts", "scenes", "fresh")}
    return SceneSource(world=world, **given)


def mask_loss(logits: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    """Compute twice the cross entropy of every pixel plus 1 - soft IoU of every picture; an empty target has no IoU."""
    entropy = F.binary_cross_entropy_with_logits(logits, target)
    cover = torch.sigmoid(logits)
    shared = (cover * target).sum(dim=(1, 2, 3))
    either = (cover + target - cover * target).sum(dim=(1, 2, 3))
    full = (target.sum(dim=(1, 2, 3)) > 0).float()
    return 2.0 * entropy + ((1 - (shared + 1) / (either + 1)) * full).mean()


def shrink_batch(batch: MaskBatch, size: int) -> MaskBatch:
    """Downscale the examples to [B, C, size, size], averaged over areas."""
    parts = (batch.photo, batch.prompt, batch.mask)
    photo, prompt, mask = (F.interpolate(one, size=(size, size), mode="area") for one in parts)
    return MaskBatch(photo=photo, prompt=prompt, mask=mask)


def train_mask(
    config: MaskRunConfig,
    *,
    data: Path | None,
    runs: Path,
    stop_after: int | None = None,
    scenes: SceneSource | None = None,
    start: Path | None = None,
) -> Path:
    """Train to config.steps, resuming from the checkpoint of runs/<config.name> if there is one; return its path.

    Args:
        data: folder with hdri/train and meshes/train, needed unless scenes are at hand.
        runs: the checkpoint and log.csv go to runs/<config.name>, views to runs/world.
        stop_after: stop (with a checkpoint) once this many steps are done in all.
        scenes: the batches, when they are at hand already.
        start: weights to start from, of train.checkpoint; a resumed run may name those that it started from.

    Raises:
        InputError: a checkpoint of another run (train.checkpoint), or no data.
    """
    torch.manual_seed(config.seed)
    path = runs / config.name / "checkpoint.pt"
    net = MaskNet().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    optimizer = torch.optim.AdamW(net.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)
    stored, origin = resumed(path, config, {}, start)
    if stored is None and start is not None:
        load_weights(net, read_init_weights(start)[0], start)
    mean, first = mean_of(net, optimizer, stored, path)
    folder = run_folder(runs, config.name)
    last = config.steps if stop_after is None else min(stop_after, config.steps)
    if first >= last:
        return path
    if scenes is None:
        if data is None:
            raise InputError("expected a folder with hdri and meshes, got none", subject="data")
        world = World.open(data, runs / "world", first=config.views)
        assets = f"{len(world.maps.names)} maps, {len(world.views.files.paths)} shapes"
        origin = agreed(path, origin, {"assets": assets})
        scenes = scenes_of(config, world)
    logger = RunLogger(folder, config.name, ("loss", "iou"), first, last, config.steps)
    saved, examples_per_step = time.monotonic(), config.batch * config.prompts
    with logger:
        for step in range(first, last):
            rate = learning_rate(config, step)
            for group in optimizer.param_groups:
                group["lr"] = rate
            batch = scenes.examples(step)
            if step < config.small_steps:
                batch = shrink_batch(batch, config.small)
            figures = _step(net, optimizer, batch)
            move_mean(mean, net, min(config.averaged, (step + 1) / (step + 20)))
            logger.note(step + 1, (step + 1) * examples_per_step, examples_per_step, figures, rate)
            if time.monotonic() - saved > CHECKPOINT_SECONDS or step + 1 == last:
                state = {"net": mean.state_dict(), "moving": net.state_dict(), "optimizer": optimizer.state_dict()}
                save_checkpoint(path, config, step + 1, origin, state)
                saved = time.monotonic()
    return path


def load_mask_net(checkpoint: Path) -> tuple[MaskNet, dict]:
    """Load the trained network of a checkpoint (the mean of its weights), its step and its configuration; ModelError if
    there is none, or of another release."""
    stored = read_checkpoint(checkpoint)
    net = MaskNet()
    load_weights(net, stored["net"], checkpoint)
    return net.eval().requires_grad_(False), {"step": stored["step"], **json.loads(stored["config"])}


def _step(net: MaskNet, optimizer: torch.optim.Optimizer, batch: MaskBatch) -> dict[str, torch.Tensor]:
    """Do one step; return the loss and the mean IoU of the examples that have a target."""
    net.train()
    photo = batch.photo.repeat_interleave(batch.prompt.shape[1], dim=0)
    image = torch.cat([photo, batch.prompt.flatten(0, 1)[:, None]], dim=1)
    with autocast("cpu"):
        logits = net.logits(image.contiguous(memory_format=torch.channels_last)).float()
    mask = batch.mask.flatten(0, 1)[:, None]
    loss = mask_loss(logits, mask)
    optimizer.zero_grad(set_to_none=True)
    loss.backward()
    torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
    optimizer.step()
    estimate, truth = logits.detach() > 0, mask > 0.5
    full = truth.sum(dim=(1, 2, 3)) > 0
    iou = (estimate & truth).sum(dim=(1, 2, 3)) / (estimate | truth).sum(dim=(1, 2, 3)).clip(min=1)
    return {"loss": loss, "iou": iou[full].mean()}
