"""Networks: shapes, the sphere's seam, and that they can learn at all."""

import pytest

torch = pytest.importorskip("torch", reason="needs the train extra")

from anyprobe.nets.paper import HdrNet, IlluminationNet, IrradianceNet  # noqa: E402


def test_each_net_gives_the_size_the_next_one_takes():
    photo, tan_half = torch.rand(2, 4, 128, 128), torch.rand(2, 1)
    irradiance = IrradianceNet()(photo, tan_half)
    assert irradiance.shape == (2, 3, 128, 128)
    ldr = IlluminationNet()(torch.cat([irradiance, photo[:, 3:]], dim=1), tan_half)
    assert ldr.shape == (2, 3, 64, 128)
    assert ldr.min() >= 0
    assert ldr.max() <= 1
    assert HdrNet()(ldr).shape == (2, 3, 64, 128)


def test_irradiance_is_empty_outside_the_mask():
    photo = torch.rand(1, 4, 128, 128)
    photo[:, 3, :, :64] = 0
    assert IrradianceNet()(photo, torch.ones(1, 1))[..., :64].abs().max() == 0


def test_hdr_net_sees_across_the_seam():
    """Turning the map turns the answer: no column is special."""
    torch.manual_seed(0)
    net = HdrNet().eval()
    ldr = torch.rand(1, 3, 64, 128)
    turned = net(torch.roll(ldr, 64, dims=3))
    difference = (torch.roll(turned, -64, dims=3) - net(ldr)).abs().max()
    assert difference < 1e-4


@pytest.mark.parametrize("net", [IrradianceNet(), IlluminationNet()], ids=["irradiance", "illumination"])
def test_field_of_view_changes_the_answer(net):
    photo = torch.rand(2, 4, 128, 128)
    near, far = (net(photo, torch.full((2, 1), slope)) for slope in (0.5, 0.05))
    assert (near - far).abs().max() > 1e-3


@pytest.mark.parametrize("net", [IrradianceNet(), IlluminationNet()], ids=["irradiance", "illumination"])
def test_one_batch_can_be_learned(net):
    """A net whose gradient is cut somewhere stays where it is."""
    torch.manual_seed(0)
    photo, tan_half = torch.rand(2, 4, 128, 128), torch.rand(2, 1)
    shape = net(photo, tan_half).shape
    target = torch.nn.functional.interpolate(torch.rand(2, 3, 4, 8), size=shape[2:], mode="bilinear")
    if isinstance(net, IrradianceNet):
        target = target * photo[:, 3:]
    optimizer = torch.optim.Adam(net.parameters(), 2e-3)
    losses = []
    for _ in range(25):
        loss = ((net(photo, tan_half) - target) ** 2).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < 0.4 * losses[0]
