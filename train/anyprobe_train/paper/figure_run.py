"""A run as figures see it: its tables, and its networks at whatever step they are."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import torch
from torch import nn

from anyprobe.errors import InputError
from anyprobe.paper.chain import Chained, estimate_light
from anyprobe_train.paper.open_tables import open_tables
from anyprobe_train.paper.pieces import Shown, input_of, map_of, piece_named, steps_of
from anyprobe_train.paper.settings import Setting
from anyprobe_train.paper.tables import Tables
from anyprobe_train.paper.training import net_in_chain

METHODS = {"ours": "ours", "georgoulis": "Georgoulis et al.", "meka": "Meka et al."}
"""Methods of Figs. 12 to 14 by the piece that was trained, with what figures call them."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """A folder of checkpoints; data: folder with hdri/, meshes/ and real photos; notes: what a figure
    says beneath it, by subject, the steps of its networks among them."""

    runs: Path
    setting: Setting
    data: Path | None
    notes: dict[str, str] = field(default_factory=dict)
    _nets: dict[str, nn.Module] = field(default_factory=dict, repr=False)

    @cached_property
    def seen(self) -> Tables:
        """Tables that networks learn from."""
        return open_tables(self.data, self.runs, self.setting, "train")

    @cached_property
    def test(self) -> Tables:
        """Tables of test maps and shapes."""
        return open_tables(self.data, self.runs, self.setting, "test")

    def net(self, name: str) -> nn.Module:
        """Return a piece's network as the chain takes it; InputError if it was never trained and does not ship."""
        if name not in self._nets:
            self._nets[name], step = net_in_chain(self.setting, self.runs, name)
            self.notes[name] = f"{name} at step {step:,} of {steps_of(piece_named(name), self.setting):,}"
        return self._nets[name]

    def chain(self, photo: torch.Tensor) -> Chained:
        """Run the paper's chain on photos [N, 4, S, S]."""
        return estimate_light(photo, self.net("irradiance_net"), self.net("ours"), self.net("hdr_net"))

    def map_by(self, method: str, shown: Shown) -> torch.Tensor:
        """Return the LDR map [N, 3, R, 2 R] by one of METHODS."""
        if method == "ours":
            return self.chain(shown.photo).ldr
        piece = piece_named(method)
        return map_of(piece, self.net(method)(input_of(piece, shown, None)), shown, self.setting.rows)

    def folder(self, name: str) -> Path:
        """Return a folder of real photos in the data; InputError if it is not there."""
        if self.data is None or not (self.data / name).is_dir():
            raise InputError(f"expected real photos in DATA/{name}, got none; give --data", subject="data")
        return self.data / name
