"""The paper's one loss, L2, over whole pictures (Sect. 3.2 to 3.4), and the same as errors."""

import torch


def l2(estimate: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """Return the mean squared difference over every pixel and channel, those off the object among them."""
    return (estimate.float() - truth.float()).square().mean()


def picture_rmse(estimate: torch.Tensor, truth: torch.Tensor, mask: torch.Tensor | None = None) -> torch.Tensor:
    """Return the root of each picture's mean square, [N]; with a mask [N, 1, H, W], within it."""
    square = (estimate - truth).square().mean(dim=1, keepdim=True)
    if mask is None:
        return square.mean(dim=(1, 2, 3)).sqrt()
    return ((square * mask).sum(dim=(1, 2, 3)) / mask.sum(dim=(1, 2, 3)).clip(min=1)).sqrt()


def best_gain(estimate: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """Scale each picture by the one number that brings it closest to the truth."""
    gain = (estimate * truth).sum(dim=(1, 2, 3)) / estimate.square().sum(dim=(1, 2, 3)).clip(min=1e-6)
    return estimate * gain[:, None, None, None]
