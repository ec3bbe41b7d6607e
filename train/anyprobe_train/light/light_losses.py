"""Losses of the light network: few, named, each zero (or least) at the truth."""

from collections.abc import Mapping
from itertools import permutations

import numpy as np
import torch
from torch.nn import functional as F

from anyprobe.core.response import response
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe_train.evaluate.calibration import CLOSE
from anyprobe_train.light.drawing import PEAK_ROWS, POWER_FLOOR, SLOTS, SOURCE_ROWS, directions_of, solid_angles_of
from anyprobe_train.light.network import NORMALS_SIDE, LightAnswer
from anyprobe_train.light.pictured import LightTruth
from anyprobe_train.light.shown import display

LIGHT_WEIGHTS: dict[str, float] = {
    "display": 1.0,
    "scales": 0.5,
    "ln": 0.1,
    "density": 0.3,
    "power": 0.15,
    "places": 0.35,
    "exists": 0.1,
    "radius": 0.05,
    "source_power": 0.08,
    "spheres": 0.4,
    "level": 0.1,
    "color": 0.05,
    "soft": 0.1,
    "outdoors": 0.15,
    "posture": 0.15,
    "lens": 0.1,
    "confidence": 0.05,
    "direction_error": 0.02,
    "normals": 1.0,
    "material": 0.05,
}
"""Weight of each loss."""
DIM_POWER = 0.1
"""Power above white [sr] of which the loss of the density counts half."""
SOURCE_PLACE_DEG, BLUR_DEG = 5.0, 10.0
"""Width of a source's true place, and of the blur of half the density [degrees]."""
FAINT, LN_LOW = 0.02, -4.6
"""Radiance added before irradiance is compared, and least ln radiance that matters."""
SOFT_FROM = 0.5
"""Share of power that no source has from which on light is soft."""
LENS_UNIT, ANGLE_UNIT = 0.1, float(np.radians(10.0))
"""Errors that count as one: of ln of the tangent, and of the camera's posture [radians]."""
METAL, LEAST_CHORD = 0.5, 0.02
OUT_OF_ORDER = 1.0
"""Price of a source found by another slot than that of its rank: slots that are all alike would learn of none."""


def laplace(error: torch.Tensor, ln_scale: torch.Tensor) -> torch.Tensor:
    """Return -ln of a Laplace distribution's likelihood, up to ln 2, of errors that the claim must not change."""
    return error.detach() * torch.exp(-ln_scale) + ln_scale


def mean_where(values: torch.Tensor, counts: torch.Tensor) -> torch.Tensor:
    """Return the mean of values [N] where counts [N], zero where none does."""
    return torch.where(counts, values, 0.0).sum() / counts.sum().clamp(min=1)


class LightLoss:
    """The losses of a LightAnswer, unweighted, by the names of LIGHT_WEIGHTS."""

    def __init__(self, device: str = "cpu") -> None:
        self.angles = solid_angles_of(MAP_HEIGHT).to(device)[None, None]
        """Steradians [1, 1, 64, 128]."""
        self.weight = 0.5 + 0.5 * self.angles / self.angles.mean()
        """Weights of pixels, halfway between equal ones and true solid angles."""
        self.luminance = torch.tensor((0.2126, 0.7152, 0.0722), device=device)
        self._places, self._peaks = (directions_of(rows).to(device) for rows in (SOURCE_ROWS, PEAK_ROWS))
        blur = torch.exp((self._peaks @ self._peaks.T - 1.0) / (1 - np.cos(np.radians(BLUR_DEG))))
        self._blur = blur / blur.sum(dim=1, keepdim=True)
        cosine = (directions_of(8).to(device) @ self._places.T).clamp(min=0.0)
        place_angles = solid_angles_of(SOURCE_ROWS).flatten().to(device)
        self._cosine, self._ln_angles = cosine * place_angles, place_angles.log()
        self._orders = torch.tensor(list(permutations(range(SLOTS))), device=device)
        self._disorder = OUT_OF_ORDER * (self._orders != torch.arange(SLOTS, device=device)).float()

    def __call__(self, guess: LightAnswer, truth: LightTruth) -> dict[str, torch.Tensor]:
        """Compute every loss."""
        return {
            **self.of_map(guess, truth.radiance),
            **self.of_sources(guess, truth),
            **self.of_place(guess, truth),
            **self.of_object(guess, truth),
        }

    def of_map(self, guess: LightAnswer, radiance: torch.Tensor) -> dict[str, torch.Tensor]:
        """Compare maps: as a display shows the one that is drawn, and by the light that they send to spheres."""
        ldr = response(radiance.clamp(max=1.0))
        shown = display(guess.ln_radiance)
        shown = torch.where((shown > 1) & (ldr >= 1), 1.0, shown) - ldr  # how far above white does not matter there
        ln = torch.log(radiance.clamp(min=float(np.exp(LN_LOW))))
        near = (shown.detach().abs().mean(dim=1, keepdim=True) < CLOSE).float()
        power, share = self._above_white(radiance)
        ln_density = torch.log_softmax((guess.density + torch.log(self.angles)).flatten(1), dim=1)
        coarse = _coarse(share) @ self._blur
        ln_coarse = torch.log(_coarse(torch.exp(ln_density)) + 1e-9)
        cross = -(share * ln_density).sum(dim=1) / 2 - (coarse * ln_coarse).sum(dim=1) / 2
        counts = power.mean(dim=1) / (power.mean(dim=1) + DIM_POWER)
        drawn, expected = torch.exp(guess.ln_radiance), torch.exp(guess.ln_expected)
        level, color = self._level_and_color(drawn, radiance)
        spheres = [self._spheres(drawn), self._spheres(expected), self._spheres(radiance)]
        return {
            "display": (self.weight * (shown.abs() * 0.5 + shown.square() * 2)).mean(),
            "scales": scales_loss(shown),
            "ln": (self.weight * (guess.ln_shown - ln.clamp(max=0.0)).abs()).mean(),
            "density": (counts * cross).mean(),
            "power": (guess.ln_power - torch.log(power + POWER_FLOOR)).abs().mean(),
            "spheres": ((spheres[0] - spheres[2]).abs() + (spheres[1] - spheres[2]).abs()).mean() / 2,
            "level": (level + 0.3 * laplace(level, guess.errors[:, 1])).mean(),
            "color": (color + 0.3 * laplace(color, guess.errors[:, 2])).mean(),
            "confidence": F.binary_cross_entropy_with_logits(guess.confidence, near),
        }

    def _above_white(self, radiance: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the power above white [N, 3] and each pixel's share of its sum [N, 8192]."""
        above = (radiance - 1.0).clamp(min=0.0) * self.angles
        total = above.sum(dim=1).flatten(1)
        return above.sum(dim=(2, 3)), total / total.sum(dim=1, keepdim=True).clamp(min=1e-6)

    def _spheres(self, radiance: torch.Tensor) -> torch.Tensor:
        """Return ln of the irradiance over pi of 128 normals, [N, 3, 128]."""
        power = F.avg_pool2d(radiance * self.angles, 2) / F.avg_pool2d(self.angles, 2)
        return torch.log(power.flatten(2) @ self._cosine.T / torch.pi + FAINT)

    def _level_and_color(self, radiance: torch.Tensor, true: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return differences of ln luminance of all light [N], and of its colour [N] in tens of degrees."""
        ours, theirs = ((one * self.angles).sum(dim=(2, 3)) + FAINT for one in (radiance, true))
        level = (torch.log(ours @ self.luminance) - torch.log(theirs @ self.luminance)).abs()
        cosine = F.cosine_similarity(ours, theirs).clamp(max=1 - 1e-5)
        return level, torch.acos(cosine) / ANGLE_UNIT

    def of_sources(self, guess: LightAnswer, truth: LightTruth) -> dict[str, torch.Tensor]:
        """Compare sources with the true ones in the order that fits best: by rank unless another clearly does."""
        true = truth.sources
        cosine = true[:, :, 1:4] @ self._places.T  # [N, S, 2048]
        target = torch.softmax((cosine - 1.0) / (1 - np.cos(np.radians(SOURCE_PLACE_DEG))) + self._ln_angles, dim=2)
        entropy = -(target * torch.log(target + 1e-9)).sum(dim=2)  # [N, S]
        cost = -torch.einsum("ntp,nsp->nts", target, guess.places) - entropy[:, :, None]
        there = true[:, :, 0] > 0.5
        found = F.softplus(-guess.exists)[:, None]  # of slot s, [N, 1, S]
        price = there[:, :, None].float() * (cost + found)
        price = price[:, range(SLOTS), self._orders]  # [N, orders, S]
        total = (price + there[:, None].float() * self._disorder).sum(dim=2)
        order = self._orders[total.argmin(dim=1)]  # slot of each true source, [N, S]
        cost = cost.gather(2, order[:, :, None])[..., 0]
        slots = {name: getattr(guess, name) for name in ("exists", "ln_radius", "ln_powers", "directions")}
        of = {k: v.gather(1, order if v.dim() == 2 else order[..., None].expand(-1, -1, 3)) for k, v in slots.items()}
        power = (of["ln_powers"] - torch.log(true[:, :, 5:].clamp(min=0.0) + POWER_FLOOR)).abs().mean(dim=2)
        radius = (of["ln_radius"] - torch.log(true[:, :, 4].clamp(min=2.0))).abs()
        weight = true.new_tensor([1.0, 0.5, 0.25]) * there
        weight = weight / weight.sum().clamp(min=1e-6)
        cosine_off = (of["directions"] * true[:, :, 1:4]).sum(dim=2).clamp(-1 + 1e-6, 1 - 1e-6)
        off = torch.acos(cosine_off[:, 0]) / ANGLE_UNIT
        soft = (truth.soft > SOFT_FROM).float()
        return {
            "places": (weight * cost).sum(),
            "exists": F.binary_cross_entropy_with_logits(of["exists"], there.float()),
            "radius": (weight * radius).sum(),
            "source_power": (weight * power).sum(),
            "soft": F.binary_cross_entropy_with_logits(guess.soft, soft),
            "direction_error": mean_where(laplace(off, guess.errors[:, 0]), there[:, 0]),
        }

    def of_place(self, guess: LightAnswer, truth: LightTruth) -> dict[str, torch.Tensor]:
        """Compare the camera's posture and lens, and whether the place is outdoors."""
        pitch, ln_error, roll = guess.posture.unbind(dim=1)
        off = (pitch - torch.asin(truth.up[:, 2].clamp(-1.0, 1.0))).abs() / ANGLE_UNIT
        rolled = (roll - torch.atan2(truth.up[:, 0], truth.up[:, 1])).abs() / ANGLE_UNIT
        ln_tan = torch.log(torch.tan(torch.deg2rad(truth.fov) / 2.0))
        lens = (guess.lens[:, 0] - ln_tan).abs() / LENS_UNIT
        known = ~torch.isnan(truth.outdoors)
        outdoors = F.binary_cross_entropy_with_logits(
            guess.outdoors, torch.nan_to_num(truth.outdoors), reduction="none"
        )
        of_lens = 0.3 * laplace(lens, guess.lens[:, 1] - float(np.log(LENS_UNIT)))
        return {
            "posture": (off + 0.3 * rolled + 0.3 * laplace(off, ln_error)).mean(),
            "lens": 0.3 * (lens + of_lens).mean(),
            "outdoors": mean_where(outdoors, known),
        }

    def of_object(self, guess: LightAnswer, truth: LightTruth) -> dict[str, torch.Tensor]:
        """Compare the object's normals and material, where there is an object."""
        shown = truth.normals.square().sum(dim=1) > 0.25
        along = (F.normalize(truth.normals, dim=1) * guess.normals).sum(dim=1)
        share = shown.sum(dim=(1, 2)).clamp(min=NORMALS_SIDE)
        chord = torch.sqrt(2 * (1 - along).clamp(min=0.0) + LEAST_CHORD**2) - LEAST_CHORD
        normals = torch.where(shown, chord, 0.0).sum(dim=(1, 2)) / share
        known = ~torch.isnan(truth.material[:, 0])
        true = torch.nan_to_num(truth.material)
        reflectance = (guess.material[:, 1:4] - torch.log(true[:, 1:].clamp(min=0.02))).abs().mean(dim=1)
        metal = (true[:, 0] > METAL).float()
        kind = F.binary_cross_entropy_with_logits(guess.material[:, 0], metal, reduction="none")
        material = kind + reflectance + 0.3 * laplace(reflectance, guess.material[:, 4])
        return {"normals": mean_where(normals, known), "material": mean_where(material, known)}


def scales_loss(difference: torch.Tensor) -> torch.Tensor:
    """Compute the sum of mean d^2 + .3 mean |d| over differences d [N, 3, H, 2H] of display values, averaged over 2, 4,
    8 and 16 pixels."""
    loss = difference.new_zeros(())
    for _ in range(4):
        difference = F.avg_pool2d(difference, 2)
        loss = loss + difference.square().mean() + 0.3 * difference.abs().mean()
    return loss


def _coarse(share: torch.Tensor) -> torch.Tensor:
    """Return the sums [N, 512] of shares [N, 8192] over 4 x 4 pixels."""
    fine = share.unflatten(1, (1, MAP_HEIGHT, 2 * MAP_HEIGHT))
    return 16.0 * F.avg_pool2d(fine, MAP_HEIGHT // PEAK_ROWS).flatten(1)


def total_of(losses: Mapping[str, torch.Tensor]) -> torch.Tensor:
    """Return the weighted sum, in the order of LIGHT_WEIGHTS."""
    return sum((weight * losses[name] for name, weight in LIGHT_WEIGHTS.items()), torch.zeros(()))
