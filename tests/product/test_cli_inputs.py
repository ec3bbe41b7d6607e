"""anyprobe estimate and what it is given: every bad input is one line and exit status 2, and writes nothing."""

from __future__ import annotations

import io
import json
from pathlib import Path
from unicodedata import normalize

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from support.transforms import transforms

from anyprobe.cli.photo_files import hints_for, marks_of
from anyprobe.files.paths import natural_order
from anyprobe.inputs.hints import Hints

pytestmark = pytest.mark.usefixtures("small_masks")


def write_exr(path, rgba: np.ndarray) -> None:
    values = np.ascontiguousarray(rgba, dtype=np.float32)
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, {"RGBA": values}).write(str(path))


@pytest.mark.ci
@pytest.mark.parametrize("together", [False, True])
def test_an_error_of_a_mask_names_the_photo_it_is_of(work, command, photo_rgba, photo_mask, together):
    """Once: what names it by itself stays as it is."""
    for folder in ("photos", "masks"):
        (work / folder).mkdir()
    for stem in "abc":
        Image.fromarray(photo_rgba).save(f"photos/{stem}.png")
        Image.fromarray(photo_mask * (stem != "b")).save(f"masks/{stem}.png")
    (work / "poses.json").write_text(transforms([np.eye(3)] * 3, ("a.png", "b.png", "c.png")))
    poses = ("--poses", "poses.json") if together else ()
    outcome = command("estimate", "photos", "--mask", "masks", "-o", "out", "--json", "-q", *poses)
    assert outcome.status == 2
    (line,) = (one for one in outcome.err.splitlines() if one.startswith("anyprobe: "))
    assert line.startswith("anyprobe: photos/b.png: --mask: expected white on the object, got an empty mask")
    if not together:
        given = [json.loads(one) for one in outcome.out.splitlines()]
        assert line == f"anyprobe: {given[1]['error']}"
    (work / "photos" / "b.png").write_text("no photo")
    said = command("estimate", "photos", "--mask", "masks", "-o", "out", "-q", *poses).complaint
    assert said.startswith("anyprobe: b.png: expected an image")


@pytest.mark.parametrize(
    "words",
    [
        ("estimate", "sphere.png", "-o", "out.exr"),
        ("mask", "sphere.png", "-o", "out.PNG"),
        ("match", "sphere.png", "maps", "-o", "out.exr"),
        ("video", "clip.mp4", "-o", "out.mp4"),
        ("export", "sphere.exr", "--to", "usd", "-o", "out.usda"),
    ],
)
def test_a_file_is_no_folder_for_results(work, command, words):
    name = words[-1]
    wanted = f"anyprobe: -o {name}: expected a folder, got a name that ends in {Path(name).suffix}; "
    assert command(*words).complaint.startswith(wanted)
    assert list(work.iterdir()) == []


@pytest.mark.ci
def test_a_folder_that_is_there_or_has_a_dot_takes_results(work, command, photo_path):
    (work / "out.exr").mkdir()
    for out in ("out.exr", "v1.2"):
        assert command("estimate", photo_path, "-o", out).status == 0
        assert (work / out / "sphere.exr").is_file()


def test_folder_without_photos(work, command):
    (work / "empty").mkdir()
    assert "empty: no photos in this folder" in command("estimate", "empty").complaint


# Odd inputs that are fine


def test_own_transparency_of_every_kind_is_a_mask(work, command, photo_rgba):
    rgb, alpha = Image.fromarray(np.ascontiguousarray(photo_rgba[..., :3])), photo_rgba[..., 3]
    grey_alpha = Image.merge("LA", [rgb.convert("L"), Image.fromarray(alpha)])
    grey_alpha.save("grey_alpha.png")
    quantized = rgb.quantize(200)
    palette = Image.fromarray(np.where(alpha == 0, 255, np.asarray(quantized)).astype(np.uint8))
    colors = quantized.getpalette()
    palette.putpalette(colors + [0] * (768 - len(colors)))
    palette.save("palette_alpha.png", transparency=255)
    write_exr("linear.exr", photo_rgba.astype(np.float32) / 255)
    photos = ("grey_alpha.png", "palette_alpha.png", "linear.exr")
    outcome = command("estimate", *photos, "-o", "out", "--json")
    assert outcome.status == 0, outcome.err
    for line in outcome.out.splitlines():
        assert json.loads(line)["crop"]["center_px"] == pytest.approx([64, 48], abs=1)


def test_a_folder_of_panoramas_may_hold_radiance_files(work, photo_rgba):
    (work / "panoramas").mkdir()
    (work / "panoramas" / "room.hdr").touch()
    given = Hints(surroundings=Path("panoramas"))
    assert hints_for(Path("room.jpg"), given).surroundings == Path("panoramas/room.hdr")


def test_a_name_in_brackets_is_a_file(work, command, photo_rgba):
    Image.fromarray(photo_rgba).save("[1].png")
    assert command("mask", "[1].png", "-q").status == 0


def test_accents_may_stand_apart_in_names(work):
    """As macOS writes them."""
    apart, whole = (work / normalize(form, "é.png") for form in ("NFD", "NFC"))
    whole.write_bytes(b"")
    assert hints_for(apart, Hints(mask=work)).mask == whole
    (work / "marks.csv").write_text(f'photo,click\n{whole.name},"5,6"\n', encoding="utf-8")
    marks = marks_of(work / "marks.csv", [apart])
    assert hints_for(apart, Hints(), marks).click == [(5.0, 6.0)]


def test_names_are_ordered_whatever_digits_they_have():
    names = ["²1.jpg", "a10.jpg", "a2.jpg", "٣.jpg"]
    assert [name for name in sorted(names, key=natural_order) if name.startswith("a")] == ["a2.jpg", "a10.jpg"]


@pytest.mark.ci
@pytest.mark.parametrize(
    ("order", "written"),
    [
        (("estimate", "-"), "light/stdin.exr"),
        (("mask", "-"), "masks/stdin_mask.png"),
        (("relight", "-"), "relit/stdin_relit.png"),
        (("relight", "-", "-o", "shots"), "shots/stdin_relit.png"),
    ],
)
def test_a_photo_may_come_from_standard_input(command, photo_path, work, monkeypatch, order, written):
    for data, status in ((photo_path.read_bytes(), 0), (b"This is no photo.", 2)):
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(data)))
        done = command(*order)
        assert done.status == status, done.err
        assert Path(written).is_file() == (status == 0)
        Path(written).unlink(missing_ok=True)
    assert done.err.startswith("anyprobe: stdin: expected an image"), done.err
