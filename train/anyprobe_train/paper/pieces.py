"""Everything that a reproduction trains, in order: what is needed first comes first."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import nn

from anyprobe.paper.chain import scaled_ln
from anyprobe.paper.equations import EPOCHS
from anyprobe_train.paper.networks import HdrNet, IlluminationNet, IrradianceNet
from anyprobe_train.paper.pairs import PaperPairs
from anyprobe_train.paper.rivals import MirrorNet, MirrorSphereNet, spheres_of, unwrapped_mirror, unwrapped_sphere
from anyprobe_train.paper.settings import Setting


@dataclass(frozen=True, kw_only=True, slots=True)
class Piece:
    """One network to train.

    network: "irradiance", "illumination", "hdr", or of a rival "sphere" or "mirror".
    sees: what an illumination net learns from: "photo", "estimate" (of irradiance_net) or "truth".
    gradual: whether its targets sharpen (Eq. 6).
    begins: the piece whose weights it goes on from, with sharp targets. maps: of open_tables.SPLITS.
    """

    name: str
    network: str
    steps: int
    sees: str = "photo"
    gradual: bool = False
    begins: str = ""
    seed: int = 0
    maps: str = "train"


def _light(name: str, sees: str, gradual: bool, steps: int = 100_000, **more) -> Piece:
    return Piece(name=name, network="illumination", steps=steps, sees=sees, gradual=gradual, **more)


PIECES = (
    Piece(name="irradiance_net", network="irradiance", steps=120_000),
    _light("ours", "estimate", True),
    Piece(name="hdr_net", network="hdr", steps=77_000, sees="truth"),
    _light("irradiance", "estimate", False),
    _light("direct", "photo", False),
    _light("ideal", "truth", True),
    _light("ours_longer", "estimate", True, begins="ours"),
    _light("ours_again", "estimate", True, seed=1),
    _light("irradiance_again", "estimate", False, seed=1),
    Piece(name="georgoulis", network="sphere", steps=100_000),
    Piece(name="meka", network="mirror", steps=100_000),
    _light("ours_all_maps", "estimate", True, maps="all_maps"),
)
"""ours to ideal: the rows of Table 1; ours_longer: what is shipped; *_again: with another seed; georgoulis and meka:
the rivals of Figs. 12 and 13."""


def steps_of(piece: Piece, setting: Setting) -> int:
    """Return a piece's steps in a setting."""
    return max(EPOCHS, round(piece.steps * setting.share))


def network_of(piece: Piece, setting: Setting) -> nn.Module:
    """Build a piece's network; its first weights depend on the seed and its kind alone."""
    torch.manual_seed(piece.seed)
    if piece.network == "irradiance":
        return IrradianceNet(setting.side, setting.width)
    if piece.network == "hdr":
        return HdrNet(setting.rows, setting.width)
    if piece.network == "mirror":
        return MirrorNet(setting.side, setting.width)
    kind = MirrorSphereNet if piece.network == "sphere" else IlluminationNet
    return kind(setting.side, setting.rows, setting.width, setting.code)


def input_of(piece: Piece, pairs: PaperPairs, irradiance_net: nn.Module | None) -> torch.Tensor:
    """Return what a piece's network is shown of pairs; irradiance_net: the trained one, for estimates."""
    if piece.network == "hdr":
        return pairs.ldr
    if piece.network == "mirror":
        return torch.cat([pairs.photo, pairs.normals], dim=1)
    if piece.sees == "truth":
        return pairs.irradiance
    if piece.sees == "estimate":
        assert irradiance_net is not None
        with torch.no_grad():
            return torch.cat([irradiance_net(pairs.photo).float().clip(0.0, 1.0), pairs.mask], dim=1)
    return pairs.photo


def target_of(piece: Piece, pairs: PaperPairs) -> torch.Tensor:
    """Return what a piece's network should make of it."""
    if piece.network == "irradiance":
        return pairs.irradiance[:, :3]
    if piece.network == "mirror":
        return pairs.mirror
    if piece.network == "sphere":
        return spheres_of(pairs.ldr)
    return scaled_ln(pairs.ln_radiance) if piece.network == "hdr" else pairs.ldr


def map_of(piece: Piece, estimate: torch.Tensor, pairs: PaperPairs) -> torch.Tensor:
    """Return the LDR map [N, 3, R, 2 R] that a network's estimate stands for."""
    rows = pairs.ldr.shape[2]
    if piece.network == "mirror":
        return unwrapped_mirror(estimate, pairs.normals, pairs.mask, rows)
    return unwrapped_sphere(estimate, rows) if piece.network == "sphere" else estimate
