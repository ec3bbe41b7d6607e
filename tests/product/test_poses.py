"""Files of poses from other systems and of absurd size, and photos whose size a lens is told by."""

from __future__ import annotations

import json
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from support.refused import refused
from support.transforms import transforms

from anyprobe.core.frames import rotation_y
from anyprobe.estimate.poses import MOST_POSES, Lens, Poses, parse_poses, read_poses
from anyprobe.pictures.headers import upright_size


@pytest.mark.parametrize("size", [(60, 40), (40, 60)])
def test_tiff_on_its_side_whether_pillow_turned_its_size_or_not(size):
    opened = SimpleNamespace(size=size, format="TIFF", tag_v2={256: 60, 257: 40}, getexif=lambda: {0x0112: 8})
    assert upright_size(opened) == (40, 60)


def test_names_of_other_systems_are_found(tmp_path):
    """file_path with Windows' separators, and what one takes for a drive or a share."""
    paths = ["images\\frame_1.jpg", "C:\\clip\\images\\frame_2.jpg", ".\\frame_3", "//images/frame_4.jpg", "a:b.jpg"]
    turns = [rotation_y(0.1 * k) for k in range(5)]
    frames = json.loads(transforms(turns))["frames"]
    frames = [one | {"file_path": path} for one, path in zip(frames, paths, strict=True)]
    (tmp_path / "poses.json").write_text(json.dumps({"frames": frames}))
    poses = read_poses(tmp_path / "poses.json")
    photos = [Path(f"photos/{name}.jpg") for name in ("a:b", "frame_4", "frame_3", "frame_2", "frame_1")]
    np.testing.assert_allclose(poses.of(photos), turns[::-1], atol=1e-9)


def test_many_poses_are_searched_once():
    names = tuple(f"{k}.png" for k in range(30_000))
    turns = np.broadcast_to(np.eye(3), (len(names), 3, 3))
    poses = Poses(file="poses", world_from_camera=turns, names=names, lenses=(Lens(),) * len(names))
    begin = time.process_time()
    poses.of([Path("29999.png")])
    assert time.process_time() - begin < 2.0  # 5 ms; one name after another among all before it takes 5 s


def test_far_too_many_poses_are_not_read():
    frames = [{"file_path": "a", "transform_matrix": "none"}] * (MOST_POSES + 1)
    with refused(source="poses", naming=f"at most {MOST_POSES}"):
        parse_poses(json.dumps({"frames": frames}).encode(), "poses")
