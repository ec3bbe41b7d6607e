"""Export of the light network as light.onnx: from a photo's pixels to its light, one graph, checked against torch."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.color import REC709
from anyprobe.core.contract import contract
from anyprobe.estimate.light_graph import INPUTS, OUTPUTS, PLACE, SEEN_CONFIDENCE, graph_inputs
from anyprobe.estimate.runtime import CONTRACT
from anyprobe.light.light_sources import LIKELY_DEG
from anyprobe_train.light.both_ways import both_ways
from anyprobe_train.light.drawing import power_of
from anyprobe_train.light.given import SHORTEST, Framed, Given, framed
from anyprobe_train.light.light_views import LightViews, given_normals
from anyprobe_train.light.network import LeanNet, LightAnswer
from anyprobe_train.light.shown import inverse_display
from anyprobe_train.light.summed_up import Harmonics
from anyprobe_train.train.checkpoint import load_trained
from anyprobe_train.train.export_onnx import FLOATS, write_graph

TOLERANCE = 0.04
"""Largest median difference of any output from torch that weights of eight bits may cause."""
TWO_OF_THREE = float(np.log(3.0))
"""Bound that two of three errors keep, in mean errors of a Laplace distribution."""
THIN = 1e-3
"""Least cover that is divided by."""
SHOWN_NORMALS: int = contract("sizes")["normals"]
"""Side of the picture of the normals that are said [pixels]."""
KNOWN_LENS_DEG = 0.5
"""Error of a field of view that is given."""
ENOUGH: float = contract("exposure")["enough"]
DYNAMIC = {
    "photo": {1: "height", 2: "width"},
    "window": {1: "window_height", 2: "window_width"},
    "normals": {1: "normals_height", 2: "normals_width"},
}
"""Inputs of any size."""


def example_photo() -> dict[str, torch.Tensor]:
    """Return INPUTS of a smooth photo of a ball, by name in their order."""
    rows, columns = np.mgrid[:240, :320]
    mask = ((rows - 130) ** 2 + (columns - 150) ** 2 < 60**2).astype(np.float32)
    waves = np.array([[0.02, 0.05], [0.04, 0.01], [0.03, 0.03]])
    rgb = np.stack([0.5 + 0.4 * np.sin(a * rows + b * columns) for a, b in waves], axis=-1).astype(np.float32)
    given = graph_inputs(rgb, mask, 60.0)
    return {name: torch.from_numpy(given[name]) for name in INPUTS}


class LeanGraph(nn.Module):
    """Inputs of estimate.light_graph.INPUTS -> its OUTPUTS, by LeanNet."""

    def __init__(self, net: LeanNet) -> None:
        super().__init__()
        self.net, self.views, self.harmonics = net, LightViews(), Harmonics()

    def forward(self, *inputs_in_order: torch.Tensor) -> tuple[torch.Tensor, ...]:
        given = Given.of(inputs_in_order)
        crop, (inputs, beside) = framed(given), self.views(given)
        answer = both_ways(self.net, inputs)
        exposed = torch.where(inputs.crop[:, 3].amax() > 0.5, crop.well_exposed, torch.ones_like(crop.well_exposed))
        light, cover = known_light(given.panorama + (1.0 - given.panorama[3:]) * beside)
        asked = torch.maximum(given.panorama[3:], given.believe * cover).clamp(max=1.0)
        believed = torch.maximum(answer.believed[0], given.believe)
        shown = torch.maximum(given.panorama[3:], (believed > PLACE).float() * cover)
        worth = torch.maximum((exposed / ENOUGH).clamp(max=1.0), shown[0])
        confidence = torch.sigmoid(answer.confidence[0, 0]) * worth
        confidence = confidence + asked[0] * (SEEN_CONFIDENCE - confidence)
        guess = torch.exp(answer.ln_radiance[0])
        white = (light == 1.0).float()  # as bright or brighter; what is above was measured
        radiance = guess + asked * (torch.maximum(light, guess * white) - guess)
        outputs = (
            radiance.permute(1, 2, 0),
            confidence,
            self.harmonics(radiance),
            self._sources(answer),
            torch.sigmoid(answer.soft),
            self._errors(answer),
            self._posture(answer),
            self._field_of_view(answer, given),
            torch.sigmoid(answer.outdoors),
            believed[None],
            torch.cat([light * shown, shown]).permute(1, 2, 0),
            self._normals(answer, crop, given),
            self._material(answer),
            crop.crop.permute(1, 2, 0),
            torch.cat([crop.camera_from_crop.flatten(), crop.tan_half[None], crop.center]).reshape(4, 3),
            crop.well_exposed[None],
        )
        return tuple(one[None] for one in outputs)

    def _sources(self, answer: LightAnswer) -> torch.Tensor:
        """Return sources [S, 8], the strongest first."""
        there = self.net.drawing.likely(answer.places, answer.directions, answer.exists, LIKELY_DEG)[0]
        powers, radius = power_of(answer.ln_powers[0]), torch.exp(answer.ln_radius[0])[:, None]
        rows = torch.cat([there[:, None], answer.directions[0], radius, powers], dim=1)
        strength = torch.sigmoid(answer.exists[0]) * (powers @ torch.tensor(REC709))
        _, order = torch.topk(strength, len(rows))
        return rows[order]

    def _errors(self, answer: LightAnswer) -> torch.Tensor:
        direction, level, color = torch.exp(answer.errors[0]).unbind()
        return torch.stack([(10.0 * TWO_OF_THREE * direction).clamp(max=120.0), level, 10.0 * color])

    def _posture(self, answer: LightAnswer) -> torch.Tensor:
        pitch, ln_error, roll = answer.posture[0].unbind()
        return torch.stack([pitch * (180.0 / math.pi), roll * (180.0 / math.pi), 10.0 * torch.exp(ln_error)])

    def _field_of_view(self, answer: LightAnswer, given: Given) -> torch.Tensor:
        """Return the longer side's field of view and its error [degrees]: the given one where it is known."""
        known = (given.lens[1] > 0.5).float()
        tangent, error = torch.exp(answer.lens[0]).unbind()
        tangent = known * given.lens[0] + (1.0 - known) * tangent
        degrees = torch.atan(tangent) * (360.0 / math.pi)
        steep = 2.0 * tangent / (1.0 + tangent**2) * (180.0 / math.pi)  # d degrees / d ln tangent
        return torch.stack([degrees, known * KNOWN_LENS_DEG + (1.0 - known) * steep * error])

    def _normals(self, answer: LightAnswer, crop: Framed, given: Given) -> torch.Tensor:
        """Return normals over the crop in its frame, [64, 64, 3]: the given ones where they are known."""
        known = given_normals(given, SHOWN_NORMALS)
        found = F.interpolate(answer.normals, size=known.shape[1:], mode="bilinear", align_corners=False)[0]
        n = known + (known.square().sum(dim=0) < SHORTEST).float() * found
        turned = torch.einsum("ck,chw->hwk", crop.camera_from_crop, n)
        return turned / turned.square().sum(dim=2, keepdim=True).sqrt().clamp(min=1e-6)

    def _material(self, answer: LightAnswer) -> torch.Tensor:
        metal, others = answer.material[0].split([1, 4])
        return torch.cat([torch.sigmoid(metal), torch.exp(others)])


def known_light(seen: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Return radiance [3, H, 2H] of surroundings [4, H, 2H], RGB times cover and cover, and their cover [1, H, 2H]."""
    cover = seen[3:]
    shown = seen[:3] / cover.clamp(min=THIN)
    return torch.where(shown > 1.0, shown, inverse_display(shown)), cover


def export_lean(checkpoint: Path, path: Path) -> float:
    """Write light.onnx of a trained run; return its largest median difference from torch.

    Raises:
        ModelError: no checkpoint, or a difference of more than TOLERANCE.
    """
    net, run = load_trained(LeanNet(), checkpoint)
    return write_light(net, path, run)


def write_light(net: LeanNet, path: Path, run: dict) -> float:
    """Write light.onnx of a network; run: what its metadata say of where the weights are from."""
    about = {**CONTRACT, "stage": "light", "computes": FLOATS, "signature": "2"}
    about |= {"run": str(run.get("name")), "steps": str(run.get("step")), "config": json.dumps(run)}
    graph, given = LeanGraph(net).eval(), example_photo()
    return write_graph(graph, given, OUTPUTS, about, path, tolerance=TOLERANCE, dynamic=DYNAMIC, ranked=("sources",))
