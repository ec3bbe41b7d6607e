"""Networks: shapes, the sphere's seam, and that they can learn at all."""

import math

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.core.response import inverse_response  # noqa: E402
from anyprobe_train.nets.blocks import FoldedConv  # noqa: E402
from anyprobe_train.nets.earlier_paper import EarlierHdrNet, EarlierIlluminationNet, EarlierIrradianceNet  # noqa: E402


def test_each_net_gives_the_size_the_next_one_takes():
    photo, tan_half = torch.rand(2, 4, 128, 128), torch.rand(2, 1)
    irradiance = EarlierIrradianceNet()(photo, tan_half)
    assert irradiance.shape == (2, 3, 128, 128)
    ldr = EarlierIlluminationNet()(torch.cat([irradiance, photo[:, 3:]], dim=1), tan_half)
    assert ldr.shape == (2, 3, 64, 128)
    assert ldr.min() >= 0
    assert ldr.max() <= 1
    assert EarlierHdrNet()(ldr).shape == (2, 3, 64, 128)


def test_what_a_place_shows_is_lifted_to_where_it_mirrors(monkeypatch):
    """Normals to the right of a far camera mirror what is behind the object."""
    net, seen = EarlierIlluminationNet().eval(), []
    with torch.no_grad():
        for parameter in net.normals.head.parameters():
            parameter.zero_()
        net.normals.head.bias[0] = 1e4  # x
    monkeypatch.setattr(net.sphere, "forward", lambda scales, code: seen.append(scales) or torch.zeros(1, 3, 64, 128))
    image = torch.full((1, 4, 128, 128), 0.5)
    image[:, 3] = 1.0
    _, normals = net.shown_and_normals(image, torch.full((1, 1), 1e-3))
    torch.testing.assert_close(normals[0, :, 5, 5], torch.tensor([1.0, 0.0, 0.0]), atol=1e-3, rtol=0)
    (scales,) = seen
    assert [scale.shape[2:] for scale in scales] == [(64 >> k, 128 >> k) for k in range(5)]
    assert [scale.shape[1] for scale in scales] == [4, 12, 12, 12, 12]
    share = scales[2][0, -1].sum(dim=0)
    assert share[15:17].sum() > 0.99 * share.sum() > 0.5, "along -Z"
    shown = scales[2][0, :3].flatten(1).amax(dim=1)
    torch.testing.assert_close(shown, torch.full((3,), 0.5), atol=2e-3, rtol=0)


def test_irradiance_is_empty_outside_the_mask():
    photo = torch.rand(1, 4, 128, 128)
    photo[:, 3, :, :64] = 0
    assert EarlierIrradianceNet()(photo, torch.ones(1, 1))[..., :64].abs().max() == 0


def test_hdr_net_sees_across_the_seam():
    """Turning the map turns the answer: no column is special."""
    torch.manual_seed(0)
    net = EarlierHdrNet().eval()
    ldr = torch.rand(1, 3, 64, 128)
    turned = net(torch.roll(ldr, 64, dims=3))
    difference = (torch.roll(turned, -64, dims=3) - net(ldr)).abs().max()
    assert difference < 5e-4, ".04 without the columns beyond the seam"


def test_hdr_net_changes_nothing_that_is_not_white():
    """Up to Eq. 8's threshold the radiance is that of the LDR map, whatever the layers say; at white it is theirs."""
    net = EarlierHdrNet().eval()
    with torch.no_grad():
        net.head.weight.zero_()
        net.head.bias.fill_(5.0)
        ldr = torch.rand(1, 3, 64, 128) * 0.79
        known = torch.log(inverse_response(ldr.clip(min=net.DARKEST)))
        torch.testing.assert_close(net(ldr), known, atol=1e-5, rtol=1e-5)
        known = math.log(inverse_response(np.float64(0.9)))
        assert net(torch.full((1, 3, 64, 128), 0.9)).mean() == pytest.approx(known + (5 - known) / 4, abs=1e-4)
        assert net(torch.ones(1, 3, 64, 128)).mean() == pytest.approx(5)


@pytest.mark.parametrize("net", [EarlierIrradianceNet(), EarlierIlluminationNet()], ids=["irradiance", "illumination"])
def test_field_of_view_changes_the_answer(net):
    photo = torch.rand(2, 4, 128, 128)
    near, far = (net(photo, torch.full((2, 1), slope)) for slope in (0.5, 0.05))
    assert (near - far).abs().max() > 1e-3


@pytest.mark.parametrize("net", [EarlierIrradianceNet(), EarlierIlluminationNet()], ids=["irradiance", "illumination"])
def test_one_batch_can_be_learned(net):
    """A net whose gradient is cut somewhere stays where it is."""
    torch.manual_seed(0)
    photo, tan_half = torch.rand(2, 4, 128, 128), torch.rand(2, 1)
    shape = net(photo, tan_half).shape
    target = torch.nn.functional.interpolate(torch.rand(2, 3, 4, 8), size=shape[2:], mode="bilinear")
    if isinstance(net, EarlierIrradianceNet):
        target = target * photo[:, 3:]
    optimizer = torch.optim.Adam(net.parameters(), 2e-3)
    losses = []
    for _ in range(12):
        loss = ((net(photo, tan_half) - target) ** 2).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < 0.6 * losses[0]


@pytest.mark.parametrize("beside", [0, 3])
def test_a_folded_convolution_is_the_same_sums_in_training_and_after(beside):
    torch.manual_seed(0)
    layer = FoldedConv(4, beside, 8)
    picture, other = torch.rand(2, 4, 32, 64), torch.rand(2, beside, 16, 32) if beside else None
    layer[1].momentum = None  # its statistics are those of what it saw
    trained = layer(picture, other)
    n = trained.numel() / 8
    layer[1].running_var *= (n - 1) / n  # which keeps the variance of a sample
    layer.eval()
    torch.testing.assert_close(layer(picture, other), trained, atol=1e-4, rtol=1e-3)
