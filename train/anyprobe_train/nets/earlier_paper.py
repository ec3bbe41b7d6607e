"""The paper's three networks: irradiance (Fig. 5), illumination (Fig. 8) and HDR (Fig. 9).

Stages and their inputs are the paper's, and so is the code between object and map; layers are ours. Pixels are folded
into channels before the first convolution, and the field of view is an input: what a normal mirrors depends on it.
Beside the code, what places of the object show is lifted to where it came from, as in `lift`, whose layers these are.
"""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.response import ln_inverse_response
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.paper.equations import blend_weight
from anyprobe_train.nets.blocks import UNet, wrap
from anyprobe_train.nets.lifting import CameraRays, NormalsNet, lift_to_map, map_pixel, mirror_direction, pyramid
from anyprobe_train.nets.light_net import MEAN_LN, SCALES, SphereNet, display

WIDTHS = (16, 32, 64, 128, 192)
"""Widths of the layers that see the object, as in light_net.ObjectNet: 64 x 64 to 4 x 4 pixels."""


class EarlierIrradianceNet(nn.Module):
    """photo [N, 4, 128, 128] (display RGB times mask, mask), tan_half [N, 1] -> display irradiance [N, 3, 128, 128].

    Zero outside the mask; values are in [0, 1] up to the network's error.
    """

    def __init__(self) -> None:
        super().__init__()
        self.camera_rays = CameraRays()
        self.unet = UNet(4, 2, WIDTHS)
        self.head = nn.Conv2d(WIDTHS[0], 3 * 4, 3, padding=1)

    def forward(self, photo: torch.Tensor, tan_half: torch.Tensor) -> torch.Tensor:
        slope, _ = self.camera_rays(tan_half)
        x, _ = self.unet(photo, slope)
        return (photo[:, :3] + F.pixel_shuffle(self.head(x), 2)) * photo[:, 3:]


class EarlierIlluminationNet(nn.Module):
    """image [N, 4, 128, 128] (irradiance, mask), tan_half [N, 1] -> LDR map [N, 3, 64, 128] in [0, 1].

    What the whole object shows passes through one vector (`code` numbers), as in the paper. Beside it, what each of
    64 x 64 places shows is lifted to the direction that it mirrors, by normals that are estimated from the image too;
    both are completed on the sphere, with layers and weights of `lift` (nets.light_net).
    """

    FEATURES = 8

    def __init__(self, code: int = 192) -> None:
        super().__init__()
        self.camera_rays = CameraRays()
        self.normals = NormalsNet(whole=64)
        self.places = UNet(4, 2 + 3, WIDTHS)
        self.head = nn.Conv2d(WIDTHS[0], 1 + self.FEATURES, 3, padding=1)
        self.code = nn.Sequential(nn.Flatten(), nn.Linear(WIDTHS[-1] * 16, code), nn.LeakyReLU(0.1))
        self.sphere = SphereNet(3 + 1, 3 + self.FEATURES + 1, code, outputs=3, surroundings=False)

    def forward(self, image: torch.Tensor, tan_half: torch.Tensor) -> torch.Tensor:
        return self.shown_and_normals(image, tan_half)[0].clip(max=1.0)

    def shown_and_normals(self, image: torch.Tensor, tan_half: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the map before it clips at 1, and the object's unit normals [N, 3, 64, 64]."""
        slope, wo = self.camera_rays(tan_half)
        n = self.normals(image, slope, wo)
        x, deepest = self.places(image, torch.cat([slope, n], dim=1))
        weight, features = self.head(x).float().split([1, self.FEATURES], dim=1)
        inside = F.avg_pool2d(image[:, 3:], 2)
        values = torch.cat([F.avg_pool2d(image[:, :3], 2) / (inside + 1e-4), features], dim=1)
        pixel = map_pixel(mirror_direction(n, wo).detach(), MAP_HEIGHT)
        scales = pyramid(lift_to_map(values, torch.sigmoid(weight) * inside, pixel, MAP_HEIGHT), SCALES)
        scales[0] = torch.cat([scales[0][:, :3], scales[0][:, -1:]], dim=1)
        return display(self.sphere(scales, self.code(deepest)).float() * 2 + MEAN_LN), n


class EarlierHdrNet(nn.Module):
    """LDR map [N, 3, 64, 128] in [0, 1] -> ln radiance [N, 3, 64, 128].

    What is not white is what the LDR map says, H = ln f^-1(U); the layers tell how far above that white is. Eq. 8's
    weight, squared, leads from one to the other: without it Eq. 7 whitens much that is only likely to be white.
    """

    MARGIN = 16
    """Columns repeated beyond the seam, on both sides."""
    DARKEST = 1e-3
    """Smallest display value; darker ones count as this."""

    def __init__(self, widths: tuple[int, ...] = (24, 48, 64, 96)) -> None:
        super().__init__()
        self.unet = UNet(3, 0, widths)
        self.head = nn.Conv2d(widths[0], 3 * 4, 1)

    def forward(self, ldr: torch.Tensor) -> torch.Tensor:
        x, _ = self.unet(wrap(ldr, self.MARGIN))
        white = F.pixel_shuffle(self.head(x), 2)[..., self.MARGIN : -self.MARGIN].float()
        shown = ln_inverse_response(ldr.float().clip(min=self.DARKEST))
        return shown + blend_weight(ldr.float(), axis=1) ** 2 * (white - shown)


NETS = {"irradiance": EarlierIrradianceNet, "illumination": EarlierIlluminationNet, "hdr": EarlierHdrNet}
"""Networks by stage; each reads the output of the one before."""
