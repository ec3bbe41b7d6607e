"""Networks that find objects: U2-Net-p, trained on photos, and our own small one, which takes prompts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Protocol

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.core.resample import resample
from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError, ModelError
from anyprobe.files.graphs import check_metadata, open_graph, run_options
from anyprobe.masks.prompts import BOX_LEVEL, CLICK_SIGMA_PX, Point, draw_prompts
from anyprobe.masks.weights import GET_WEIGHTS, find_weights
from anyprobe.notices import Notice

U2NETP, SMALL = contract("mask")["u2netp"], contract("mask")["small"]
MEAN, SPREAD = (np.array(U2NETP[key], np.float32) for key in ("mean", "spread"))

SMALL_PX = SMALL["size"]
"""Side of the small network's input and output [px]."""
PADDING_GREY = SMALL["grey"]
"""Display value beside a photo that is not square."""

MASK_CONTRACT = {
    "contract": "1",
    "stage": "mask",
    "input": f"display RGB in [0, 1] of the whole photo, longer side {SMALL_PX}, centred, {PADDING_GREY} beside it; "
    "hint channel",
    "hint": f"box {BOX_LEVEL}, clicks +1 and -1, Gaussian of sigma {CLICK_SIGMA_PX:g} px",
}
"""Metadata that the small graph carries; another value means other conventions, and is refused."""


class Network(Protocol):
    """A graph, opened once; safe to share between threads.

    Attributes:
        name: what tests and benchmarks call it.
        warning: attached to every mask that it finds; or "".
        takes_prompts: whether its cover depends on clicks and box.
    """

    name: str
    warning: str
    takes_prompts: bool

    def cover(
        self, rgb: np.ndarray, on: Sequence[Point] = (), off: Sequence[Point] = (), box: Sequence[float] | None = None
    ) -> np.ndarray:
        """Return the probability that each cell of a picture is the object's, [h, w] in [0, 1], over its whole extent.

        Args:
            rgb: [H, W, 3] display values in [0, 1].
            on, off: clicks x, y on the object and beside it, in pixels of rgb.
            box: x0, y0, x1, y1 around the object.
        """
        ...


class U2NetP:
    """U2-Net-p, 320 x 320, which finds the salient object.

    Input as in rembg: resized, divided by its largest value, and normalised by ImageNet's mean and deviation.
    """

    name = "u2netp"
    warning = ""
    takes_prompts = False

    def __init__(self, path: str = "") -> None:
        if (found := find_weights(path or None)) is None:
            raise ModelError("expected the weights of U2-Net-p, found none", source="u2netp", remedy=GET_WEIGHTS)
        self._session = open_graph(found.path)
        self._input, self._output = self._session.get_inputs()[0].name, self._session.get_outputs()[0].name

    def cover(self, rgb, on=(), off=(), box=None) -> np.ndarray:
        """Return the cover [320, 320]; prompts are ignored."""
        small = resample(rgb, (U2NETP["size"], U2NETP["size"]), smooth=True)
        image = (small / max(float(small.max()), 1e-6) - MEAN) / SPREAD
        batch = np.ascontiguousarray(image.transpose(2, 0, 1)[None], np.float32)
        return self._session.run([self._output], {self._input: batch}, run_options())[0][0, 0]


class SmallNetwork:
    """Our own network, 160 x 160, trained on renders only; its fourth input channel holds the prompts."""

    name = "small"
    takes_prompts = True
    warning: str = Notice(
        "found by the small mask network, which is wrong on one photo in three",
        code="small-network",
        remedy=GET_WEIGHTS,
    )

    def __init__(self, path: str | Path = "") -> None:
        path = Path(path) if path else default_graph()
        if not path.is_file():
            raise ModelError("the mask network is missing; reinstall anyprobe", source=path)
        self._session = open_graph(path)
        check_metadata(self._session, MASK_CONTRACT, path.name)

    def cover(self, rgb, on=(), off=(), box=None) -> np.ndarray:
        """Return the cover [h, w], the longer side 160; the input is letterboxed, and the bars are cropped."""
        height, width = rgb.shape[:2]
        scale = SMALL_PX / max(height, width)
        w, h = (min(SMALL_PX, max(1, round(side * scale))) for side in (width, height))
        left, top = (SMALL_PX - w) // 2, (SMALL_PX - h) // 2

        def place(x: float, y: float) -> Point:
            return left + x * w / width, top + y * h / height

        square = np.full((SMALL_PX, SMALL_PX, 4), PADDING_GREY, np.float32)
        square[top : top + h, left : left + w, :3] = resample(rgb, (w, h), smooth=True)
        corners = None if box is None else (*place(*box[:2]), *place(*box[2:]))
        square[..., 3] = draw_prompts(SMALL_PX, [place(*p) for p in on], [place(*p) for p in off], corners)
        return self.run(square)[top : top + h, left : left + w]

    def run(self, square: np.ndarray) -> np.ndarray:
        """Return the cover [160, 160] of a letterboxed photo and its prompts [160, 160, 4]."""
        return self._session.run(None, {"input": np.ascontiguousarray(square.transpose(2, 0, 1)[None])})[0][0, 0]


@lru_cache(maxsize=1)
def small_network() -> SmallNetwork:
    """Return the bundled network, opened at the first call."""
    return SmallNetwork()


@lru_cache(maxsize=1)
def shared_network() -> Network:
    """Return U2-Net-p if its weights are installed, else the bundled network; opened at the first call."""
    return small_network() if find_weights() is None else U2NetP()


NETWORKS: dict[str, Callable[[str], Network]] = {"u2netp": U2NetP, "small": SmallNetwork}

NetworkSource = str | Network
"""A network: a name of load_network, or its result."""


def load_network(name: str) -> Network:
    """Open the network NAME or NAME:FILE, its weights being in that file.

    Raises:
        InputError: no network has that name. ModelError: its weights are absent or damaged.
    """
    name, _, file = name.partition(":")
    if name not in NETWORKS:
        advice = did_you_mean(name, NETWORKS) or "; give what another program finds as the mask"
        raise InputError(f"expected one of {', '.join(NETWORKS)}, got {name!r}{advice}", subject="segmenter")
    return NETWORKS[name](file)


def default_graph() -> Path:
    """Return the path of the bundled network."""
    return Path(str(resources.files("anyprobe") / "weights" / "mask" / "mask.onnx"))
