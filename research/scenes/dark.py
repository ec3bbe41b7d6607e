"""What dark surroundings are worth: errors of the dominant light with and without them, by how dark they are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.estimate.runtime import WHOLE, WHOLE_INPUTS, Models
from anyprobe.evaluate.metrics import direction_error_deg
from anyprobe.light.dominant_light import find_dominant_light
from research.scenes.layouts import FAMILIES

BOUNDS = (0.0, 0.2, 0.35, 0.5, 0.7, 1.0, 2.0, np.inf)
"""Of the mean display luminance beside the object over the object's."""
LEAST_PX = 50


def dark_rows(files: Sequence[Path], models: Models) -> Iterator[tuple[int, float, float, float]]:
    """Yield family, darkness beside the object, and angles [degrees] between the true dominant light and that of the
    object alone and of the whole photo, for each pair with surroundings."""
    for path in files:
        with np.load(path) as stored:
            part = {name: stored[name] for name in stored.files if name != "scene"}
        for k in range(len(part["up"])):
            context, crop = part["context"][k] / np.float32(255), part["image"][k] / np.float32(255)
            inside = crop[..., 3] > 0.5
            beside = (context[..., 4] > 0.5) & (context[..., 3] < 0.02)
            if beside.sum() < LEAST_PX or not inside.any():
                continue
            own = luminance(crop[inside][:, :3] / crop[inside][:, 3:]).mean()
            lift = part["lift"][k][None].astype(np.float32)
            given = {
                "context": context.transpose(2, 0, 1)[None],
                "tan_half": part["tan_half"][k].reshape(1, 1),
                "alone_expected": lift[:, :3],
                "alone_radiance": lift[:, 3:6],
                "alone_confidence": lift[:, 6:],
                "posterior": part["posterior"][k][None],
                "surroundings": part["surroundings"][k][None].astype(np.float32) / 255,
                "up": np.zeros((1, 3), np.float32),
            }
            drawn, *_ = models._run[WHOLE](*(given[name] for name in WHOLE_INPUTS))
            truth = _main(part["truth"][k].astype(np.float32))
            errors = (direction_error_deg(_main(one), truth) for one in (lift[0, 3:6], drawn[0]))
            yield int(part["family"][k]), float(luminance(context[beside][:, :3]).mean() / max(own, 1e-3)), *errors


def _main(ln_radiance: np.ndarray) -> np.ndarray:
    """Return the dominant light's direction of a map [3, H, 2H]."""
    return find_dominant_light(np.exp(ln_radiance).transpose(1, 2, 0)).direction


def dark_table(rows: np.ndarray) -> Iterator[str]:
    """Yield lines of medians and means by darkness, and by family."""
    for low, high in zip(BOUNDS[:-1], BOUNDS[1:], strict=True):
        some = rows[(rows[:, 1] >= low) & (rows[:, 1] < high)]
        if len(some):
            yield f"beside / object {low:.2f} to {high:.2f}: {_said(some)}"
    for number, family in enumerate(FAMILIES):
        some = rows[rows[:, 0] == number]
        if len(some):
            share = (some[:, 1] < BOUNDS[2]).mean()
            yield f"{family}: {_said(some)}, {100 * share:.0f} % below {BOUNDS[2]}"


def _said(rows: np.ndarray) -> str:
    alone, whole = rows[:, 2], rows[:, 3]
    figures = (f"{np.median(one):.1f} / {one.mean():.1f}" for one in (alone, whole))
    return "{} photos, dominant light median / mean: object alone {}, whole photo {}".format(len(rows), *figures)
