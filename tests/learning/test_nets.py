"""Building blocks of the networks."""

import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe_train.nets.blocks import FoldedConv  # noqa: E402


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
