"""Networks: shapes, the sphere's seam, and that they can learn at all."""

import pytest

torch = pytest.importorskip("torch", reason="needs the train extra")

from anyprobe.nets.paper import HdrNet, IlluminationNet, IrradianceNet, PlaceFeatures  # noqa: E402


def test_each_net_gives_the_size_the_next_one_takes():
    photo, tan_half = torch.rand(2, 4, 128, 128), torch.rand(2, 1)
    irradiance = IrradianceNet()(photo, tan_half)
    assert irradiance.shape == (2, 3, 128, 128)
    ldr = IlluminationNet()(torch.cat([irradiance, photo[:, 3:]], dim=1), tan_half)
    assert ldr.shape == (2, 3, 64, 128)
    assert ldr.min() >= 0
    assert ldr.max() <= 1
    assert HdrNet()(ldr).shape == (2, 3, 64, 128)


def test_what_a_place_shows_is_lifted_to_where_it_mirrors_and_to_where_it_faces():
    """Normals to the right of a far camera mirror what is behind the object."""
    places = PlaceFeatures((8, 8, 8, 8))
    with torch.no_grad():
        for parameter in places.head.parameters():
            parameter.zero_()
        places.head.bias[places.FEATURES] = 1e4  # of normals, x
    image = torch.full((1, 4, 32, 32), 0.5)
    image[:, 3] = 1.0
    wo = torch.zeros(1, 3, 32, 32)
    wo[:, 2] = 1.0
    scales, normals = places([torch.rand(1, 8, 32 >> k, 32 >> k) for k in range(4)], image, wo)
    torch.testing.assert_close(normals[0, :, 5, 5], torch.tensor([1.0, 0.0, 0.0]), atol=1e-3, rtol=0)
    assert [scale.shape[2:] for scale in scales] == [(16, 32), (8, 16), (4, 8)]
    mirrored, faced = scales[0].chunk(2, dim=1)
    for seen, column in ((mirrored, 16), (faced, 24)):  # along -Z, along +X
        share = seen[0, -1].sum(dim=0)
        assert share[column - 1 : column + 1].sum() > 0.99 * share.sum() > 0.5
    shown = mirrored[0, :3].flatten(1).amax(dim=1)
    torch.testing.assert_close(shown, torch.full((3,), 0.5), atol=2e-3, rtol=0)


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
