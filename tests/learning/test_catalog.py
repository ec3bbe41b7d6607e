"""Which assets shipped weights may learn from, and what a folder of them looks like."""

import csv

import numpy as np
import pytest

from anyprobe.dataset.catalog import allows_commercial_use, load_maps, load_shapes
from anyprobe.errors import InputError
from anyprobe.files.radiance import write_hdr


@pytest.mark.parametrize(
    ("licence", "allowed"),
    [
        ("CC0-1.0 (Poly Haven, by name)", True),
        ("public domain (Keenan Crane)", True),
        ("CC BY 4.0; YCB Object and Model Set", True),
        ("MIT", True),
        ("Apache-2.0", True),
        ("BSD-style (OpenEXR images, ILM and contributors)", True),
        ("BSD / React 360 examples licence", False),
        ("CC BY-NC-SA 3.0 US (HDRLabs sIBL archive)", False),
        ("CC BY-SA / repository MIT", False),
        ("MIT repository, origin not stated", False),
        ("Apache-2.0 repository, origin not stated", False),
        ("unknown; MIT example asset", False),
        ("Stanford 3D Scanning Repository terms (free use with credit, no commercial resale)", False),
        ("Debevec light probe gallery; terms not stated, research use", False),
        ("", False),
    ],
)
def test_licence_is_read_strictly(licence, allowed):
    assert allows_commercial_use(licence) is allowed


def write_manifest(folder, rows):
    with (folder / "manifest.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, ["file", "category", "licence", "split"])
        writer.writeheader()
        writer.writerows(rows)


def test_manifest_decides_place_and_licence(tmp_path):
    folder = tmp_path / "train"
    folder.mkdir()
    for name, value in (("a", 0.5), ("b", 7.0), ("c", 1.0)):
        write_hdr(folder / f"{name}.hdr", np.full((16, 32, 3), value, np.float32))
    write_manifest(
        tmp_path,
        [
            {"file": "a.hdr", "category": "indoor", "licence": "CC0", "split": "train"},
            {"file": "b.hdr", "category": "outdoor", "licence": "unknown", "split": "train"},
            {"file": "c.hdr", "category": "indoor", "licence": "CC0", "split": "test"},
        ],
    )
    assert {m.name: m.indoor for m in load_maps(folder)} == {"a": True, "b": False, "c": False}
    (free,) = load_maps(folder, commercial_only=True)
    assert free.name == "a"
    np.testing.assert_allclose(free.radiance, 1.0, rtol=2e-2)  # mean luminance 1, RGBE's precision


@pytest.mark.parametrize("load", [load_maps, load_shapes])
def test_a_folder_without_assets_is_one_line(tmp_path, load):
    for folder in (tmp_path, tmp_path / "absent"):
        with pytest.raises(InputError, match="expected"):
            load(folder)
