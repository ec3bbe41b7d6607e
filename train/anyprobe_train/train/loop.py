"""The loop of every run: one checkpoint that resumes to the bit, the running mean of the weights, and a log."""

import json
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from copy import deepcopy
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import nn

from anyprobe_train.train.checkpoint import load_weights, read_init_weights, resumed, save_checkpoint
from anyprobe_train.train.logger import run_log
from anyprobe_train.train.muon import MuonAndAdam

SAVE_SECONDS, SCORE_SECONDS = 300.0, 1800.0
"""Seconds between two checkpoints, and between two scores of photos that are left out."""
Item = TypeVar("Item")


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


def learn(
    config: Any,
    net: nn.Module,
    optimizer: torch.optim.Optimizer | MuonAndAdam,
    do_step: Callable[[Any, float], tuple[dict[str, torch.Tensor], int]],
    examples: Callable[[int, int], Iterator[Any]],
    *,
    runs: Path,
    columns: tuple[str, ...],
    assets: str,
    last: int | None = None,
    scored: Callable[[Any], dict[str, float]] | None = None,
    start: Path | None = None,
) -> Path:
    """Train a network to config.steps, going on from the checkpoint of runs/<config.name> when there is one; its path.

    Args:
        do_step: learns from an example at a learning rate; its losses, by the names of columns, and number of photos.
        examples: from a step to another, what each learns from.
        assets: identity of what they are drawn from. last: stop at this step, to go on later.
        scored: figures of the running mean of the network, written to left_out.jsonl beside the checkpoint.
        start: weights of train.checkpoint to go on from, at the step that they were kept at, if they say it.

    Raises:
        InputError, ModelError: of train.checkpoint.resumed and read_init_weights.
    """
    path = runs / config.name / "checkpoint.pt"
    stored, origin = resumed(path, config, {"assets": assets}, start, str(next(net.parameters()).device))
    first, mean = 0, deepcopy(net)
    if stored is not None:
        load_weights(mean, stored["net"], path)
        load_weights(net, stored["moving"], path)
        optimizer.load_state_dict(stored["optimizer"])
        first = stored["step"]
    elif start is not None:
        weights, pairs = read_init_weights(start)
        for one in (net, mean):
            load_weights(one, weights, start)
        first = (pairs or 0) // config.batch
    last = config.steps if last is None else min(last, config.steps)
    if first >= last:
        return path
    path.parent.mkdir(parents=True, exist_ok=True)
    saved = judged = time.monotonic()
    done = kept = first

    def keep() -> None:
        state = {"net": mean.state_dict(), "moving": net.state_dict(), "optimizer": optimizer.state_dict()}
        save_checkpoint(path, config, done, origin, state)

    with run_log(path.parent, config.name, columns, first, last, config.steps) as note, asked_to_stop() as asked:
        try:
            for step, example in enumerate(one_ahead(examples(first, last)), first):
                rate = learning_rate(config, step)
                net.train()
                torch.manual_seed(config.seed + step)  # what is dropped is the step's own
                losses, count = do_step(example, rate)
                move_mean(mean, net, min(config.averaged, (step + 1) / (step + 20)))
                done = step + 1
                note(done, count, losses, rate)
                is_judged = scored is not None and (time.monotonic() - judged > SCORE_SECONDS or done == config.steps)
                if is_judged or time.monotonic() - saved > SAVE_SECONDS:
                    keep()
                    kept, saved = done, time.monotonic()
                if is_judged and scored is not None:
                    with path.with_name("left_out.jsonl").open("a", encoding="utf-8") as stream:
                        stream.write(json.dumps({"step": done, **scored(mean)}) + "\n")
                    judged = time.monotonic()
                if asked():
                    break
        except BrokenExecutor:
            if not asked():  # else the processes that make photos were asked to stop, too
                raise
        if done > kept:
            keep()
    return path


def one_ahead(items: Iterator[Item]) -> Iterator[Item]:
    """Yield items, each of which a thread makes while the one before is used."""
    with ThreadPoolExecutor(1) as thread:
        coming = thread.submit(next, items, None)
        while (item := coming.result()) is not None:
            coming = thread.submit(next, items, None)
            yield item


@torch.no_grad()
def move_mean(mean: torch.nn.Module, net: torch.nn.Module, decay: float) -> None:
    """Move the running mean of the weights, and of the statistics, towards those of now."""
    kept, new = list(mean.state_dict().values()), list(net.state_dict().values())
    floating = [k for k, one in enumerate(kept) if one.is_floating_point()]
    torch._foreach_lerp_([kept[k] for k in floating], [new[k] for k in floating], 1.0 - decay)
    for k in set(range(len(kept))) - set(floating):
        kept[k].copy_(new[k])
