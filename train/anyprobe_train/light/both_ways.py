"""The answer to a photo and to its mirror image, as one: mirrored photos give mirrored answers."""

from dataclasses import fields, replace
from itertools import permutations

import torch
from torch.nn import functional as F

from anyprobe_train.light.drawing import SLOTS, SOURCE_ROWS
from anyprobe_train.light.network import LeanNet, LightAnswer, LightInputs
from anyprobe_train.light.pictured import mirrored_inputs, other_side
from anyprobe_train.world.batch import fieldwise

ORDERS = tuple((0, *others) for others in permutations(range(1, SLOTS)))
"""Orders of the mirror image's sources. The first stays the first, as it is drawn in any case: else it would be the
photo's own, and that of the mirrored photo another."""


def both_ways(net: LeanNet, inputs: LightInputs) -> LightAnswer:
    """Return the mean of the answers to photos and to their mirror images, drawn anew; one batch of twice the size.

    Sources of the mirror image are those whose places are most alike.
    """
    other = mirrored_inputs(inputs)
    both = fieldwise(lambda here, there: torch.cat([here, there]), inputs, other)
    answer, count = net(both), len(inputs.lens)

    def half(rows: slice) -> dict[str, torch.Tensor]:
        return {one.name: getattr(answer, one.name)[rows] for one in fields(LightAnswer)}

    ours, theirs = half(slice(0, count)), half(slice(count, None))
    for name in ("ln_shown", "density", "confidence"):
        theirs[name] = theirs[name].flip(3)
    theirs["normals"] = other_side(theirs["normals"])
    theirs["posture"] = theirs["posture"] * theirs["posture"].new_tensor([1.0, 1.0, -1.0])
    theirs["places"] = theirs["places"].unflatten(2, (SOURCE_ROWS, 2 * SOURCE_ROWS)).flip(3).flatten(2)
    order = _alike(ours["places"], theirs["places"])
    for name in ("places", "exists", "ln_radius", "ln_powers"):
        theirs[name] = (
            order @ theirs[name].flatten(2 if theirs[name].dim() > 2 else 1).view(count, SLOTS, -1)
        ).view_as(theirs[name])
    mean = {name: (ours[name] + theirs[name]) / 2.0 for name in ours}
    mean["places"] = torch.log((torch.exp(ours["places"]) + torch.exp(theirs["places"])) / 2.0 + 1e-12)
    mean["normals"] = F.normalize(mean["normals"], dim=1)
    drawing = net.drawing
    mean["directions"] = drawing.directions(mean["places"], mean["density"])
    drawn = ("ln_shown", "ln_power", "density", "directions", "exists", "ln_radius", "ln_powers", "places")
    radiance, expected = drawing(*(mean[name] for name in drawn))
    return replace(LightAnswer(**mean), ln_radiance=torch.log(radiance), ln_expected=torch.log(expected))


def _alike(ours: torch.Tensor, theirs: torch.Tensor) -> torch.Tensor:
    """Return the permutation matrices [N, S, S] that bring their sources' places [N, S, P] to ours."""
    likeness = torch.exp(ours / 2) @ torch.exp(theirs / 2).transpose(1, 2)
    choices = torch.eye(SLOTS, device=ours.device)[torch.tensor(ORDERS, device=ours.device)]  # [K, S, S]
    total = torch.einsum("nst,kst->nk", likeness, choices)
    return choices[total.argmax(dim=1)]
