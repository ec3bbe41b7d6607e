"""The chain's layers are those of `lift`."""

import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")
pytest.importorskip("onnx", reason="needs ./train[torch]")
pytest.importorskip("tensorboard", reason="needs ./train[torch]")

from anyprobe_train.nets.light_net import LightNet, display  # noqa: E402
from anyprobe_train.train.chain import Chain  # noqa: E402
from anyprobe_train.train.from_lift import chain_from_lift  # noqa: E402


def test_the_chains_illumination_net_answers_as_lift_does_of_the_same_picture():
    """A LightNet to which nothing is given, whose own irradiance is its photo: the layers are the same ones."""
    torch.manual_seed(0)
    theirs = LightNet().eval()
    nets = torch.nn.ModuleDict({"light": theirs})
    with torch.no_grad():
        theirs.object.head.weight[:12], theirs.object.head.bias[:12] = 0.0, 0.0  # no residual
        theirs.object.alpha.weight.zero_(), theirs.object.alpha.bias.zero_()  # sqrt(alpha) of one half
        whole = theirs.normals.whole[1].weight
        whole.copy_(torch.randn(256, 64) @ torch.randn(64, whole.shape[1]) / 500)  # of the rank that the chain keeps
        theirs.object.surroundings[-1].weight.zero_(), theirs.object.surroundings[-1].bias.zero_()
        theirs.object.material[-1].bias.zero_()
    ours = Chain.networks()
    ours.load_state_dict(ours.state_dict() | chain_from_lift(nets.state_dict(), ours.state_dict()))
    ours.eval()
    image = torch.nn.functional.interpolate(torch.rand(2, 4, 16, 16), size=128, mode="bilinear")
    image[:, 3:] = (image[:, 3:] > 0.4).float()
    image[:, :3] *= image[:, 3:]
    tan_half = torch.full((2, 1), 0.2)
    with torch.no_grad():
        guess = theirs(image, tan_half)
        shown, normals = ours["illumination"].shown_and_normals(image, tan_half)
    torch.testing.assert_close(normals, guess.normals, atol=1e-3, rtol=0)
    torch.testing.assert_close(shown, display(guess.ln_shown), atol=1e-3, rtol=0)
