"""Training of one piece, resumable to the bit."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from anyprobe.errors import InputError
from anyprobe.files.atomic import atomic_path
from anyprobe_train.nets.blocks import autocast
from anyprobe_train.paper import schedule
from anyprobe_train.paper.losses import l2
from anyprobe_train.paper.networks import in_chain
from anyprobe_train.paper.pairs import PaperPairs, drawn, pairs_of, reexposed
from anyprobe_train.paper.pieces import Piece, input_of, network_of, piece_named, steps_of, target_of
from anyprobe_train.paper.scores import Scorer
from anyprobe_train.paper.settings import Setting
from anyprobe_train.paper.shipped import ShippedNet, shipped_net
from anyprobe_train.paper.tables import EXPOSURES, Tables

SAVE_SECONDS = 180.0
WATCHING = {"scored", "table_pairs", "log_every", "score_every"}
"""Fields of a setting that a run may change as it goes on."""


class Trainer:
    """A piece's network, optimizer and step. Computes in bfloat16 where the device has it, keeps float32."""

    def __init__(self, piece: Piece, setting: Setting, tables: Tables, runs: Path) -> None:
        self.piece, self.setting, self.tables, self.step = piece, setting, tables, 0
        self.device = tables.ldr.device.type
        self.steps = steps_of(piece, setting)
        self.net = placed(network_of(piece, setting), self.device)
        self.irradiance_net = None
        if piece.sees == "estimate":
            self.irradiance_net = load_net(setting, runs, "irradiance_net", self.device)
        self._optimizer = torch.optim.Adam(
            self.net.parameters(), schedule.RATE, betas=schedule.BETAS, weight_decay=schedule.DECAY, fused=True
        )
        allowed = tables.measured.cpu().numpy() if piece.network == "hdr" else np.ones(len(tables.maps), bool)
        self._allowed = np.flatnonzero(allowed) if allowed.any() else np.arange(len(tables.maps))

    def pairs(self) -> PaperPairs:
        """Look up the pairs of this step; the HDR net's maps have an exposure of their own (Sect. 3.5)."""
        step = self.step + self.piece.seed * 1_000_000  # no piece has as many
        which = drawn(self.tables, self._allowed, self.setting.batch, step)
        pairs = pairs_of(self.tables, which)
        if self.piece.network != "hdr":
            return pairs
        rng = np.random.default_rng((self.step, 1))
        low, high = np.log(EXPOSURES)
        exposure = torch.from_numpy(np.exp(rng.uniform(low, high, size=len(which.map))).astype(np.float32))
        return reexposed(pairs, exposure.to(self.device) / self.tables.exposure[which.map])

    def advance(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Take a step; return its loss, and the loss against the sharp target."""
        self.net.train()
        for group in self._optimizer.param_groups:
            group["lr"] = schedule.rate_at(self.step, self.steps)
        pairs = self.pairs()
        truth = target = target_of(self.piece, pairs)
        if self.piece.gradual:
            target = schedule.filtered_target(truth, schedule.epoch_of(self.step, self.steps))
        self._optimizer.zero_grad()
        with autocast(self.device):
            estimate = self.net(input_of(self.piece, pairs, self.irradiance_net))
        loss = l2(estimate, target)
        loss.backward()
        self._optimizer.step()
        self.step += 1
        return loss.detach(), l2(estimate.detach(), truth)

    def save(self, path: Path) -> None:
        """Write everything that the next step depends on."""
        state = {"net": self.net.state_dict(), "optimizer": self._optimizer.state_dict(), "step": self.step}
        with atomic_path(path) as partial:
            torch.save({**state, "piece": asdict(self.piece), "setting": asdict(self.setting)}, partial)

    def load(self, path: Path) -> None:
        """Go on from what save wrote; InputError if it is of another setting."""
        state = torch.load(path, weights_only=True, map_location=self.device)
        now = {**asdict(self.piece), **asdict(self.setting)}
        begun = {**state["piece"], **state["setting"]}
        if any(begun[key] != now[key] for key in begun.keys() & now.keys() - WATCHING):
            raise InputError("expected this run's settings, got others; use another --runs folder", source=path)
        self.net.load_state_dict(state["net"])
        self._optimizer.load_state_dict(state["optimizer"])
        self.step = state["step"]


def checkpoint_of(runs: Path, name: str) -> Path:
    """Return the file of a piece's checkpoint."""
    return runs / name / "checkpoint.pt"


def stored(runs: Path, name: str) -> dict[str, Any]:
    """Read a piece's checkpoint; InputError if there is none."""
    path = checkpoint_of(runs, name)
    if not path.is_file():
        raise InputError(f"expected {name} to be trained, got no checkpoint; train it first", source=path)
    return torch.load(path, weights_only=True, map_location="cpu")


def log_of(runs: Path, name: str) -> list[dict[str, float]]:
    """Read a piece's log in order of steps, each once; InputError if there is none."""
    stored(runs, name)
    lines = (runs / name / "log.jsonl").read_text(encoding="utf-8").splitlines()
    return [line for _, line in sorted({line["step"]: line for line in map(json.loads, lines)}.items())]


def is_trained(piece: Piece, setting: Setting, runs: Path) -> bool:
    """Return whether a piece has all its steps."""
    return checkpoint_of(runs, piece.name).is_file() and stored(runs, piece.name)["step"] >= steps_of(piece, setting)


def load_net(setting: Setting, runs: Path, name: str, device: str = "cpu") -> nn.Module:
    """Return a trained piece's network, for estimates: that of runs, else the one that ships."""
    if not checkpoint_of(runs, name).is_file() and (shipped := shipped_net(name, setting)) is not None:
        return shipped
    net = network_of(piece_named(name), setting)
    net.load_state_dict(stored(runs, name)["net"])
    return placed(net, device).eval().requires_grad_(False)


def net_in_chain(setting: Setting, runs: Path, name: str) -> tuple[nn.Module, int]:
    """Return load_net's network as the chain takes it, and its step."""
    net = load_net(setting, runs, name)
    return (net, net.step) if isinstance(net, ShippedNet) else (in_chain(net), stored(runs, name)["step"])


def placed(net: nn.Module, device: str) -> nn.Module:
    """Move a network to a device, its channels last in memory."""
    return net.to(device).to(memory_format=torch.channels_last)  # type: ignore[call-overload]


def train(
    piece: Piece,
    setting: Setting,
    tables: Tables,
    scorer: Scorer,
    runs: Path,
    *,
    asked_to_stop: Callable[[], bool],
    say: Callable[[str], None],
    stop: int | None = None,
) -> bool:
    """Train a piece in runs/<name>, going on from what is there; at most to step `stop`. Return whether it came so far;
    else it was asked to stop, and everything is saved.

    Every setting.log_every steps a line goes to log.jsonl: losses against filtered and unfiltered maps, pairs a second,
    and from time to time scores.
    """
    path = checkpoint_of(runs, piece.name)
    path.parent.mkdir(parents=True, exist_ok=True)
    trainer = Trainer(piece, setting, tables, runs)
    if path.is_file():
        trainer.load(path)
    last = min(trainer.steps, stop or trainer.steps)
    saved = began = time.monotonic()
    losses: list[torch.Tensor] = []
    while trainer.step < last:
        losses.append(torch.stack(trainer.advance()))
        done = trainer.step == last
        if trainer.step % setting.log_every == 0 or done:
            seconds, began = time.monotonic() - began, time.monotonic()
            line = _line(trainer, torch.stack(losses), seconds)
            losses = []
            if trainer.step % setting.score_every == 0 or done:
                trainer.net.eval()
                with autocast(trainer.device):
                    line |= scorer(piece, trainer.net, trainer.irradiance_net)
                began = time.monotonic()
            with (path.parent / "log.jsonl").open("a", encoding="utf-8") as log:
                log.write(json.dumps(line) + "\n")
            say(f"{piece.name} " + " ".join(f"{key} {value}," for key, value in line.items())[:-1])
        is_asked = asked_to_stop()
        if done or is_asked or time.monotonic() - saved > SAVE_SECONDS:
            trainer.save(path)
            saved = time.monotonic()
        if is_asked:
            return False
    return True


def _line(trainer: Trainer, losses: torch.Tensor, seconds: float) -> dict[str, float]:
    """Return what is logged without scores: losses [N, 2] of the steps since the last line."""
    mean, spread = losses.mean(dim=0).tolist(), losses[:, 0].std(correction=0).item()
    line = {"step": trainer.step, "steps": trainer.steps, "loss": round(mean[0], 6), "spread": round(spread, 6)}
    line |= {"unfiltered": round(mean[1], 6)} if trainer.piece.gradual else {}
    return line | {"pairs/s": round(len(losses) * trainer.setting.batch / seconds, 1)}
