"""Scores of left-out pairs while training: what models are chosen by."""

from __future__ import annotations

import numpy as np
import torch

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.light.light_sources import find_dominant_light, find_sources
from anyprobe_train.evaluate.metrics import direction_error_deg, false_sources
from anyprobe_train.whole_network.batches import Pairs
from anyprobe_train.whole_network.families import FAMILIES
from anyprobe_train.whole_network.photo_net import PhotoNet

AT_ONCE = 32
CUT_OUT, ALONE = "cut-out", "cut-out-alone"
"""Names of the figures of cut-outs: of the whole network, and of LightNet."""


@torch.no_grad()
def score_left_out(net: PhotoNet, pairs: Pairs) -> dict[str, float]:
    """Return figures of left-out pairs: LDR RMSE, dominant light (median; hardest third), power [stops], pitch; LDR
    RMSE and dominant light of each family's photos and of the cut-outs; and the cast of photos and of cut-outs: median
    errors of ln red and ln blue over green in all light."""
    rows = []
    was_training = net.training
    net.eval()
    for start in range(0, len(pairs), AT_ONCE):
        batch = pairs.rows(start, start + AT_ONCE)
        of_object, of_photo = net(batch)
        drawn, alone, truth = (_maps(ln) for ln in (of_photo.ln_radiance, of_object.ln_radiance, batch["truth"]))
        present = batch["context"][:, 4].amax(dim=(1, 2)).cpu().numpy() > 0
        true_pitch = np.arcsin(batch["up"][:, 2].cpu().numpy().clip(-1, 1))
        pitch = np.degrees(np.abs(of_photo.posture[:, 0].float().cpu().numpy() - true_pitch))
        for k in range(len(truth)):
            if present[k]:
                rows.append((FAMILIES[int(batch["family"][k])], *_figures(drawn[k], truth[k]), pitch[k]))
            else:
                rows.append((CUT_OUT, *_figures(drawn[k], truth[k]), np.nan))
                rows.append((ALONE, *_figures(alone[k], truth[k]), np.nan))
    net.train(was_training)
    group = np.array([row[0] for row in rows])
    rmse, angle, power, hard, ours_hard, false, red, blue, pitch = np.array([row[1:] for row in rows]).T
    whole = (group != CUT_OUT) & (group != ALONE)
    hardest = whole & (hard >= np.quantile(hard[whole], 2 / 3))
    scores = {
        "ldr_rmse": rmse[whole].mean(),
        "dominant_deg": np.median(angle[whole]),
        "dominant_mean_deg": angle[whole].mean(),
        "dominant_hardest_deg": np.median(angle[hardest]),
        "power_abs": np.abs(power[whole]).mean(),
        "power": power[whole].mean(),
        "false_sources": false[whole].mean(),
        "pitch_deg": np.nanmedian(pitch),
    }
    for name in (*FAMILIES, CUT_OUT, ALONE):
        some = group == name
        if some.any():
            scores |= {f"{name}_ldr_rmse": rmse[some].mean(), f"{name}_dominant_deg": np.median(angle[some])}
    for name, some in (("whole", whole), (CUT_OUT, group == CUT_OUT), (ALONE, group == ALONE)):
        if some.any():
            scores |= {f"{name}_red": np.median(red[some]), f"{name}_blue": np.median(blue[some])}
        if some.sum() > 2:
            scores[f"{name}_hardness"] = np.corrcoef(ours_hard[some], hard[some])[0, 1]
    return {name: round(float(value), 4) for name, value in scores.items()}


def _maps(ln_radiance: torch.Tensor) -> np.ndarray:
    """Return maps [N, H, 2H, 3] of ln radiance [N, 3, H, 2H]."""
    return torch.exp(ln_radiance.float()).permute(0, 2, 3, 1).cpu().numpy()


def _sum(radiance: np.ndarray) -> np.ndarray:
    """Return all light [3] of a map."""
    return np.maximum((radiance * pixel_solid_angles(MAP_HEIGHT)[..., None]).sum(axis=(0, 1)), 1e-9)


def _figures(radiance: np.ndarray, truth: np.ndarray) -> tuple[float, ...]:
    """Return LDR RMSE, the dominant light's angle, power [stops], the share of all power that arrives from the dominant
    light's side, true and estimated, how many sources are false, and the errors of ln red and ln blue over green."""
    weights = pixel_solid_angles(MAP_HEIGHT)
    light, main = find_dominant_light(radiance), find_dominant_light(truth)
    ours, true = (max(float((luminance(one) * weights).sum()), 1e-9) for one in (radiance, truth))
    red, green, blue = np.log(_sum(radiance) / _sum(truth))
    error = float(np.sqrt(np.mean((response(radiance) - response(truth)) ** 2)))
    return (
        error,
        direction_error_deg(light.direction, main.direction),
        float(np.log2(ours / true)),
        float(luminance(main.irradiance)) / true,
        float(luminance(light.irradiance)) / ours,
        float(false_sources(find_sources(radiance), radiance, truth)),
        float(red - green),
        float(blue - green),
    )
