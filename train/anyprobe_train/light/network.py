"""The light network: what a photo shows, of the object and beside it -> the light, in the photo's camera frame.

Two towers of plain convolutions see the object's crop and the whole photo; what the object reflects is lifted to the
directions that it comes from, what the photo shows lies on the sphere, and a small decoder on the sphere, whose last
step sees every seen pixel, says the map. Frame: +X right, +Y up, the camera looks along -Z.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.light.environment import MAP_HEIGHT
from anyprobe_train.light.drawing import LN_MOST, SLOTS, MapDrawing, directions_of, pictured_directions
from anyprobe_train.light.object_map import ObjectMap
from anyprobe_train.light.shape import SIDE, CropFrame, ShapeNet, facing, middles, plane_of, turned_back, turned_towards
from anyprobe_train.light.shown import inverse_display
from anyprobe_train.nets.blocks import conv, two_layers, wrap

PICTURE_PX = 96
"""Side of the crop's and of the context's picture [pixels]."""
NORMALS_SIDE = 48
"""Side of the picture of the normals."""
GLOSSY_ROWS, MATTE_ROWS = MAP_HEIGHT // 4, MAP_HEIGHT // 8
"""Rows of the two grids on the sphere that reflections are lifted to."""
LIFTED = 19
"""Channels that are lifted: display RGB and features."""
GLOSSY, MATTE = 60.0, 12.0
"""Sharpness of the lifting [1/(1 - cos)] along mirror directions, and along normals."""
LN_NOTHING = -20.0
"""Logarithm of a weight that is as good as none."""
NEAREST = 300.0
"""Sharpness of the nearest seen place: places a few degrees further count less than half."""
SEEN_COVER, LEAST_NEARNESS = 0.05, 1e-300
"""Cover from which on a place counts as seen, and least sum of weights of which a mean is made."""
FIRST_LN = -1.2
"""ln radiance before training: about the mean over photos."""
LN_FLOOR = 0.01
"""Added to radiance before its logarithm."""
CODE_LENGTH, LAID_CHANNELS = 256, 24
"""Numbers that the towers say of the whole photo, and channels of the sphere that they are laid on."""
DROPPED = 0.1
"""Share of those numbers that a step of training goes without."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LightInputs:
    """Inputs of LeanNet, float32; display values in [0, 1].

    context [N, 5, 96, 96]: RGB, mask, cover; crop [N, 4, 96, 96]: RGB x mask, mask; picture [N, 4, 128, 128]: the same,
    finer; seen [N, 4, 64, 128]: RGB x cover, cover; lens [N, 5]: tangent of half the context's field, the crop's centre
    (right, up) and half its side on the image plane, 1 where the lens is known. Zero where not given: up [N, 3],
    normals [N, 3, 48, 48] over the crop, material [N, 8] of materials.material_input, sun [N, 3].
    """

    context: torch.Tensor
    crop: torch.Tensor
    picture: torch.Tensor
    seen: torch.Tensor
    lens: torch.Tensor
    up: torch.Tensor
    normals: torch.Tensor
    material: torch.Tensor
    sun: torch.Tensor


@dataclass(frozen=True, kw_only=True, slots=True)
class LightAnswer:
    """Outputs of LeanNet; angles in radians but for those named in degrees.

    ln_shown [N, 3, 64, 128]: ln radiance, which counts up to white. ln_power [N, 3]: ln(all power above white +
    POWER_FLOOR) [sr].
    density [N, 1, 64, 128]: ln of that power's density up to a constant. places [N, S, 2048]: ln of the probability
    that source S is in a pixel of 32 rows. Of the sources: exists [N, S] logit, directions [N, S, 3], ln_radius [N, S]
    [degrees], ln_powers [N, S, 3] with POWER_FLOOR. ln_radiance: the map drawn, ln_expected: all power by its density.
    confidence [N, 1, 64, 128] logit. soft [N] logit of no source dominating. errors [N, 3]: ln of the mean errors of
    the dominant direction [tens of degrees], of ln level, of the mean colour [tens of degrees]. posture [N, 3]: pitch,
    ln of its error, roll. lens [N, 2]: ln tangent of half the longer side's field, ln of its error. outdoors [N] logit.
    believed [N]: share of what is seen that the map goes on from. normals [N, 3, 48, 48]: unit, camera frame.
    material [N, 5]: logit of a metal, ln reflectance RGB, ln of its error.
    """

    ln_shown: torch.Tensor
    ln_power: torch.Tensor
    density: torch.Tensor
    places: torch.Tensor
    exists: torch.Tensor
    directions: torch.Tensor
    ln_radius: torch.Tensor
    ln_powers: torch.Tensor
    ln_radiance: torch.Tensor
    ln_expected: torch.Tensor
    confidence: torch.Tensor
    soft: torch.Tensor
    errors: torch.Tensor
    posture: torch.Tensor
    lens: torch.Tensor
    outdoors: torch.Tensor
    believed: torch.Tensor
    normals: torch.Tensor
    material: torch.Tensor


class SphereConv(nn.Sequential):
    """`conv` on the sphere: columns go on beyond the seam."""

    def __init__(self, inputs: int, outputs: int, stride: int = 1) -> None:
        convolution = nn.Conv2d(inputs, outputs, 3, stride, (1, 0), bias=False)
        super().__init__(convolution, nn.BatchNorm2d(outputs), nn.LeakyReLU(0.1, inplace=True))

    def forward(self, x: torch.Tensor) -> torch.Tensor:  # type: ignore[override]
        return super().forward(wrap(x, 1))


class Tower(nn.Module):
    """Picture [N, C, 96, 96] -> features [N, widths[1], 24, 24] and [N, widths[2], 12, 12], and a code [N, code]."""

    def __init__(self, channels: int, widths: tuple[int, int, int, int], code: int) -> None:
        super().__init__()
        first, fine, middle, deep = widths
        self.first = nn.Sequential(conv(channels, first, stride=2), conv(first, fine, stride=2))
        self.fine = conv(fine, fine)
        self.middle = nn.Sequential(conv(fine, middle, stride=2), conv(middle, middle))
        self.deep = nn.Sequential(conv(middle, deep, stride=2), conv(deep, deep))
        self.code = nn.Sequential(nn.Flatten(), nn.Linear(deep * (PICTURE_PX // 16) ** 2, code), nn.LeakyReLU(0.1))

    def forward(self, picture: torch.Tensor, beside: torch.Tensor | None = None) -> tuple[torch.Tensor, ...]:
        fine = self.first(picture)
        fine = self.fine(fine if beside is None else fine + beside)
        middle = self.middle(fine)
        return fine, middle, self.code(self.deep(middle).contiguous())


class LeanNet(nn.Module):
    """LightInputs -> LightAnswer."""

    fine_directions: torch.Tensor
    lift_directions: torch.Tensor
    coarse_directions: torch.Tensor
    middle_of: torch.Tensor

    def __init__(self) -> None:
        super().__init__()
        context, crop = (12, 24, 56, 112), (16, 32, 72, 112)
        last, decoded, fine, coarse, middle = 16, 40, 32, 64, 80
        self.context = Tower(5 + 3, context, 192)
        self.crop = Tower(4 + 2, crop, CODE_LENGTH)
        self.frame, self.shape, self.alone = CropFrame(), ShapeNet(), ObjectMap()
        self.of_normals = nn.Conv2d(5, crop[1], 1)
        self.up_crop = nn.Conv2d(crop[2], crop[1], 1)
        self.surface = conv(crop[1], crop[1])
        self.features = nn.Conv2d(crop[1], LIFTED - 3, 3, padding=1)
        self.together = nn.Sequential(nn.Linear(192 + CODE_LENGTH + 5 + 3 + 8 + 3 + 1, CODE_LENGTH), nn.LeakyReLU(0.1))
        self.posture = nn.Linear(CODE_LENGTH, 3)
        near = 5 + 3 + 2
        self.start = nn.Sequential(nn.Linear(CODE_LENGTH, LAID_CHANNELS * 2 * MATTE_ROWS**2), nn.LeakyReLU(0.1))
        self.enter = SphereConv(16 + near, fine, stride=2)
        self.lifted = SphereConv(fine + LIFTED + 1, fine)
        self.down = SphereConv(fine, coarse, stride=2)
        self.middle = nn.Sequential(SphereConv(coarse + LIFTED + 1 + LAID_CHANNELS, middle), SphereConv(middle, middle))
        self.summary = nn.Sequential(nn.Conv2d(middle, 8, 1), nn.LeakyReLU(0.1), nn.Flatten())
        self.up1 = nn.Conv2d(middle, decoded, 1)
        self.skip = nn.Conv2d(fine, decoded, 1)
        self.decode = SphereConv(decoded, decoded)
        self.up2 = nn.Conv2d(decoded, last, 1)
        self.last = SphereConv(last + 16 + near, last)
        self.head = nn.Conv2d(last, 4 * 6 + SLOTS, 1)
        said = CODE_LENGTH + 8 * 2 * MATTE_ROWS**2
        self.of_light = two_layers(said, 3 + 5 * SLOTS + 1 + 3, 128)
        self.of_photo = two_layers(said, 2 + 1 + 5, 64)
        self.drawing = MapDrawing()
        self.register_buffer("fine_directions", pictured_directions(MAP_HEIGHT // 2), persistent=False)
        self.register_buffer("lift_directions", directions_of(GLOSSY_ROWS), persistent=False)
        self.register_buffer("coarse_directions", directions_of(MATTE_ROWS), persistent=False)
        self.register_buffer("middle_of", middles(PICTURE_PX), persistent=False)
        with torch.no_grad():
            for layer in (self.head, self.posture, self.of_light[2], self.of_photo[2]):
                for parameter in layer.parameters():
                    parameter.mul_(0.3)

    def forward(self, inputs: LightInputs) -> LightAnswer:
        half, center, side, known = inputs.lens.split([1, 2, 1, 1], dim=1)
        rays = plane_of(self.middle_of * half)
        is_known = known[:, :, None, None].expand(-1, 1, PICTURE_PX, PICTURE_PX)
        crop_rays = plane_of(self.middle_of * side) + center[:, :, None, None]
        _, _, seen_code = self.context(_last(torch.cat([inputs.context, rays, is_known], dim=1)))
        frame = self.frame(center, side)
        n = self.shape(inputs.picture, *frame[1:])
        with torch.autocast(n.device.type, enabled=False):
            small = F.interpolate(n, size=(NORMALS_SIDE, NORMALS_SIDE), mode="bilinear", align_corners=False)
            estimated = F.normalize(turned_towards(small, frame[0]), dim=1)
            known = (inputs.normals.square().sum(dim=1, keepdim=True) > 0.25).float()
            normals = known * inputs.normals + (1 - known) * estimated.detach()
            inside = F.avg_pool2d(inputs.crop[:, 3:], PICTURE_PX // NORMALS_SIDE)
            shape = F.avg_pool2d(torch.cat([normals * inside, inside, known], dim=1), 2)
        fine, middle, code = self.crop(_last(torch.cat([inputs.crop, crop_rays], dim=1)), self.of_normals(shape))
        surface = self.surface(fine + F.interpolate(self.up_crop(middle), scale_factor=2.0, mode="nearest"))
        features = self.features(surface)
        present = inputs.crop[:, 3:].amax(dim=(2, 3))
        sun_given = inputs.sun.square().sum(dim=1, keepdim=True)
        hints = torch.cat([inputs.lens, inputs.up, inputs.material, inputs.sun, present], dim=1)
        code = self.together(F.dropout(torch.cat([seen_code, code, hints], dim=1), DROPPED, self.training))
        alone = self._alone(inputs, frame, n, known)
        posture = self.posture(code).float()
        with torch.autocast(code.device.type, enabled=False):  # a cosine of eight bits is degrees off
            weights = self._lifting(normals, crop_rays)
            near = self._near(inputs, posture, sun_given)
        glossy, matte = self._lift(inputs.crop, features, weights)
        beside = torch.cat([F.pixel_unshuffle(inputs.seen, 2), near], dim=1)
        grid = self.start(code).unflatten(1, (LAID_CHANNELS, MATTE_ROWS, 2 * MATTE_ROWS))
        x = self.lifted(_last(torch.cat([self.enter(_last(beside)), glossy], dim=1)))
        skip = self.skip(x)
        x = self.middle(_last(torch.cat([self.down(x), matte, grid], dim=1)))
        said = torch.cat([code, self.summary(x)], dim=1)
        x = self.decode(F.interpolate(self.up1(x), scale_factor=2.0, mode="nearest") + skip)
        x = F.interpolate(self.up2(x), scale_factor=2.0, mode="nearest")
        out = self.head(self.last(_last(torch.cat([x, beside], dim=1))))
        light, photo = self.of_light(said).float(), self.of_photo(said).float()
        with torch.autocast(code.device.type, enabled=False):
            return self._answer(inputs, out.float(), near, light, photo, posture, estimated, alone)

    def _alone(self, inputs, frame, n, known) -> torch.Tensor:
        """Return what the object alone shows, by given normals [N, 3, 48, 48] where they are known [N, 1, 48, 48]."""
        with torch.autocast(n.device.type, enabled=False):
            given = turned_back(inputs.normals, frame[0])
            given, known = (F.interpolate(one, size=(SIDE, SIDE), mode="nearest") for one in (given, known))
            normals = F.normalize(known * given + (1 - known) * n.detach(), dim=1)
        return self.alone(inputs.picture, frame, normals, known, inputs.material)

    def _lifting(self, normals: torch.Tensor, crop_rays: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return how much each of the P = 24 * 24 points of the crop counts in each direction: along those that they
        mirror [N, 512, P], and along their normals [N, 128, P]."""
        n = F.normalize(F.avg_pool2d(normals, 2), dim=1).flatten(2)  # [N, 3, P]
        wo = facing(F.avg_pool2d(crop_rays, 4)).flatten(2)
        wi = 2.0 * (n * wo).sum(dim=1, keepdim=True) * n - wo

        def weights(about: torch.Tensor, to: torch.Tensor, sharpness: float) -> torch.Tensor:
            to = torch.cat([to, -torch.ones_like(to[:, :1])], dim=1)
            closeness = sharpness * to @ torch.cat([about, torch.ones_like(about[:, :1])], dim=1)
            return closeness.clamp_(min=LN_NOTHING).exp_()  # without bounds four times as slow

        return weights(wi, self.lift_directions, GLOSSY), weights(n, self.coarse_directions, MATTE)

    def _lift(
        self, crop: torch.Tensor, features: torch.Tensor, weights: tuple[torch.Tensor, torch.Tensor]
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return means over the object's points by `_lifting`, [N, C, 16, 32] and [N, C, 8, 16]; the last channel says
        how much of the object there is."""
        small = F.avg_pool2d(crop, 4).flatten(2)
        mask = small[:, 3:]
        values = torch.cat([small[:, :3], features.flatten(2) * mask, mask], dim=1).transpose(1, 2)  # [N, P, C]
        grids = []
        for weight, rows in zip(weights, (GLOSSY_ROWS, MATTE_ROWS), strict=True):
            sums = weight @ values
            inside = sums[..., -1:]
            means = torch.cat([sums[..., :-1] / (inside + 0.1), torch.log1p(inside) / 4.0], dim=2)
            grids.append(means.transpose(1, 2).unflatten(2, (rows, 2 * rows)))
        return grids[0], grids[1]

    def _near(self, inputs: LightInputs, posture: torch.Tensor, sun_given: torch.Tensor) -> torch.Tensor:
        """Return [N, 10, 32, 64]: the nearest seen place's display RGB, its angle over pi, whether anything is seen at
        all; each pixel's direction; how far it is up; how near it is to a given sun."""
        coarse = F.avg_pool2d(inputs.seen, MAP_HEIGHT // GLOSSY_ROWS).flatten(2)  # [N, 4, P]
        cover = coarse[:, 3]
        colors = coarse[:, :3] / cover[:, None].clamp(min=SEEN_COVER)
        d = self.lift_directions
        of_each = torch.cat([colors.transpose(1, 2), d.expand(len(cover), -1, -1)], dim=2).double()
        seen = (cover * (cover >= SEEN_COVER).float())[..., None].double()
        again = d + 0.0 * cover[0, 0]  # exports fold nothing of it into a constant of two megabytes
        nearness = torch.exp(NEAREST * ((again @ again.T).double() - 1.0))  # down to 1e-261
        sums = nearness @ torch.cat([seen * of_each, seen], dim=2)
        found = (sums[..., :-1] / sums[..., -1:].clamp(min=LEAST_NEARNESS)).float()
        angle = torch.acos((found[..., 3:] * d).sum(dim=2).clamp(-1 + 1e-6, 1 - 1e-6)) / torch.pi
        near = (
            torch.cat([found[..., :3], angle[..., None]], dim=2)
            .transpose(1, 2)
            .unflatten(2, (GLOSSY_ROWS, 2 * GLOSSY_ROWS))
        )
        near = F.interpolate(wrap(near, 1), scale_factor=2.0, mode="bilinear", align_corners=False)[..., 2:-2]
        some = (cover.amax(dim=1) >= SEEN_COVER).float()[:, None, None, None].expand_as(near[:, :1])
        pitch, _, roll = posture.detach().split(1, dim=1)
        guess = torch.cat([pitch.cos() * roll.sin(), pitch.cos() * roll.cos(), pitch.sin()], dim=1)
        given = (inputs.up.square().sum(dim=1, keepdim=True) > 0.5).float()
        up = given * inputs.up + (1 - given) * guess
        directions = self.fine_directions.expand(len(up), -1, -1, -1)
        rise = (up[:, :, None, None] * directions).sum(dim=1, keepdim=True)
        sun = torch.exp(20.0 * ((inputs.sun[:, :, None, None] * directions).sum(dim=1, keepdim=True) - 1.0))
        return torch.cat([near * some, some, directions, rise, sun * sun_given[:, :, None, None]], dim=1)

    def _answer(self, inputs, out, near, light, photo, posture, normals, alone) -> LightAnswer:
        """Make the answer of the head's channels [N, 6 * 4 + S, 32, 64] and of what the two small heads say."""
        of_map, slots = out.split([24, SLOTS], dim=1)
        of_map = F.pixel_shuffle(of_map, 2)
        cover = inputs.seen[:, 3:]
        nearest = F.interpolate(near[:, :3], scale_factor=2.0, mode="nearest")
        shown_there = inverse_display(inputs.seen[:, :3] + (1 - cover) * nearest)
        some = F.interpolate(near[:, 4:5], scale_factor=2.0, mode="nearest")
        goes_on = torch.sigmoid(of_map[:, 5:6] + 4.0 * cover - 2.0) * some
        own = torch.exp((of_map[:, :3] + FIRST_LN).clamp(max=LN_MOST))
        believed = (goes_on * cover).sum(dim=(1, 2, 3)) / cover.sum(dim=(1, 2, 3)).clamp(min=1.0)
        beside = (inputs.context[:, 4:] - inputs.context[:, 3:4]).amax(dim=(1, 2, 3), keepdim=True).clamp(0.0, 1.0)
        given = (1 - beside) * goes_on  # from a panorama
        share = believed[:, None, None, None] * beside
        shown = (1 - goes_on) * own + goes_on * shown_there
        ln_shown = torch.log(share * shown + (1 - share) * ((1 - given) * alone + given * shown_there) + LN_FLOOR)
        ln_power, exists, ln_radius, ln_powers, soft, errors = light.split([3, SLOTS, SLOTS, 3 * SLOTS, 1, 3], dim=1)
        lens, outdoors, material = photo.split([2, 1, 5], dim=1)
        density = of_map[:, 3:4]
        places = self.drawing.places(density, slots)
        ln_power, ln_powers = ln_power - 0.5, ln_powers.unflatten(1, (SLOTS, 3)) - 1.0
        ln_radius = ln_radius + float(np.log(8.0))
        directions = self.drawing.directions(places.detach(), density.detach())
        radiance, expected = self.drawing(ln_shown, ln_power, density, directions, exists, ln_radius, ln_powers, places)
        return LightAnswer(
            ln_shown=ln_shown,
            ln_power=ln_power,
            density=density,
            places=places,
            exists=exists,
            directions=directions,
            ln_radius=ln_radius,
            ln_powers=ln_powers,
            ln_radiance=torch.log(radiance),
            ln_expected=torch.log(expected),
            confidence=of_map[:, 4:5],
            soft=soft[:, 0],
            errors=errors,
            posture=posture,
            lens=torch.cat([lens[:, :1] + float(np.log(np.tan(np.radians(30.0)))), lens[:, 1:] - 2.0], dim=1),
            outdoors=outdoors[:, 0],
            believed=believed,
            normals=normals,
            material=material,
        )


def _last(x: torch.Tensor) -> torch.Tensor:
    return x.contiguous(memory_format=torch.channels_last)
