"""Other segmenters in place of our own networks: rembg, the SAM family, plug-ins.

A plug-in is an entry point of the group `anyprobe.segmenters`: a callable that gets what follows the colon of
`--segmenter NAME:ARGUMENT`, or "", and returns a Segmenter. It downloads or reads its own files.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import entry_points
from pathlib import Path
from typing import Protocol

import numpy as np
from PIL import Image

from anyprobe.core.resample import resample
from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import AnyprobeError, InputError, MissingExtra, ModelError
from anyprobe.files.graphs import open_graph
from anyprobe.masks.networks import Network, SmallNetwork, U2NetP
from anyprobe.masks.prompts import Point
from anyprobe.masks.search import MARGIN, Window

GROUP = "anyprobe.segmenters"


class Segmenter(Protocol):
    """Anything that segments the object of a photo.

    Attributes:
        needs_prompt: whether it needs a click or a box; without one it gets the box of what our network finds.
    """

    needs_prompt: bool

    def segment(
        self, rgb: np.ndarray, on: Sequence[Point], off: Sequence[Point], box: Sequence[float] | None
    ) -> np.ndarray:
        """Return the cover [H, W] in [0, 1] of the object in a photo [H, W, 3] uint8; clicks choose its parts later.

        Args:
            on, off: clicks x, y [px] on the object and beside it; may be empty.
            box: x0, y0, x1, y1 [px] around it; or None.
        """
        ...


SegmenterSource = str | Network | Segmenter
"""A segmenter: a name of load_segmenter, or its result."""


def load_segmenter(name: str) -> Network | Segmenter:
    """Load the segmenter NAME or NAME:ARGUMENT; u2netp and small are networks, which masks.search runs on windows.

    Raises:
        InputError: no segmenter has that name. MissingExtra: its package is absent. ModelError: its files are absent.
    """
    name, _, argument = name.partition(":")
    if name in OWN:
        return OWN[name](argument)
    found = {entry.name: entry for entry in entry_points(group=GROUP)}
    if name not in found:
        known = sorted({*OWN, *found})
        advice = did_you_mean(name, known) or "; install the package that provides it"
        raise InputError(f"expected one of {', '.join(known)}, got {name!r}{advice}", subject="segmenter")
    try:
        return found[name].load()(argument)
    except AnyprobeError:
        raise
    except Exception as error:  # a plug-in may raise whatever it likes
        raise ModelError(
            f"could not be loaded ({error}); see its own documentation", subject="segmenter", source=name
        ) from error


class Rembg:
    """A session of rembg (Gatis), by default with U2-Net; rembg downloads its weights at the first use."""

    needs_prompt = False

    def __init__(self, model: str = "") -> None:
        try:
            import rembg
            from rembg.sessions import sessions_class
        except ImportError as error:  # a package that only holds weights may have the name
            raise MissingExtra("rembg", "rembg", "--segmenter rembg", error) from error

        model = model or "u2net"
        known = {session.name() for session in sessions_class if session.is_local()}
        if model not in known:
            raise InputError(
                f"expected a model that runs here, got {model!r}; try u2net or isnet-general-use",
                subject="segmenter",
                source="rembg",
            )
        try:
            self._session = rembg.new_session(model)
        except Exception as error:  # downloads fail in many ways
            raise ModelError(
                f"{model} could not be loaded ({error}); see rembg's documentation", subject="segmenter", source="rembg"
            ) from error

    def segment(
        self, rgb: np.ndarray, on: Sequence[Point], off: Sequence[Point], box: Sequence[float] | None
    ) -> np.ndarray:
        """Return the cover of the salient object; within the box and a margin, if there is a box."""
        height, width = rgb.shape[:2]
        photo = Window(x0=0, y0=0, x1=width, y1=height)
        window = photo if box is None else photo.around((box[0], box[1], box[2], box[3]), MARGIN)
        found = np.zeros((height, width), np.float32)
        area = slice(window.y0, window.y1), slice(window.x0, window.x1)
        (mask, *_) = self._session.predict(Image.fromarray(rgb[area]))
        found[area] = np.asarray(mask.convert("L"), np.float32) / 255.0
        return found


class Sam:
    """Encoder and decoder of the SAM family as ONNX files: SAM, MobileSAM, or SAM 2, which adds finer features.

    The files are as the models' own export scripts or samexporter write them (see docs/how-to/masks.md).
    """

    needs_prompt = True
    SIDE = 1024
    MEAN, SPREAD = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])

    def __init__(self, folder: str) -> None:
        if not folder:
            raise InputError(
                "expected sam:FOLDER with *encoder*.onnx and *decoder*.onnx, got no folder",
                subject="segmenter",
                source="sam",
            )
        self._encoder, self._decoder = (self._open(Path(folder), part) for part in ("encoder", "decoder"))
        self._input = self._encoder.get_inputs()[0]
        self._wanted = [node.name for node in self._decoder.get_inputs()]
        self._is_sam2 = "high_res_feats_0" in self._wanted

    @staticmethod
    def _open(folder: Path, part: str):
        files = sorted(folder.glob(f"*{part}*.onnx"))
        if len(files) != 1:
            raise ModelError(
                f"expected one file *{part}*.onnx, got {len(files)}; name the folder of one model", source=folder
            )
        return open_graph(files[0])

    def segment(
        self, rgb: np.ndarray, on: Sequence[Point], off: Sequence[Point], box: Sequence[float] | None
    ) -> np.ndarray:
        """Return the mask that the decoder rates highest among those for these prompts."""
        height, width = rgb.shape[:2]
        size = (self.SIDE, self.SIDE) if self._is_sam2 else _fitted(width, height, self.SIDE)
        features = self._encode(np.asarray(Image.fromarray(rgb).resize(size, Image.Resampling.BILINEAR)))
        points, labels = _as_points(on, off, box)
        prompts = {
            "point_coords": (points * np.array(size) / np.array([width, height]))[None].astype(np.float32),
            "point_labels": labels[None].astype(np.float32),
            "mask_input": np.zeros((1, 1, self.SIDE // 4, self.SIDE // 4), np.float32),
            "has_mask_input": np.zeros(1, np.float32),
            "orig_im_size": np.array([height, width], np.float32),
        }
        available = {**features, **prompts}
        missing = [name for name in self._wanted if name not in available]
        if missing:
            raise ModelError(
                f"expected a decoder of SAM, MobileSAM or SAM 2, got one with an input {missing[0]}; export it again",
                subject="segmenter",
                source="sam",
            )
        answer = dict(
            zip(
                [node.name for node in self._decoder.get_outputs()],
                self._decoder.run(None, {name: available[name] for name in self._wanted}),
                strict=True,
            )
        )
        best = int(np.asarray(answer["iou_predictions"]).reshape(-1).argmax())
        odds = np.asarray(answer.get("low_res_masks", answer["masks"]))[0, best]
        return self._enlarged(odds, size, width, height)

    def _encode(self, picture: np.ndarray) -> dict[str, np.ndarray]:
        """Return the encoder's features of a picture [h, w, 3] uint8, by names of the decoder's inputs."""
        if len(self._input.shape) == 3:  # it normalises and pads by itself
            tensor = picture.astype(np.float32)
        else:
            tensor = np.zeros((1, 3, self.SIDE, self.SIDE), np.float32)
            scaled = (picture / 255.0 - self.MEAN) / self.SPREAD
            tensor[0, :, : picture.shape[0], : picture.shape[1]] = scaled.transpose(2, 0, 1)
        outputs = self._encoder.run(None, {self._input.name: tensor})
        if not self._is_sam2:
            return {"image_embeddings": outputs[0]}
        return dict(zip(("high_res_feats_0", "high_res_feats_1", "image_embed"), outputs[:3], strict=True))

    def _enlarged(self, odds: np.ndarray, size: tuple[int, int], width: int, height: int) -> np.ndarray:
        """Convert log-odds of the network's square, or of the photo, to a cover [height, width]."""
        if odds.shape != (height, width):
            scale = odds.shape[0] / self.SIDE
            shown = odds[: max(1, round(size[1] * scale)), : max(1, round(size[0] * scale))]
            odds = resample(shown, (width, height), smooth=True)
        return (1.0 / (1.0 + np.exp(-np.clip(odds, -30, 30)))).astype(np.float32)


def _fitted(width: int, height: int, side: int) -> tuple[int, int]:
    """Return width and height scaled to a longer side of `side`."""
    scale = side / max(width, height)
    return int(width * scale + 0.5), int(height * scale + 0.5)


def _as_points(on, off, box) -> tuple[np.ndarray, np.ndarray]:
    """Convert prompts to SAM's points [N, 2] in the photo's pixels and labels [N].

    Labels are 1 on the object, 0 beside it, 2 and 3 for a box's corners; without a box a point of label -1 is added.
    """
    points = [*on, *off]
    labels = [1.0] * len(on) + [0.0] * len(off)
    if box is None:
        points, labels = [*points, (0.0, 0.0)], [*labels, -1.0]
    else:
        points, labels = [*points, tuple(box[:2]), tuple(box[2:])], [*labels, 2.0, 3.0]
    return np.array(points, np.float64).reshape(-1, 2), np.array(labels)


OWN = {"u2netp": U2NetP, "small": SmallNetwork, "rembg": Rembg, "sam": Sam}
"""Segmenters of this package, by name."""
