"""LightNet and WholeNet in the place of the network of light.onnx, with a rule for each thing that they cannot say."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import torch
from torch import nn

from anyprobe.core.color import REC709
from anyprobe.core.contract import contract
from anyprobe.estimate.light_graph import INPUTS, graph_inputs
from anyprobe.paper.equations import LN_MAX
from anyprobe_train.light_graph.back import Back, posture_of, up_of
from anyprobe_train.light_graph.background import plain_and_dark
from anyprobe_train.light_graph.front import Framed, Front, Given, over
from anyprobe_train.light_graph.known_parts import KnownParts, bright, radiance_of
from anyprobe_train.nets.claims import Sureness, claims_of
from anyprobe_train.nets.emitter_head import DISC_DEG, EmitterHead, likelihood
from anyprobe_train.nets.light_net import LightNet, LightPrediction
from anyprobe_train.nets.source_head import DRAWN, RADII_DEG, SOURCES
from anyprobe_train.nets.whole_net import WholeNet, WholePrediction

ENOUGH: float = contract("exposure")["enough"]
RULES = contract("sources")
ERROR = {"power": 3.0, "factor": 3.27, "offset_deg": 5.0, "exponent": 0.75, "most_deg": 90.0}
"""Numbers of light_sources.direction_error for the likely light of these weights."""
LEAST_SHARE: float = RULES["least_share"]
"""Share of a map's power of which a place is as likely a light source as not."""
DOMINATES = 0.12
"""Share of a map's power of which the strongest source dominates as likely as not."""
SHARPNESS: float = RULES["steep"]
"""How fast either probability grows with the logarithm of that share."""
LENS_ERROR_DEG = 12.0
"""Mean error of the assumed field of view."""
LEVEL_ERROR_DEG = 45.0
"""Mean error of the pitch of a photo of which only the object is seen."""
SKY_BLUE, SKY_LEVEL = 0.15, 0.3
"""ln of blue over red, and radiance, of an upper half that is as likely outdoors as not."""


LIGHT_AXES = {
    "photo": {1: "height", 2: "width"},
    "window": {1: "window_height", 2: "window_width"},
    "normals": {1: "normals_height", 2: "normals_width"},
}


def smooth_photo() -> tuple[torch.Tensor, ...]:
    """Return those of a smooth photo of a ball, in the order of INPUTS."""
    rng = np.random.default_rng(0)
    rows, columns = np.mgrid[:96, :128]
    mask = ((rows - 54) ** 2 + (columns - 60) ** 2 < 24**2).astype(np.float32)
    waves = rng.uniform(0.02, 0.12, (3, 2))
    rgb = np.stack([0.5 + 0.4 * np.sin(a * rows + b * columns) for a, b in waves], axis=-1).astype(np.float32)
    given = graph_inputs(rgb, mask, 60.0)
    return tuple(torch.from_numpy(given[name]) for name in INPUTS)


class PhotoGraph(nn.Module):
    """Inputs of estimate.light_graph.INPUTS -> its OUTPUTS; without WholeNet, by the object alone."""

    def __init__(self, light: LightNet, whole: WholeNet | None, sureness: Sureness) -> None:
        super().__init__()
        self.light, self.whole, self.sureness = light, whole, sureness
        self.front, self.back, self.known = Front(), Back(), KnownParts()

    def forward(
        self,
        photo: torch.Tensor,
        window: torch.Tensor,
        geometry: torch.Tensor,
        lens: torch.Tensor,
        up: torch.Tensor,
        normals: torch.Tensor,
        material: torch.Tensor,
        panorama: torch.Tensor,
        sun: torch.Tensor,
        believe: torch.Tensor,
    ) -> tuple[torch.Tensor, ...]:
        given = Given.of((photo, window, geometry, lens, up, normals, material, panorama, sun, believe))
        unused = given.up.sum() + given.sun.sum()  # a tracer drops an input that nothing uses
        given = replace(given, lens=given.lens + 0.0 * unused)
        framed = self.front.framed(given)
        turn = framed.camera_from_crop
        plain, dark = plain_and_dark(given.photo)
        dark = dark * (1.0 - plain)
        plain, dark = plain * (1.0 - given.believe), dark * (1.0 - given.believe)
        used = (1.0 - plain) * (1.0 - dark) * (given.photo[3].amax() > 0.0).float()
        if self.whole is None:
            used = 0.0 * used
        seen = over(used * self.front.seen(given, framed, turn), self.front.panorama(given, turn))
        context = used * self.front.context(given, framed)
        own_normals = self.front.normals(given, framed)
        shown = torch.minimum(seen[:3], seen[3:4])
        alone, whole = self._answers(framed, own_normals, context, torch.cat([shown, seen[3:4]]), given)
        confidence, posterior = claims_of(alone, self.sureness)
        ln_radiance, ln_expected = alone.ln_radiance, alone.ln_expected
        if whole is not None:
            ln_radiance = torch.where(used > 0, whole.ln_radiance, ln_radiance)
            ln_expected = torch.where(used > 0, whole.ln_expected, ln_expected)
            confidence = torch.where(used > 0, torch.sigmoid(whole.confidence_logit), confidence)
        ln_radiance, ln_expected, confidence = ln_radiance[0], ln_expected[0], confidence[0, 0]
        confidence = confidence * (framed.well_exposed / ENOUGH).clamp(max=1.0)
        radiance = torch.exp(ln_radiance.clamp(max=LN_MAX))
        radiance, confidence = self.known(radiance, confidence, seen, given.material[0])
        turned = self.back.turned(torch.cat([radiance, confidence[None]]), turn)
        radiance, confidence = turned[:3].clamp(min=0.0), turned[3].clamp(0.0, 1.0)
        sources, soft = self._sources(alone, whole, used, radiance)
        expected = self.back.turned(torch.exp(ln_expected.clamp(max=LN_MAX)), turn)
        sources = torch.cat([sources[:, :1], sources[:, 1:4] @ turn.T, sources[:, 4:]], dim=1)
        errors = torch.stack([self._direction_error(expected, sources[0, 1:4]), *posterior[0, 5:].unbind()])
        in_camera = over(used * self.front.seen(given, framed, torch.eye(3)), given_panorama(self.front, given))
        light, _, cover = radiance_of(in_camera)
        posture = self._posture(whole, turn)
        fov = torch.atan(given.lens[0]) * (360.0 / math.pi)
        frame = torch.cat([turn.flatten(), torch.cat([framed.tan_half[None], framed.center])]).reshape(4, 3)
        outputs = (
            radiance.permute(1, 2, 0),
            confidence,
            self.back.harmonics(radiance),
            sources,
            soft[None],
            errors,
            posture,
            torch.stack([fov, LENS_ERROR_DEG * (1.0 - given.lens[1]) + 0.5]),
            self._outdoors(radiance, posture)[None],
            torch.stack([plain, dark]),
            torch.cat([light * cover, cover]).permute(1, 2, 0),
            alone.normals[0].permute(1, 2, 0),
            posterior[0, :5],
            framed.crop.permute(1, 2, 0),
            frame,
            framed.well_exposed[None],
            alone.features.irradiance[0].permute(1, 2, 0).clamp(0.0, 1.0),
        )
        return tuple(one[None] for one in outputs)

    def _answers(
        self, framed: Framed, normals: torch.Tensor, context: torch.Tensor, seen: torch.Tensor, given: Given
    ) -> tuple[LightPrediction, WholePrediction | None]:
        tan_half = framed.tan_half[None, None]
        alone = self.light(framed.display[None], tan_half, normals[None], seen[None], given.material[None])
        if self.whole is None:
            return alone, None
        confidence, said = claims_of(alone, self.sureness)
        lift = torch.cat([alone.ln_expected, alone.ln_radiance, confidence], dim=1)
        up = given.up @ framed.camera_from_crop
        return alone, self.whole(context[None], tan_half, lift, said, seen[None], up[None])

    def _sources(
        self, alone: LightPrediction, whole: WholePrediction | None, used: torch.Tensor, radiance: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return sources [S, 8] in the crop's frame, by falling power, and the probability [] that none dominates."""
        places, powers = drawn_by_mode(self.light.emitters, alone)
        widths = torch.full_like(powers[..., :1], DISC_DEG)
        found = torch.cat([places, widths, powers], dim=2)
        if whole is not None:
            found = torch.where(used > 0, self._drawn(whole), found)
        found = found[0]
        strength = found[:, 4:] @ torch.tensor(REC709)
        angles = self.light.emitters.solid_angles[0, 0]
        share = strength / (bright(radiance) * angles).sum().clamp(min=1e-9)
        exists = torch.sigmoid(SHARPNESS * torch.log((share / LEAST_SHARE).clamp(min=1e-6)))
        strongest, order = torch.topk(share, SOURCES)
        soft = torch.sigmoid(SHARPNESS * torch.log((DOMINATES / strongest[0].clamp(min=1e-6)).clamp(max=1e6)))
        return torch.cat([exists[:, None], found], dim=1)[order], soft

    def _drawn(self, whole: WholePrediction) -> torch.Tensor:
        """Return the places, radii [degrees] and powers RGB of the sources that WholeNet draws, [N, S, 7]."""
        there = whole.powers[..., :DRAWN]
        power = there.sum(dim=2)
        squares = power.new_tensor([RADII_DEG[0] ** 2, RADII_DEG[0] ** 2 + RADII_DEG[1] ** 2])
        radii = torch.sqrt((there @ squares) / power.clamp(min=1e-9)).clamp(min=RADII_DEG[0])
        return torch.cat([whole.places, radii[..., None], whole.colors * power[..., None]], dim=2)

    def _direction_error(self, expected: torch.Tensor, direction: torch.Tensor) -> torch.Tensor:
        """Return the bound [degrees] that two of three dominant lights keep, by the angle of all likely light to it."""
        weight = bright(expected) ** ERROR["power"] * self.light.emitters.solid_angles[0, 0]
        cosine = torch.einsum("hwc,c->hw", self.back.directions, direction).clamp(-1.0, 1.0)
        spread = (weight * torch.acos(cosine)).sum() / weight.sum().clamp(min=1e-12) * (180.0 / math.pi)
        return (ERROR["factor"] * (spread + ERROR["offset_deg"]) ** ERROR["exponent"]).clamp(max=ERROR["most_deg"])

    def _posture(self, whole: WholePrediction | None, turn: torch.Tensor) -> torch.Tensor:
        """Return pitch downwards, roll and the pitch's mean error [degrees] of the camera, [3]."""
        if whole is None:
            return turn.new_tensor([0.0, 0.0, LEVEL_ERROR_DEG])
        pitch, ln_error, roll, _ = whole.posture[0].unbind()
        return torch.cat([posture_of(turn @ up_of(pitch, roll)), torch.exp(ln_error)[None] * (180.0 / math.pi)])

    def _outdoors(self, radiance: torch.Tensor, posture: torch.Tensor) -> torch.Tensor:
        """Return the probability [] of a place outdoors: its upper half is bluish and bright."""
        pitch, roll = (posture[:2] * (math.pi / 180.0)).unbind()
        rise = torch.einsum("hwc,c->hw", self.back.directions, up_of(pitch, roll))
        upper = (rise > 0.5).float() * self.light.emitters.solid_angles[0, 0]
        red, _, blue = ((radiance.clamp(max=1.0) * upper).sum(dim=(1, 2)) / upper.sum()).clamp(min=1e-3).unbind()
        return torch.sigmoid(
            6.0 * (torch.log(blue / red) - SKY_BLUE) + 2.0 * torch.log(blue / SKY_LEVEL).clamp(max=0.0)
        )


def given_panorama(front: Front, given: Given) -> torch.Tensor:
    """Return the panorama in the camera's frame, as it was given."""
    measured = (given.panorama[:3].amax() > 1.0).float()
    return torch.cat([given.panorama, measured * given.panorama[3:]])


def drawn_by_mode(emitters: EmitterHead, alone: LightPrediction) -> tuple[torch.Tensor, torch.Tensor]:
    """Return places [N, SOURCES, 3] and powers RGB [N, SOURCES, 3] of the discs that EmitterHead.mode draws; the powers
    beyond its two are zero."""
    left = likelihood(alone.emitter_logit) * emitters.solid_angles
    left = left / left.sum(dim=(2, 3), keepdim=True)
    above = emitters.above(alone.ln_power)
    first = emitters.likeliest(left)
    near = (1.0 + (emitters.directions * first).sum(dim=1, keepdim=True).clamp(-1.0, 1.0)) / 2.0
    share = (left * near).sum(dim=(2, 3))
    second = emitters.likeliest(left * (1.0 - near))
    places = torch.cat([first[:, None, :, 0, 0], second[:, None, :, 0, 0].expand(-1, SOURCES - 1, -1)], dim=1)
    rest = torch.zeros_like(share).expand(-1, SOURCES - 2)
    shares = torch.cat([share, 1.0 - share, rest], dim=1)
    return places, shares[..., None] * above[:, None]
