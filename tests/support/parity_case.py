"""A photo and Python's own answers in plain files, for the page's code to be held against."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from anyprobe.core.frames import world_from_camera
from anyprobe.core.response import inverse_response, response
from anyprobe.estimate.doubts import ground_doubts
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.ground import ESTIMATED, GIVEN, Ground
from anyprobe.estimate.photo import load_photo
from anyprobe.estimate.result import Light
from anyprobe.estimate.runtime import weights_folder
from anyprobe.light.environment import rotate
from anyprobe.light.filtering import blur_cosine_power
from anyprobe.light.light_sources import LightSource, draw_sources, find_sources, split_sources
from anyprobe.light.temporal import step
from anyprobe.masks.check import look_at_given
from anyprobe.masks.find import doubt, expected_iou
from anyprobe.masks.networks import default_graph, small_network
from anyprobe.masks.search import Looks, Prompts, find_object

HINTS = {
    "none": {"on": [], "off": []},
    "clicks": {"on": [[200, 250]], "off": [[20, 30]]},
    "cut": {"on": [[200, 300]], "off": [[200, 100]]},
    "box": {"on": [], "off": [], "box": [80, 30, 310, 360]},
}
GIVEN_MATERIALS = {"gold": {"name": "gold"}, "clay": {"albedo": [0.4, 0.3, 0.2], "roughness": 0.7}}
FRAME_SECONDS = [0.03, 0.05, 0.04, 0.2, 0.03, 0.03, 0.05, 0.04, 0.03, 0.05]


STEPS = np.arange(256) / 200
"""Radiance or display values, the last ones above white."""


def _normals(mask: np.ndarray) -> np.ndarray:
    """[H, W, 3] float32: something like a ball's around the mask's middle, zero beside it."""
    y, x = np.mgrid[0 : mask.shape[0], 0 : mask.shape[1]].astype(np.float64)
    x, y = (x - x[mask > 0.5].mean()) / mask.shape[1], (y[mask > 0.5].mean() - y) / mask.shape[0]
    n = np.stack([x, y, np.full_like(x, 0.5)], axis=-1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    return np.where(mask[..., None] > 0.5, n, 0.0).astype(np.float32)


def _led(radiance: np.ndarray) -> dict[str, np.ndarray]:
    """Frames in which two lamps change rank and another flashes up, whether the object looks the same in each, and the
    lights shown after some of them."""
    base, frames, shown, state = split_sources(radiance)[1], [], [], None
    same = np.array([i not in (0, 26, 27) for i in range(40)])
    for i in range(40):
        strong = 3.0 + (2.5 if i % 5 < 2 else -1.5) * (8 < i < 20)
        lamps = [
            LightSource(direction=_unit(np.array([0.3, 0.6, 0.7])), power=np.full(3, strong), radius_deg=3.7),
            LightSource(direction=_unit(np.array([-0.9, 0.3, -0.2])), power=np.full(3, 3.4), radius_deg=3.7),
        ]
        if i in (22, 23, 30):
            lamps.append(
                LightSource(direction=_unit(np.array([0.1, 0.2, -0.9])), power=np.full(3, 12.0), radius_deg=4.7)
            )
        frames.append((base + draw_sources(len(radiance), lamps)).astype(np.float32))
        state = step(state, frames[-1], 1 / 15, looks_same=bool(same[i]))
        if i % 4 == 3:
            shown.append(_rows(state.sources))
    counts = np.array([len(rows) for rows in shown], np.float32)
    return {
        "led_frames": np.array(frames),
        "led_same": same.astype(np.float32),
        "led_counts": counts,
        "led_sources": np.concatenate(shown),
    }


def _filtered(radiance: np.ndarray) -> dict[str, np.ndarray]:
    """Frames with noise, a slow change, a jump, a cut and another jump, and the light after them; then with sources
    that tremble, one of them blinking, seen by a camera that turns: the steady light in the world and in the last one.
    """
    noise = np.random.default_rng(5).normal(0, 0.03, (len(FRAME_SECONDS), *radiance.shape))
    gains = np.array([1.0, 1.0, 1.1, 1.6, 9.0, 9.0, 9.0, 4.5, 4.5, 4.5])[:, None, None, None]
    frames = (radiance * gains * np.exp(noise)).astype(np.float32)
    state = None
    for frame, seconds in zip(frames, FRAME_SECONDS, strict=True):
        state = step(state, frame, seconds)
    found = {"frames": frames, "steadied": state.radiance}

    rng, turning, state = np.random.default_rng(6), [], None
    poses = [world_from_camera(0.1 * i, 0.2 - 0.05 * i) for i in range(len(FRAME_SECONDS))]
    for i, (pose, seconds) in enumerate(zip(poses, FRAME_SECONDS, strict=True)):
        lamps = [
            LightSource(
                direction=_unit(np.array(at) + rng.normal(0, 0.05, 3)), power=np.array(power), radius_deg=radius_deg
            )
            for at, power, radius_deg, is_on in (
                ((0.3, 0.6, 0.7), (3.0, 2.5, 2.0), 3.3, True),
                ((-0.9, 0.3, -0.2), (1.0, 1.2, 1.5), 4.7, i % 4 != 2),
                ((0.1, 0.9, -0.6), (0.5, 0.5, 0.4), 14.0, True),
            )
            if is_on
        ]
        world = split_sources(radiance)[1] + draw_sources(len(radiance), lamps)
        turning.append(np.maximum(rotate(world, pose.T), 0.0).astype(np.float32))
        state = step(state, turning[-1], seconds, world_from_camera=pose)
    sources, soft = split_sources(turning[-1])
    found |= _led(radiance)
    return found | {
        "split_soft": soft,
        "split_sources": _rows(sources),
        "turning_frames": np.array(turning),
        "turning_poses": np.array(poses),
        "turning_world": state.radiance,
        "turning_sources": _rows(state.sources),
    }


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def _rows(sources) -> np.ndarray:
    """[K, 8]: direction, power, radius and exists of each source."""
    rows = [[*one.direction, *one.power, one.radius_deg, one.exists] for one in sources]
    return np.array(rows).reshape(-1, 8)


def _given_masks(folder: Path) -> list[dict]:
    """Masks [90, 120] that are odd in some way, in files, and what is said of each."""
    y, x = np.mgrid[:90, :120]
    disc = (np.hypot(x - 60, y - 45) < 30).astype(np.float32)
    small = (np.hypot(x - 60, y - 45) < 14).astype(np.float32)
    cases = [disc, 1 - disc, np.float32(0.6) * disc, small, np.clip(disc + np.float32(0.4), 0, 1)]
    for index, mask in enumerate(cases):
        read, _ = look_at_given(mask)
        (folder / f"given_{index}.f32").write_bytes(mask.astype("<f4").tobytes())
        (folder / f"given_{index}_read.f32").write_bytes(read.astype("<f4").tobytes())
    return [{"width": 120, "said": [(one.code, one.text) for one in look_at_given(mask)[1]]} for mask in cases]


def _ground_doubts() -> list[dict]:
    """What is said of pitches: given, estimated well and badly."""
    cases = []
    for source, pitch_deg, error_deg, is_doubtful in (
        (GIVEN, 41.0, 1.0, False),
        (ESTIMATED, 12.4, 14.9, False),
        (ESTIMATED, -3.7, 18.6, False),
    ):
        ground = Ground(
            pitch_deg=pitch_deg,
            pitch_error_deg=error_deg,
            roll_deg=0.0,
            contact=(0.0, 0.0),
            source=source,
            is_doubtful=is_doubtful,
        )
        cases.append(
            {
                "pitch_deg": pitch_deg,
                "error_deg": error_deg,
                "source": source,
                "said": [(one.code, one.text) for one in ground_doubts(ground, "photo")],
            }
        )
    return cases


def _prompts(hints: dict) -> Prompts:
    """Return hints of a case, whose lists JSON has, as the search keeps them."""
    return Prompts(
        **{name: tuple(tuple(one) if isinstance(one, list) else one for one in of) for name, of in hints.items()}
    )


def _said(light: Light) -> dict:
    """Return the numbers of a light that both doors give."""
    about = light.sidecar()
    ground = light.ground and [light.ground.pitch_deg, light.ground.pitch_error_deg, light.ground.roll_deg]
    return {
        "well_exposed": light.well_exposed_fraction,
        "soft": light.soft,
        "outdoors": light.outdoors,
        "is_soft": light.is_soft,
        "side": light.brightest_side(),
        "error_deg": light.dominant_light().error_deg,
        "sources": _rows(light.sources()).tolist(),
        "metal": about["object"]["metal"],
        "level_stops": about["uncertainty"]["level_stops"],
        "seen": about["hints"].get("surroundings", 0),
        "ground": ground and [*ground, *light.ground.contact],
        "codes": [one.code for one in light.warnings],
    }


def write_parity_case(folder: Path, estimator: Estimator, photo: np.ndarray, long_fov_deg: float) -> None:
    """Write photo.rgba, mask.f32, case.json and one <name>.f32 an answer.

    Args:
        photo: [H, W, 4] uint8; its alpha marks the object.
    """
    loaded = load_photo(photo, fov_deg=long_fov_deg)
    light = estimator.from_photo(loaded)
    opaque = photo.copy()
    opaque[..., 3] = 255
    whole = estimator.from_photo(load_photo(opaque, mask=loaded.mask, fov_deg=long_fov_deg))
    (folder / "whole.rgba").write_bytes(opaque.tobytes())
    answers = {
        "mask": loaded.mask,
        "radiance": light.radiance,
        "whole_radiance": whole.radiance,
        "confidence": light.confidence,
        "whole_confidence": whole.confidence,
        "sh9": light.sh9(),
        "sources": _rows(find_sources(light.radiance)),
        "curve": response(STEPS),
        "curve_inverse": inverse_response(STEPS),
        "blurred": blur_cosine_power(light.radiance, 5.0),
    }
    rgb, found = photo[..., :3].astype(np.float32) / 255, {}
    for name, hints in HINTS.items():
        finding = find_object(Looks(small_network(), rgb), _prompts(hints))
        answers[f"mask_{name}"] = finding.mask(*rgb.shape[1::-1])
        found[name] = {"iou": expected_iou(finding), "doubt": doubt(finding)}
    answers |= _filtered(light.radiance)
    for name, values in answers.items():
        (folder / f"{name}.f32").write_bytes(np.ascontiguousarray(values, dtype="<f4").tobytes())
    (folder / "photo.rgba").write_bytes(photo.tobytes())
    weights = {"light": str(weights_folder(estimator.models.name) / "light.onnx"), "mask": str(default_graph())}
    case = {
        "height": photo.shape[0],
        "width": photo.shape[1],
        "long_fov_deg": long_fov_deg,
        "weights": weights,
        "hints": HINTS,
        "materials": GIVEN_MATERIALS,
        "frame_seconds": FRAME_SECONDS,
        "ground_doubts": _ground_doubts(),
        "given_masks": _given_masks(folder),
        "found": found,
        "lights": {name: _said(one) for name, one in (("", light), ("whole_", whole))},
    }
    (folder / "case.json").write_text(json.dumps(case))
