"""Train one seed for so many pairs; stops and goes on as if it had not stopped."""

from __future__ import annotations

import copy
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import torch

from anyprobe_train.nets.blocks import has_bfloat16
from research.paper_designs.designs import Designs, Losses, SquaredError
from research.paper_designs.judge import Judge
from research.paper_designs.pairs import Order, PairMaker
from research.paper_designs.scale import Scale
from research.paper_designs.tables import Tables

RATE = 1e-3
"""The paper's learning rate; it rises over the first 5 % of the steps (at most RISE) and falls over the last 30 %."""
RISE = 500
COOLDOWN = 0.3
DECAY = 1e-4
CHECKPOINT_SECONDS = 180.0
LOG_EVERY = 500
STEPS, LEAST_BATCH = 1000, 25
A_DECADE = 4
"""Evaluations while the pairs seen grow tenfold."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Run:
    """pairs: how many are seen in all; seed: of first weights and of the order of pairs."""

    pairs: int
    seed: int
    scale: Scale

    @property
    def name(self) -> str:
        return f"pairs_{self.pairs}_seed_{self.seed}"

    @property
    def batch(self) -> int:
        """Pairs a step: fewer in short runs, so that they too take STEPS steps."""
        return min(self.scale.batch, max(LEAST_BATCH, self.pairs // STEPS))

    @property
    def steps(self) -> int:
        return self.pairs // self.batch


def rate_at(step: int, steps: int) -> float:
    """Learning rate of a step."""
    rise = min((step + 1) / max(1, min(RISE, steps // 20)), 1.0)
    fall = min((steps - step) / (COOLDOWN * steps), 1.0)
    return RATE * rise * max(fall, 0.01)


class Trainer:
    """Networks, optimizer (the paper's Sect. 3.5) and the place in a run.

    Steps are computed in bfloat16 where the device has it, from networks that are kept in float32.
    """

    def __init__(self, run: Run, tables: Tables, device: str = "cpu") -> None:
        self.run, self.step = run, 0
        self.nets = Designs(run.scale, run.seed).to(device)
        dtype = torch.bfloat16 if has_bfloat16(device) else torch.float32
        working = copy.deepcopy(self.nets).to(dtype)
        self._working, self._kept = list(working.parameters()), list(self.nets.parameters())
        for parameter in self._kept:
            parameter.grad = torch.zeros_like(parameter)
        self._losses, self._pairs = Losses(working, tables), PairMaker(tables, dtype)
        self._order = Order(tables, run.batch, run.seed)
        self._optimizer = torch.optim.Adam(self._kept, RATE, weight_decay=DECAY, fused=True)

    def advance(self) -> dict[str, SquaredError]:
        """One step; its losses."""
        for group in self._optimizer.param_groups:
            group["lr"] = rate_at(self.step, self.run.steps)
        losses = self._losses(self._pairs(self._order.chosen(self.step)), self.step / self.run.steps)
        for parameter in self._working:
            parameter.grad = None
        torch.autograd.backward([x.output for x in losses.values()], [x.gradient() for x in losses.values()])
        torch._foreach_copy_([x.grad for x in self._kept], [x.grad for x in self._working])
        self._optimizer.step()
        self._copy()
        self.step += 1
        return losses

    @torch.no_grad()
    def _copy(self) -> None:
        torch._foreach_copy_(self._working, self._kept)

    def save(self, path: Path) -> None:
        """All that load needs to go on exactly."""
        state = {
            "run": asdict(self.run),
            "step": self.step,
            "nets": self.nets.state_dict(),
            "optimizer": self._optimizer.state_dict(),
        }
        _save(state, path)

    def load(self, path: Path) -> None:
        """Go on from a file of save; ValueError if it is of another run."""
        state = torch.load(path, weights_only=True, map_location=next(self.nets.parameters()).device)
        if state["run"] != asdict(self.run):
            raise ValueError(f"{path}: expected the run {asdict(self.run)}, got {state['run']}; use another folder")
        self.nets.load_state_dict(state["nets"])
        self._optimizer.load_state_dict(state["optimizer"])
        self._copy()
        self.step = state["step"]


def _save(state: dict, path: Path) -> None:
    partial = path.with_suffix(".part")
    torch.save(state, partial)
    partial.replace(path)


def judged_at(steps: int, batch: int) -> set[int]:
    """Steps after which a run is judged: A_DECADE times a decade of pairs, and its end."""
    marks = {round(2500 * 10 ** (k / A_DECADE) / batch) for k in range(4 * A_DECADE + 1)}
    return {mark for mark in marks if mark < steps} | {steps}


def train(run: Run, tables: Tables, judge: Judge, folder: Path, device: str = "cpu", stop: int | None = None) -> None:
    """Train, judge and save in folder / run.name, going on from what is there; at most to step `stop`."""
    folder = folder / run.name
    folder.mkdir(parents=True, exist_ok=True)
    trainer = Trainer(run, tables, device)
    if (folder / "checkpoint.pt").is_file():
        trainer.load(folder / "checkpoint.pt")
    marks = judged_at(run.steps, run.batch)
    saved, began, first = time.monotonic(), time.monotonic(), trainer.step
    while trainer.step < min(run.steps, stop or run.steps):
        losses = trainer.advance()
        if trainer.step % LOG_EVERY == 0 or trainer.step in marks:
            speed = (trainer.step - first) * run.batch / (time.monotonic() - began)
            shown = " ".join(f"{name} {loss.value():.5f}" for name, loss in losses.items())
            print(f"{run.name} step {trainer.step}/{run.steps} {speed:.0f} pairs/s {shown}", flush=True)
        if trainer.step in marks:
            judge.write(trainer.nets, folder / f"after_{trainer.step * run.batch:08d}.npz")
        if time.monotonic() - saved > CHECKPOINT_SECONDS or trainer.step == run.steps:
            trainer.save(folder / "checkpoint.pt")
            saved = time.monotonic()
    trainer.save(folder / "checkpoint.pt")
