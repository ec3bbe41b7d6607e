"""Which assets shipped weights may learn from, and what a folder of them looks like."""

import csv
import hashlib

import numpy as np
import OpenEXR
import pytest
from support.mesh_files import ply

from anyprobe.core.latlong import pixel_directions
from anyprobe.maps.radiance import write_exr, write_hdr
from anyprobe_train.dataset.catalog import allows_commercial_use, load_maps, load_shapes

WHITE = np.ones((8, 16, 3), np.float32)
CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
SIDES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]


@pytest.mark.parametrize(
    ("licence", "allowed"),
    [
        ("CC0-1.0 (Poly Haven, by name)", True),
        ("public domain (Keenan Crane)", True),
        ("CC BY 4.0; YCB Object and Model Set", True),
        ("MIT", True),
        ("BSD-style (OpenEXR images, ILM and contributors)", True),
        ("BSD / React 360 examples licence", False),
        ("CC BY-NC-SA 3.0 US (HDRLabs sIBL archive)", False),
        ("MIT repository, origin not stated", False),
        ("Stanford 3D Scanning Repository terms (free use with credit, no commercial resale)", False),
        ("Debevec light probe gallery; terms not stated, research use", False),
        ("", False),
        ("MIT License", True),
        ("Apache License 2.0", True),
        ("modified Apache 2.0", False),
        ("BSD-3-Clause", True),
        ("cc_by 3.0 US", True),
        ("CC0 1.0 Universal, no rights reserved", True),
        ("Creative Commons Attribution 4.0 International", True),
        ("CC Attribution-NonCommercial", False),
        ("Creative Commons Attribution-NonCommercial 4.0", False),
        ("CC BY 4.0, not for commercial use", False),
        ("CC-BY-ND-4.0", False),
        ("CC BY\u2011NC 4.0", False),
        ("CC BY 4.0 for research use", False),
        ("CC0, probably", False),
        ("CC", False),
        ("owner unknown", False),
    ],
)
def test_licence_is_read_strictly(licence, allowed):
    assert allows_commercial_use(licence) is allowed


def write_manifest(folder, rows, columns=("file", "category", "licence", "split")):
    with (folder / "manifest.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, columns)
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


def listed(load, folder, **options):
    """Names of the assets, and the reported lines by the file or folder that each begins with."""
    lines = []
    assets = load(folder, report=lines.append, **options)
    assert not any("\n" in line for line in lines)
    by_name = {line.split(": ")[0]: line for line in lines}
    assert len(by_name) == len(lines)
    return [one.name for one in assets], by_name


@pytest.fixture
def mixed_maps(tmp_path):
    """Two good maps among bad ones, and files that nobody takes for maps."""
    folder = tmp_path / "maps"
    folder.mkdir()
    write_hdr(folder / "a.hdr", WHITE)
    write_exr(folder / "z.exr", WHITE)
    write_hdr(folder / "black.hdr", 0 * WHITE)
    OpenEXR.File({}, {"RGB": np.full((8, 16, 3), 3e38, np.float32)}).write(str(folder / "huge.exr"))
    OpenEXR.File({}, {"RGB": np.full((8, 16, 3), np.nan, np.float32)}).write(str(folder / "nan.exr"))
    OpenEXR.File({}, {"RGB": np.ones((9, 9, 3), np.float32)}).write(str(folder / "square.exr"))
    (folder / "cut.hdr").write_bytes((folder / "a.hdr").read_bytes()[:-9])
    (folder / "empty.exr").write_bytes(b"")
    (folder / "picture.jpg").write_bytes(b"\xff\xd8\xff")
    (folder / "folder.exr").mkdir()
    (folder / "README.md").write_text("maps")
    return folder


BAD_MAPS = {
    "black.hdr": "expected light",
    "huge.exr": "expected light",
    "nan.exr": "NaN",
    "square.exr": "2 x height",
    "cut.hdr": "8 whole rows",
    "empty.exr": "0 bytes",
}


def test_bad_maps_are_listed_and_the_others_go_on(mixed_maps):
    names, lines = listed(load_maps, mixed_maps)
    assert names == ["a", "z"]
    assert "is a folder, not a radiance map" in lines.pop(str(mixed_maps / "folder.exr"))
    assert set(lines) == set(BAD_MAPS)
    for name, word in BAD_MAPS.items():
        assert word in lines[name]


def test_row_of_another_folder_gives_no_licence(tmp_path):
    """test/a.hdr is not train/a.hdr."""
    folder = tmp_path / "train"
    folder.mkdir()
    write_hdr(folder / "a.hdr", WHITE)
    write_manifest(tmp_path, [{"file": "test/a.hdr", "licence": "CC0"}], columns=("file", "licence"))
    (one,) = load_maps(folder)
    assert one.licence == "not stated"


def test_the_manifest_says_whose_lights_are_made_up(tmp_path):
    for name in ("a", "b", "c"):
        write_hdr(tmp_path / f"{name}.hdr", WHITE)
    rows = [{"file": "a.hdr", "lifted": "1"}, {"file": "b.hdr", "lifted": "0"}, {"file": "c.hdr"}]
    write_manifest(tmp_path, rows, columns=("file", "lifted"))
    assert {one.name: one.lifted for one in load_maps(tmp_path)} == {"a": True, "b": False, "c": False}


def test_files_left_out_for_their_licence_are_counted(tmp_path):
    """Also a bad one: nobody asked for it."""
    for name in ("a", "b", "c"):
        write_hdr(tmp_path / f"{name}.hdr", WHITE)
    (tmp_path / "d.hdr").write_bytes(b"")
    write_manifest(tmp_path, [{"file": "a.hdr", "licence": "CC0"}])
    names, lines = listed(load_maps, tmp_path, commercial_only=True)
    assert names == ["a"]
    assert list(lines) == [str(tmp_path)]
    assert "3 files left out" in lines[str(tmp_path)]
    assert listed(load_maps, tmp_path)[0] == ["a", "b", "c"]


def test_id_is_that_of_the_bytes(tmp_path):
    """The same under another name, another for another file; and the licence comes along."""
    (tmp_path / "a.ply").write_bytes(ply(CORNERS, SIDES))
    (tmp_path / "b.ply").write_bytes(ply(CORNERS, SIDES))
    (tmp_path / "c.ply").write_bytes(ply(CORNERS, SIDES, binary=True))
    write_manifest(tmp_path, [{"file": "b.ply", "licence": "MIT"}])
    a, b, c = load_shapes(tmp_path)
    assert a.id == b.id == hashlib.sha256(ply(CORNERS, SIDES)).hexdigest()[:8]
    assert c.id != a.id
    assert [one.licence for one in (a, b, c)] == ["not stated", "MIT", "not stated"]
    write_hdr(tmp_path / "a.hdr", WHITE)
    (one,) = load_maps(tmp_path, report=lambda line: None)
    assert one.id == hashlib.sha256((tmp_path / "a.hdr").read_bytes()).hexdigest()[:8]


@pytest.mark.parametrize("height", [2, 20, 100, 256, 300, 512, 600])
def test_map_of_any_height_comes_at_one_size(tmp_path, height):
    """L = 1 + 0.3 x + 0.5 y has mean 1: read back, it is itself at every pixel."""

    def gradient(height):
        d = pixel_directions(height)
        return np.repeat(1 + 0.3 * d[..., :1] + 0.5 * d[..., 1:2], 3, axis=-1)

    write_exr(tmp_path / "a.exr", 7.0 * gradient(height), half=False)
    (one,) = load_maps(tmp_path)
    assert one.radiance.shape == (256, 512, 3)
    if height >= 20:
        np.testing.assert_allclose(one.radiance, gradient(256), atol=0.06 if height == 20 else 0.005)


def test_evaluate_lists_what_it_cannot_use(mixed_maps, command, tmp_path):
    """And ends before any work when nothing is left."""
    shapes = tmp_path / "shapes"
    shapes.mkdir()
    (shapes / "flat [1].ply").write_bytes(ply(CORNERS * [1, 0, 0], SIDES))
    outcome = command("evaluate", "--hdri", mixed_maps, "--meshes", shapes, "-o", tmp_path / "out")
    *warnings, last = outcome.err.splitlines()
    assert outcome.status == 2
    assert last.startswith(f"anyprobe: {shapes}: expected")
    assert len(warnings) == len(BAD_MAPS) + 2
    for name in (*BAD_MAPS, "flat [1].ply"):
        assert any(line.startswith(f"warning: {name}: ") for line in warnings)
    assert not (tmp_path / "out").exists()
