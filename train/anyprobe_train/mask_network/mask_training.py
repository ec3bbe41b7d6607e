"""The mask network's training: its settings, its loss, and a step of it."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from torch.nn import functional as F

from anyprobe_train.mask_network.examples import MaskBatch, MaskRunConfig, mask_batches
from anyprobe_train.mask_network.mask_net import MaskNet
from anyprobe_train.nets.blocks import autocast
from anyprobe_train.train.loop import learn
from anyprobe_train.world.batch import World, assets_of


def small_mask_run(config: MaskRunConfig, steps: int) -> MaskRunConfig:
    """Return the same run made small: a dry run for any machine."""
    return replace(config, name=f"{config.name}-dry", steps=steps, warmup=2, batch=4, scenes=4, views=2)


def mask_loss(logits: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    """Compute twice the cross entropy of every pixel plus 1 - soft IoU of every picture; an empty target has no IoU."""
    entropy = F.binary_cross_entropy_with_logits(logits, target)
    cover = torch.sigmoid(logits)
    shared = (cover * target).sum(dim=(1, 2, 3))
    either = (cover + target - cover * target).sum(dim=(1, 2, 3))
    full = (target.sum(dim=(1, 2, 3)) > 0).float()
    return 2.0 * entropy + ((1 - (shared + 1) / (either + 1)) * full).mean()


def train_mask(
    config: MaskRunConfig, *, data: Path | None, runs: Path, world: World | None = None, **rest: Any
) -> Path:
    """Train to config.steps, resuming from the checkpoint of runs/<config.name> if there is one; return its path.

    Args:
        data: folder with hdri/train and meshes/train, needed unless its world is at hand.
        runs: the checkpoint and log.csv go to runs/<config.name>, views to runs/world.
        world: what scenes are drawn from, when it is open already.
        rest: of train.loop.learn: last, to stop (with a checkpoint) once this many steps are done in all, and start,
            weights to start from, of train.checkpoint; a resumed run may name those that it started from.

    Raises:
        InputError: a checkpoint of another run (train.checkpoint), or no data.
    """
    torch.manual_seed(config.seed)
    net = MaskNet().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    optimizer = torch.optim.AdamW(net.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)
    world = world or World.open(data, runs / "world", first=config.views)

    def examples(first: int, last: int) -> Iterator[MaskBatch]:
        for step, batch in enumerate(mask_batches(world, config, first, last), first):
            if step < config.small_steps:
                batch = tuple(F.interpolate(one, size=(config.small, config.small), mode="area") for one in batch)
            yield batch

    def do_step(batch: MaskBatch, rate: float) -> tuple[dict[str, torch.Tensor], int]:
        """Do one step; return the loss and the mean IoU of the examples that have a target."""
        for group in optimizer.param_groups:
            group["lr"] = rate
        photo, prompt, target = batch
        photo = photo.repeat_interleave(prompt.shape[1], dim=0)
        image = torch.cat([photo, prompt.flatten(0, 1)[:, None]], dim=1)
        with autocast("cpu"):
            logits = net.logits(image.contiguous(memory_format=torch.channels_last)).float()
        mask = target.flatten(0, 1)[:, None]
        loss = mask_loss(logits, mask)
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimizer.step()
        estimate, truth = logits.detach() > 0, mask > 0.5
        full = truth.sum(dim=(1, 2, 3)) > 0
        iou = (estimate & truth).sum(dim=(1, 2, 3)) / (estimate | truth).sum(dim=(1, 2, 3)).clip(min=1)
        return {"loss": loss, "iou": iou[full].mean()}, len(image)

    return learn(
        config, net, optimizer, do_step, examples, runs=runs, columns=("loss", "iou"), assets=assets_of(world), **rest
    )
