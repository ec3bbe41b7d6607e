"""Everything that a reproduction trains, in order: what is needed first comes first."""

from dataclasses import dataclass

import torch
from torch import nn

from anyprobe.paper.equations import EPOCHS
from anyprobe_train.paper.networks import HdrNet, IlluminationNet, IrradianceNet, scaled_ln
from anyprobe_train.paper.pairs import PaperPairs
from anyprobe_train.paper.real_photos import RealPhotos
from anyprobe_train.paper.rivals import MirrorNet, MirrorSphereNet, spheres_of, unwrapped_mirror, unwrapped_sphere
from anyprobe_train.paper.settings import Setting


@dataclass(frozen=True, kw_only=True, slots=True)
class Piece:
    """One network to train.

    network: "irradiance", "illumination", "hdr", or of a rival "sphere" or "mirror".
    sees: what an illumination net learns from: "photo", "estimate" (of irradiance_net) or "truth".
    gradual: whether its targets sharpen (Eq. 6).
    seed: of its first weights and of its pairs.
    """

    name: str
    network: str
    steps: int
    sees: str = "photo"
    gradual: bool = False
    seed: int = 0


PIECES = (
    Piece(name="irradiance_net", network="irradiance", steps=120_000),
    Piece(name="ours", network="illumination", steps=100_000, sees="estimate", gradual=True),
    Piece(name="hdr_net", network="hdr", steps=77_000, sees="truth"),
    Piece(name="irradiance", network="illumination", steps=100_000, sees="estimate"),
    Piece(name="direct", network="illumination", steps=100_000),
    Piece(name="ideal", network="illumination", steps=100_000, sees="truth", gradual=True),
    Piece(name="irradiance_again", network="illumination", steps=100_000, sees="estimate", seed=1),
    Piece(name="ours_again", network="illumination", steps=100_000, sees="estimate", gradual=True, seed=1),
    Piece(name="georgoulis", network="sphere", steps=100_000),
    Piece(name="meka", network="mirror", steps=100_000),
)
"""The first three ship; ours, irradiance, direct and ideal: the rows of Table 1, two of them again by a second seed;
georgoulis and meka: the rivals of Figs. 12 to 14."""


def piece_named(name: str) -> Piece:
    """Return one of PIECES."""
    (piece,) = (one for one in PIECES if one.name == name)
    return piece


def steps_of(piece: Piece, setting: Setting) -> int:
    """Return a piece's steps in a setting."""
    return max(EPOCHS, round(piece.steps * setting.share))


def network_of(piece: Piece, setting: Setting) -> nn.Module:
    """Build a piece's network; its first weights depend on its kind and seed alone."""
    torch.manual_seed(piece.seed)
    if piece.network == "irradiance":
        return IrradianceNet(setting.side, setting.width)
    if piece.network == "hdr":
        return HdrNet(setting.rows, setting.width)
    if piece.network == "mirror":
        return MirrorNet(setting.side, setting.width)
    kind = MirrorSphereNet if piece.network == "sphere" else IlluminationNet
    return kind(setting.side, setting.rows, setting.width, setting.code)


Shown = PaperPairs | RealPhotos
"""Pictures of objects: photo [N, 4, S, S], mask [N, 1, S, S], normals [N, 3, S, S], zero off the object."""


def input_of(piece: Piece, shown: Shown, irradiance_net: nn.Module | None) -> torch.Tensor:
    """Return what a piece's network sees, of pairs unless it needs the photo alone.

    irradiance_net: the trained one, for estimates.
    """
    if piece.network == "mirror":
        return torch.cat([shown.photo, shown.normals], dim=1)
    if piece.sees == "truth":
        assert isinstance(shown, PaperPairs)
        return shown.ldr if piece.network == "hdr" else shown.irradiance
    if piece.sees == "estimate":
        assert irradiance_net is not None
        with torch.no_grad():
            return torch.cat([irradiance_net(shown.photo).float().clip(0.0, 1.0), shown.mask], dim=1)
    return shown.photo


def target_of(piece: Piece, pairs: PaperPairs) -> torch.Tensor:
    """Return what a piece's network should make of it."""
    if piece.network == "irradiance":
        return pairs.irradiance[:, :3]
    if piece.network == "mirror":
        return pairs.mirror
    if piece.network == "sphere":
        return spheres_of(pairs.ldr)
    return scaled_ln(pairs.ln_radiance) if piece.network == "hdr" else pairs.ldr


def map_of(piece: Piece, estimate: torch.Tensor, shown: Shown, rows: int) -> torch.Tensor:
    """Return the LDR map [N, 3, rows, 2 rows] that a network's estimate stands for."""
    if piece.network == "mirror":
        return unwrapped_mirror(estimate, shown.normals, shown.mask, rows)
    return unwrapped_sphere(estimate, rows) if piece.network == "sphere" else estimate
