"""Trained trials as methods that the evaluation can score, by torch, so that nothing need be exported first."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import torch

from anyprobe.core.response import response
from anyprobe.dataset.pair import Pair
from anyprobe.evaluate.panel import Estimate, Method
from anyprobe.nets.light_net import LightNet
from anyprobe.train.checkpoint import read_checkpoint
from anyprobe.train.loop import load_nets, pairs_seen
from anyprobe.train.trials import TRIALS


def trained_trials(runs: Path) -> dict[str, Path]:
    """The checkpoints of those trials that a folder of runs has, in the order they are told in."""
    paths = {run.__name__: runs / run.__name__ / "checkpoint.pt" for run in TRIALS}
    return {name: path for name, path in paths.items() if path.is_file()}


def read_trial(checkpoint: Path) -> dict[str, Any]:
    """What a results file says of a trial: steps, of how many, pairs and seeds."""
    stored = read_checkpoint(checkpoint)
    config = json.loads(stored["config"])
    return {
        "steps": stored["step"],
        "of_steps": config["steps"],
        "pairs": pairs_seen(stored),
        "seed": config["seed"],
        "pairs_seed": config["pairs"]["seed"],
    }


def trial_method(checkpoint: Path) -> Method:
    """A trial's network, told nothing but the photo."""
    net: LightNet = load_nets(checkpoint)["light"]

    @torch.no_grad()
    def method(pair: Pair) -> Estimate:
        photo = torch.from_numpy(pair.crop).permute(2, 0, 1)[None]
        guess = net(photo, torch.tensor([[pair.tan_half]], dtype=torch.float32))
        radiance = np.exp(guess.ln_radiance[0].permute(1, 2, 0).numpy())
        irradiance = guess.told.irradiance[0].permute(1, 2, 0).numpy().clip(0.0, 1.0)
        return Estimate(ldr=response(radiance), radiance=radiance, irradiance=irradiance)

    return method
