"""Pictures and maps read at other places and sizes, by operations that an ONNX graph has. Channels come first."""

import torch


def index_of(axis: torch.Tensor) -> torch.Tensor:
    """Return 0, 1, 2, ... along a vector of any length."""
    return torch.cumsum(torch.ones_like(axis), dim=0) - 1.0


def read_weights(start: torch.Tensor, side: torch.Tensor, size: int, axis: torch.Tensor) -> torch.Tensor:
    """Return how much of each pixel of an axis every sample of the window [start, start + side) holds, [size, L].

    Means over the pixels covered when shrinking, linear when enlarging; zero outside the picture.
    axis: any vector of the axis' length L.
    """
    pixel = index_of(axis)[None]
    step = side / size
    low = start + step * torch.arange(size, dtype=torch.float32, device=axis.device)[:, None]
    covered = (torch.minimum(low + step, pixel + 1.0) - torch.maximum(low, pixel)).clamp(min=0.0) / step
    linear = (1.0 - (low + step / 2.0 - 0.5 - pixel).abs()).clamp(min=0.0)
    return torch.where(step >= 1.0, covered, linear)


def read_window(
    picture: torch.Tensor, start: tuple[torch.Tensor, torch.Tensor], sides: tuple[torch.Tensor, torch.Tensor], size: int
) -> torch.Tensor:
    """Return the window of a picture [C, H, W] from (x, y) on, of sides (x, y) in its pixels, as [C, size, size]."""
    across = read_weights(start[0], sides[0], size, picture[0, 0])
    down = read_weights(start[1], sides[1], size, picture[0, :, 0])
    return torch.matmul(down, torch.matmul(picture, across.T))


def read_photo(
    photo: torch.Tensor, start: tuple[torch.Tensor, torch.Tensor], side: torch.Tensor, size: int
) -> torch.Tensor:
    """Return a square window of a photo [H, W, C] as read_window does, [C, size, size]: rows first, as they lie in
    memory."""
    across, down = (
        read_weights(at, side, size, axis) for at, axis in zip(start, (photo[0, :, 0], photo[:, 0, 0]), strict=True)
    )
    rows = torch.matmul(down, photo.flatten(1)).unflatten(1, (-1, photo.shape[2]))
    return torch.matmul(rows.permute(2, 0, 1), across.T)
