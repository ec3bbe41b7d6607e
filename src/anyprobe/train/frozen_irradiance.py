"""The shipped irradiance graph as a torch network again, batch normalisation folded, never trained further."""

from __future__ import annotations

import torch
from torch import nn

from anyprobe.errors import ModelError
from anyprobe.infer.runtime import weights_folder
from anyprobe.nets.irradiance_net import IrradianceNet


def load_frozen_irradiance(model: str = "paper") -> tuple[nn.Module, int]:
    """A bundled model's irradiance network and how many pairs it has learned from.

    Raises:
        ModelError: the model has no irradiance graph, or one of another shape.
    """
    import onnx
    from onnx.numpy_helper import to_array

    path = weights_folder(model) / "irradiance.onnx"
    if not path.is_file():
        raise ModelError(f"model {model!r}: expected irradiance.onnx in its folder, found none")
    graph = onnx.load(str(path))
    stored = {one.name: torch.from_numpy(to_array(one).copy()).float() for one in graph.graph.initializer}
    stored |= {  # half-float weights stand behind Casts
        node.output[0]: stored[node.input[0]]
        for node in graph.graph.node
        if node.op_type == "Cast" and node.input[0] in stored
    }
    found = [node for node in graph.graph.node if node.op_type == "Conv"]
    net = IrradianceNet()
    places = _convolutions(net)
    if len(found) != len(places):
        raise ModelError(f"{path.name}: expected {len(places)} convolutions, got {len(found)}")
    for node, (parent, name) in zip(found, places, strict=True):
        weight, bias = (stored[given] for given in node.input[1:])
        old = getattr(parent, name)
        if weight.shape != old.weight.shape:
            raise ModelError(
                f"{path.name}: expected a convolution {tuple(old.weight.shape)}, got {tuple(weight.shape)}"
            )
        new = nn.Conv2d(old.in_channels, old.out_channels, old.kernel_size, old.stride, old.padding)
        new.weight.data, new.bias.data = weight, bias
        setattr(parent, name, new)
    for parent in list(net.modules()):
        for name, child in list(parent.named_children()):
            if isinstance(child, nn.BatchNorm2d):
                setattr(parent, name, nn.Identity())
    pairs = {one.key: one.value for one in graph.metadata_props}.get("pairs", "0")
    return net.eval().requires_grad_(False), int(pairs)


def _convolutions(net: IrradianceNet) -> list[tuple[nn.Module, str]]:
    """Where the convolutions stand, in the order they run."""
    body = net.body
    blocks = [*body.first, *(block for down in body.down for block in down)]
    for up, join in zip(body.up, body.join, strict=True):
        blocks += [up.conv, join]
    return [(block, "0") for block in blocks] + [(net, "head")]
