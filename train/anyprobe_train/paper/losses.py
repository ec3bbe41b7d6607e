"""The paper's one loss, L2, over whole pictures (Sect. 3.2 to 3.4), and the same as errors."""

import torch


def l2(estimate: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """Return the mean squared difference over every pixel and channel, those off the object among them."""
    return (estimate.float() - truth.float()).square().mean()


def picture_rmse(estimate: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """Return the root of each picture's mean square, [N]."""
    return (estimate - truth).square().mean(dim=(1, 2, 3)).sqrt()
